"""Mask files: which image belongs to which photo, by the names that programs give masks.

| name, for a photo `a.jpg` | program |
|---|---|
| `masks/a.jpg.png` | COLMAP |
| `masks/a.png`, `masks/a.jpg` | nerfstudio, Meshroom |
| `masks/a_mask.png` | Metashape |
| `a_mask.png`, `a.mask.png`, `a.jpg.mask.png` beside the photo | OpenDroneMap, RealityCapture |

In all of them black pixels are ignored. Every suffix of a photo is accepted.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

from fairing.image_file import read_header
from fairing.io.capture import PHOTO_SUFFIXES, files_below, files_in, listed, reading
from fairing.photo import FilePhoto, Mask, mask_orientation, opaque_part
from fairing.scene import View
from fairing.util.orientation import AS_STORED, turned_size

MASK_FOLDER = "masks"
_OTHER_FOLDERS = ("masks", "mask")
"""Names, in lower case, of folders that are noted where `MASK_FOLDER` holds no masks."""
ENDINGS = ("_mask", ".mask")


def masks_of(
    views: Sequence[View], kept: Sequence[int], given: Path | None, folder: Path
) -> tuple[list[Mask | None], tuple[str, ...]]:
    """The masks of the kept views, and warnings. Masks that the capture's format names are used where there is no other.

    A photo with transparent pixels is masked there as well; alpha that leaves no pixel is not used.

    Args:
        views: all views of the capture, to which masks may belong.
        given: the folder of masks; None: `masks` in `folder`, else images beside the photos.
        folder: the folder of the cameras.

    Raises:
        InputError: a photo with an alpha channel cannot be decoded.
    """
    named = {view.name: view.mask.path for view in views if view.mask is not None and view.mask.path is not None}
    found, warnings = _in_folder(views, given or folder / MASK_FOLDER, named)
    if not found and given is None:
        found = _beside(views)
        if found:
            warnings += (f"masks: {len(found)} of {len(views)} photos have one beside them",)
        elif not named:
            warnings += _elsewhere(views, folder)
    files = named | found
    is_transparent, notes = _transparent([views[i] for i in kept])
    masks = [
        _mask(views[i], files.get(views[i].name), transparent)
        for i, transparent in zip(kept, is_transparent, strict=True)
    ]
    return masks, warnings + notes + _taken_as_upright([(views[i], mask) for i, mask in zip(kept, masks, strict=True)])


def _mask(view: View, file: Path | None, is_transparent: bool) -> Mask | None:
    if file is None and not is_transparent:
        return None
    photo = view.photo
    if not isinstance(photo, FilePhoto):
        return Mask(file)
    orientation = AS_STORED if file is None else mask_orientation(file, photo)
    return Mask(
        file,
        photo.lens,
        alpha=photo.path if is_transparent else None,
        orientation=orientation,
        alpha_orientation=photo.orientation,
    )


def _taken_as_upright(masked: Sequence[tuple[View, Mask | None]]) -> tuple[str, ...]:
    """A line about masks of turned photos that fit as stored and turned, where no tag decides."""
    names = []
    for view, mask in masked:
        photo = view.photo
        if not isinstance(photo, FilePhoto) or mask is None or mask.path is None:
            continue
        fits_both = turned_size(photo.size, photo.orientation) == photo.size
        if photo.orientation != AS_STORED and fits_both and mask.orientation == AS_STORED:
            names.append(view.name)
    if not names:
        return ()
    return (f"masks of turned photos, taken as made of the upright picture: {len(names)} ({listed(names)})",)


def _in_folder(
    views: Sequence[View], folder: Path, named: Mapping[str, Path]
) -> tuple[dict[str, Path], tuple[str, ...]]:
    """Masks in a folder by photo, and warnings.

    Args:
        named: masks by photo that the capture's format names.
    """
    if not folder.is_dir():
        return {}, ()
    with reading(folder, "a folder of masks"):
        files = {path.relative_to(folder).as_posix(): path for path in files_below(folder, PHOTO_SUFFIXES)}
    masks = _matched([view.name for view in views], files)
    masks = {name: path for name, path in masks.items() if named.get(name) != path}
    warnings = []
    if masks:
        warnings.append(f"masks: {len(masks)} of {len(views)} photos have one in {folder}")
    used = {*masks.values(), *named.values()}
    unused = [file for file, path in files.items() if path not in used]
    if unused:
        warnings.append(
            f"masks that belong to no photo: {len(unused)} ({listed(unused)}); name a mask as its photo with .png appended"
        )
    return masks, tuple(warnings)


def _matched(names: Sequence[str], files: Mapping[str, Path]) -> dict[str, Path]:
    """Masks by photo: by path below the folders of photos and masks; if none agrees, by file names that are unique.

    Args:
        files: paths by their path in the folder of masks.
    """
    # One mask of each name: PNG, which has no loss, before others.
    ordered = sorted(files, key=lambda file: (PurePosixPath(file).suffix.lower() != ".png", file), reverse=True)
    masks = {_stem(file): files[file] for file in ordered}
    paths = {name: name.removeprefix("images/") for name in names}
    found = _by_name(paths, masks)
    if found or not masks:
        return found
    short = {name: PurePosixPath(name).name for name in names}
    short_masks = {PurePosixPath(base).name: path for base, path in masks.items()}
    is_unique = len(set(short.values())) == len(names) and len(short_masks) == len(masks)
    return _by_name(short, short_masks) if is_unique else {}


def _by_name(paths: Mapping[str, str], masks: Mapping[str, Path]) -> dict[str, Path]:
    """Masks by photo.

    Args:
        paths: path of each photo, with its suffix.
        masks: masks by path, without their suffix.
    """
    count = Counter(_stem(path) for path in paths.values())
    found = {}
    for name, path in paths.items():
        stem = _stem(path)
        # `a.png` is not the mask of `a.jpg` where there is a photo `a.tif` as well.
        bases = [path, *(base + ending for ending in ENDINGS for base in (stem, path)), *([stem] * (count[stem] == 1))]
        file = next((masks[base] for base in bases if base in masks), None)
        if file is not None:
            found[name] = file
    return found


def _beside(views: Sequence[View]) -> dict[str, Path]:
    """Masks beside their photos, which have an ending in their name."""
    photos = {view.name: view.photo.path for view in views if isinstance(view.photo, FilePhoto)}
    masks = {}
    for parent in {photo.parent for photo in photos.values()}:
        files = [file for file in files_in(parent, PHOTO_SUFFIXES) if file.stem.endswith(ENDINGS)]
        by_stem = {file.stem: file for file in files if file not in photos.values()}
        if by_stem:
            masks |= _by_name({name: path.name for name, path in photos.items() if path.parent == parent}, by_stem)
    return masks


def _elsewhere(views: Sequence[View], folder: Path) -> tuple[str, ...]:
    """A line about a folder of masks that is not where masks are searched for."""
    photos = sorted({view.photo.path.parent for view in views if isinstance(view.photo, FilePhoto)})
    names = [view.name for view in views]
    for place in dict.fromkeys((folder, *photos, *(photo.parent for photo in photos))):
        for found in _subfolders(place):
            if found.name.lower() in _OTHER_FOLDERS and found.resolve() != (folder / MASK_FOLDER).resolve():
                files = {file.relative_to(found).as_posix(): file for file in files_below(found, PHOTO_SUFFIXES)}
                n_found = len(_matched(names, files))
                if n_found:
                    return (
                        f"masks of {n_found} photos lie in {found} and are not used; use them with --masks {found}",
                    )
    return ()


def _subfolders(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return []


def _transparent(views: Sequence[View]) -> tuple[list[bool], tuple[str, ...]]:
    """Whether each photo has transparent pixels to be ignored, and warnings."""
    is_transparent, without_pixels = [], []
    for view in views:
        used = False
        if isinstance(view.photo, FilePhoto) and read_header(view.photo.path).has_alpha:
            opaque = opaque_part(view.photo.path)
            used = bool(opaque.any() and not opaque.all())
            if not opaque.any():
                without_pixels.append(view.name)
        is_transparent.append(used)
    warnings = []
    if any(is_transparent):
        warnings.append(f"masks: transparent pixels of {sum(is_transparent)} of {len(views)} photos are ignored")
    if without_pixels:
        warnings.append(
            f"photos that are transparent everywhere: {len(without_pixels)} ({listed(without_pixels)}); their alpha is "
            "not used"
        )
    return is_transparent, tuple(warnings)


def _stem(path: str) -> str:
    """The path without its suffix."""
    return path[: len(path) - len(PurePosixPath(path).suffix)]
