"""TIFF layout: which of the many layouts of samples in a TIFF file are photos that can be read, from its tags alone."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

from PIL.TiffImagePlugin import ImageFileDirectory_v2

from fairing.errors import InputError
from fairing.image_kinds import camera_raw, float_samples

WIDTH, HEIGHT, BITS, PHOTOMETRIC, SUBFILE = 256, 257, 258, 262, 254
WHITE_IS_ZERO, RGB = 0, 2
"""Values of `PHOTOMETRIC`."""
_PLANES, _EXTRA, _SAMPLE_FORMAT, _DNG_VERSION = 284, 338, 339, 50706
_RAW = (32803, 34892)
"""Values of `PHOTOMETRIC`: colour filter array and linear raw."""
_SIGNED, _FLOAT = 2, 3
"""Values of the sample format."""
_PREMULTIPLIED = (1,)


def read_tags(file: BinaryIO) -> Mapping[int, Any]:
    """The tags of the first page of a TIFF file.

    Raises:
        Exception: the file is damaged.
    """
    file.seek(0)
    head = file.read(8)
    if head[2] == 43:  # BigTIFF
        head += file.read(8)
    directory = ImageFileDirectory_v2(head)
    file.seek(directory.next)
    directory.load(file)
    return {tag: directory[tag] for tag in (BITS, PHOTOMETRIC, SUBFILE, _PLANES, _EXTRA, _SAMPLE_FORMAT, _DNG_VERSION)
            if tag in directory}  # fmt: skip


def is_part(tags: Mapping[int, Any]) -> bool:
    """Whether a page is marked as a reduced picture (bit 0) or as a mask (bit 2)."""
    return bool(int(tags.get(SUBFILE, 0)) & 0b101)


def bits_of_photo(tags: Mapping[int, Any], path: Path) -> int:
    """Bits per sample of a photo.

    Raises:
        InputError: the first page is not a photo, its samples are neither integers of up to 16 bits, or no decoder
            reads this layout at full depth.
    """
    bits, formats = (_all_of(tags.get(tag, 1)) for tag in (BITS, _SAMPLE_FORMAT))
    photometric = tags.get(PHOTOMETRIC)
    if _DNG_VERSION in tags or photometric in _RAW:
        raise InputError(f"photo {path}: {camera_raw()}")
    if is_part(tags):
        raise InputError(f"photo {path}: its first page is a thumbnail or mask; save the photo as a TIFF of one page")
    if _FLOAT in formats:
        raise InputError(f"photo {path}: {float_samples(path)}")
    if max(bits) > 16 or _SIGNED in formats:
        found = f"{max(bits)} {'signed' if _SIGNED in formats else 'unsigned'} bits"
        raise InputError(
            f"photo {path}: expected samples of 8 or 16 unsigned bits, found {found}; save it as a PNG of 16 bits"
        )
    if max(bits) > 8 and len(bits) > 1:
        found = (
            "separate planes" if tags.get(_PLANES, 1) != 1
            else "premultiplied alpha" if tags.get(_EXTRA) == _PREMULTIPLIED
            else "colours other than RGB" if photometric != RGB
            else None
        )  # fmt: skip
        if found is not None:
            raise InputError(f"photo {path}: a TIFF of 16 bits with {found} is not read; save it as a PNG of 16 bits")
    return max(bits)


def _all_of(value: int | tuple[int, ...]) -> tuple[int, ...]:
    return value if isinstance(value, tuple) else (value,)
