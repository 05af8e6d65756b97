"""The photos of a folder without cameras: which files they are, and which of them come from one camera."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from fairing.errors import InputError
from fairing.image_file import Shot, read_shot
from fairing.io.photo_folder import photo_files
from fairing.util.orientation import turned_size

MIN_PHOTOS = 3
"""A vertex takes part in a run only if at least so many photos see it."""
FULL_FRAME_DIAGONAL = (36**2 + 24**2) ** 0.5
"""Millimetres: CIPA DCG-001 defines the 35 mm equivalent of a focal length by the diagonal of the frame."""


@dataclass(frozen=True)
class PhotoFile:
    """A photo without a camera.

    Attributes:
        path: of the file.
        name: of its view in the capture; unique.
        shot: what the file tells of it.
        size: (width, height) in pixels of the upright photo.
    """

    path: Path
    name: str
    shot: Shot
    size: tuple[int, int]

    @property
    def camera_key(self) -> tuple[object, ...]:
        """Equal for photos of one camera with one focal length, at one size."""
        return (*self.size, self.shot.camera, self.shot.focal_length, self.shot.focal_length_35)

    def focal_length(self, size: tuple[int, int]) -> float | None:
        """Focal length in pixels of the photo at another size, by its 35 mm equivalent; None if the file does not tell."""
        if self.shot.focal_length_35 is None:
            return None
        return self.shot.focal_length_35 / FULL_FRAME_DIAGONAL * (size[0] ** 2 + size[1] ** 2) ** 0.5


@dataclass(frozen=True)
class PhotoSet:
    """The photos of a folder.

    Attributes:
        photos: sorted by path.
        unreadable: reason by file name of those that are left out.
    """

    photos: tuple[PhotoFile, ...]
    unreadable: dict[str, str]

    @property
    def cameras(self) -> list[list[int]]:
        """Indices of the photos of each camera."""
        groups: dict[tuple[object, ...], list[int]] = {}
        for i, photo in enumerate(self.photos):
            groups.setdefault(photo.camera_key, []).append(i)
        return list(groups.values())


def read_photo_set(folder: Path) -> PhotoSet:
    """The photos in a folder, or in its `images/` or `photos/` if these hold more.

    Raises:
        InputError: there is no such folder, or fewer than `MIN_PHOTOS` photos can be read.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a folder of photos, found {'a file' if folder.exists() else 'none'}")
    files = photo_files(folder)
    shots, unreadable = {}, {}
    for file in files:
        try:
            shots[file] = read_shot(file)
        except InputError as error:
            unreadable[file.name] = str(error).removeprefix(f"photo {file}: ")
    if len(shots) < MIN_PHOTOS:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in list(unreadable.items())[:2])
        raise InputError(
            f"{folder}: expected at least {MIN_PHOTOS} photos, found {len(shots) or 'none'}{'; ' * bool(reasons)}{reasons}"
        )
    stems = Counter(file.stem for file in shots)
    photos = tuple(
        # Photos are written as PNG, because a second JPEG compression would change them.
        PhotoFile(
            file,
            f"{file.stem if stems[file.stem] == 1 else file.name}.png",
            shot,
            turned_size(shot.size, shot.orientation),
        )
        for file, shot in shots.items()
    )
    return PhotoSet(photos, unreadable)
