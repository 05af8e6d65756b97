"""Kinds of image files by their first bytes, for messages about files that are not read.

Sources: the formats' specifications; ISO 14496-12 (`ftyp` brands), TIFF 6.0 and Adobe's DNG specification for TIFF-based
camera raw files.
"""

from pathlib import PurePath

_TO_PHOTO = "convert it to JPEG or PNG, e.g. `magick {name} {stem}.jpg`"
_TO_DEEP = "convert it to a PNG of 16 bits, e.g. `magick {name} -depth 16 {stem}.png`, with one exposure for all photos"
_DEVELOP = "develop it to JPEG or to a TIFF of 16 bits with the camera's program, darktable or RawTherapee"
_EXPORT = "export the photo as JPEG or PNG"

_STARTS: tuple[tuple[bytes, str, str], ...] = (
    (b"\x76\x2f\x31\x01", "OpenEXR", _TO_DEEP),
    (b"#?RADIANCE", "Radiance HDR", _TO_DEEP),
    (b"#?RGBE", "Radiance HDR", _TO_DEEP),
    (b"Pf\n", "a PFM file of float samples", _TO_DEEP),
    (b"PF\n", "a PFM file of float samples", _TO_DEEP),
    (b"\x00\x00\x00\x0cjP  \r\n", "JPEG 2000", _TO_PHOTO),
    (b"\xff\x4f\xff\x51", "JPEG 2000", _TO_PHOTO),
    (b"\x00\x00\x00\x0cJXL \r\n", "JPEG XL", _TO_PHOTO),
    (b"\xff\x0a", "JPEG XL", _TO_PHOTO),
    (b"GIF87a", "GIF", _TO_PHOTO),
    (b"GIF89a", "GIF", _TO_PHOTO),
    (b"8BPS", "a Photoshop document", _EXPORT),
    (b"%!PS", "PostScript", _EXPORT),
    (b"\xc5\xd0\xd3\xc6", "PostScript", _EXPORT),
    (b"%PDF", "PDF", _EXPORT),
    (b"<svg", "SVG", _EXPORT),
    (b"FUJIFILMCCD-RAW", "a camera raw file", _DEVELOP),
    (b"IIRO", "a camera raw file", _DEVELOP),
    (b"IIRS", "a camera raw file", _DEVELOP),
    (b"MMOR", "a camera raw file", _DEVELOP),
    (b"IIU\x00", "a camera raw file", _DEVELOP),
    (b"FOVb", "a camera raw file", _DEVELOP),
    (b"version https://git-lfs", "a Git LFS pointer, not the photo", "fetch the photos with `git lfs pull`"),
)
_HEIC_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")
_TO_READ_HEIC = "install pillow-heif (`pip install pillow-heif`), or " + _TO_PHOTO
_BRANDS: dict[bytes, tuple[str, str]] = {
    **dict.fromkeys(_HEIC_BRANDS, ("HEIC", _TO_READ_HEIC)),
    **dict.fromkeys((b"avif", b"avis"), ("AVIF", _TO_PHOTO)),
    b"crx ": ("a camera raw file", _DEVELOP),
    b"jxl ": ("JPEG XL", _TO_PHOTO),
}
"""Major brands of files that begin with a box `ftyp`."""
RAW_SUFFIXES = frozenset(
    {".3fr", ".arw", ".cr2", ".dng", ".erf", ".iiq", ".nef", ".nrw", ".pef", ".rwl", ".sr2", ".srw"}
)
"""Of camera raw files that are TIFF files, whose first picture is a thumbnail."""
OTHER_SUFFIXES = RAW_SUFFIXES | {
    ".avif",
    ".cr3",
    ".exr",
    ".gif",
    ".hdr",
    ".heic",
    ".heif",
    ".jp2",
    ".jxl",
    ".orf",
    ".raf",
    ".rw2",
}
"""Of photos that are not read, which are named where there are no others."""


def is_heic(head: bytes) -> bool:
    """Whether a file whose first bytes (12 or more) these are is a HEIC file."""
    return head[4:8] == b"ftyp" and head[8:12] in _HEIC_BRANDS


def kind_not_read(head: bytes, path: PurePath) -> str | None:
    """What a file is and what to do, if its first bytes (64 or more) are of a kind that is not read; else None.

    For example "GIF is not read; convert it to JPEG or PNG, e.g. `magick 1.gif 1.jpg`".
    """
    if not head:
        return "is empty; replace or remove it"
    if head[:2] in (b"II", b"MM") and (path.suffix.lower() in RAW_SUFFIXES or head[8:10] == b"CR"):
        return camera_raw()
    found = _BRANDS.get(head[8:12]) if head[4:8] == b"ftyp" else None
    found = found or next(((kind, advice) for start, kind, advice in _STARTS if head.startswith(start)), None)
    return None if found is None else _line(*found, path)


def float_samples(path: PurePath) -> str:
    """The line for an image file whose samples are floating-point numbers."""
    return _line("an image of float samples", _TO_DEEP, path)


def camera_raw() -> str:
    """The line for camera raw files."""
    return f"a camera raw file is not read; {_DEVELOP}"


def _line(kind: str, advice: str, path: PurePath) -> str:
    return f"{kind} is not read; {advice.format(name=path.name, stem=path.stem)}"
