"""Image files: photos, masks and pictures, of an explicit list of formats, with their sizes checked before decoding.

All image files that users give are opened here. Pillow identifies files by content and has some 40 formats, one of which
runs another program (Ghostscript); only those of `FORMATS` are enabled.
"""

import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import cv2
import numpy as np
from PIL import ExifTags, Image, ImageFile, UnidentifiedImageError

from fairing.errors import InputError
from fairing.image_kinds import is_heic, kind_not_read
from fairing.tiff_layout import HEIGHT, PHOTOMETRIC, WHITE_IS_ZERO, WIDTH, bits_of_photo, is_part, read_tags
from fairing.util.guards import check_regular_file
from fairing.util.misuse import is_misuse
from fairing.util.orientation import AS_STORED, INVERSE, TAG, turned_size

PHOTO_SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".webp"})
FORMATS = ("JPEG", "PNG", "TIFF", "BMP", "PPM", "WEBP")
"""Pillow's names of the formats with these suffixes."""
HEIF, HEIF_SUFFIXES = "HEIF", frozenset({".heic", ".heif"})
"""Photos of phones; they are read where Pillow's plug-in pillow-heif is installed, which decodes them upright."""
LARGEST_PIXELS = 500_000_000
"""Of one image; phones and medium-format cameras have up to 200 million, aerial cameras 450 million."""
PER_GREY_LEVEL = 257
"""Units of a 16-bit sample per grey level: 65535 / 255."""

# Settings of Pillow in this process: its own limit of 89 million pixels prints a warning and twice as many are an error.
# Its warnings about metadata and palettes concern nothing that is read here.
Image.MAX_IMAGE_PIXELS = LARGEST_PIXELS
warnings.filterwarnings("ignore", module=r"PIL\.")

_HEAD_BYTES = 4096
"""Read to identify a file; a PPM header with comments fits in."""
_PNG, _TIFF = b"\x89PNG", (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PPM_HEADER = re.compile(rb"P[36]" + rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})" * 3 + rb"\s")


class ImageHeader(NamedTuple):
    """What an image file declares.

    Attributes:
        size: (width, height) in pixels, as decoded.
        has_alpha: whether pixels may be transparent.
    """

    size: tuple[int, int]
    has_alpha: bool


class Shot(NamedTuple):
    """What an image file tells of a photo and the camera that took it.

    Attributes:
        size: (width, height) in pixels, as decoded.
        orientation: how to turn the decoded pixels upright, see `fairing.util.orientation`.
        camera: make, model and lens; empty if unknown.
        focal_length: millimetres; None if unknown.
        focal_length_35: millimetres, the equivalent for a frame of 36 mm x 24 mm; None if unknown.
    """

    size: tuple[int, int]
    orientation: int
    camera: str
    focal_length: float | None
    focal_length_35: float | None


class DecodedImage(NamedTuple):
    """The samples of an image file.

    Attributes:
        pixels: (h, w) grey or (h, w, 3) RGB; uint8, or uint16 with `PER_GREY_LEVEL` units per grey level.
        alpha: (h, w) uint8, 0 transparent to 255 opaque; None without an alpha channel.
    """

    pixels: np.ndarray
    alpha: np.ndarray | None


def read_header(path: Path) -> ImageHeader:
    """Size and alpha of an image file, without decoding it.

    Raises:
        InputError: there is no such file, or it is no image of a supported kind.
    """
    with _opened(path) as (image, _):
        return ImageHeader(_decoded_size(image), _has_alpha(image))


def read_other_orientation(path: Path) -> int:
    """The orientation in which the decoded pixels may be meant instead, by the file's tag; `AS_STORED` if it has none.

    Pillow decodes TIFF files upright, whose other orientation is the stored one, and all others as stored.

    Raises:
        InputError: there is no such file, or it is no image of a supported kind.
    """
    with _opened(path) as (image, _):
        tag = _orientation_tag(image)
        return INVERSE[tag] if image.format == "TIFF" else tag


def read_shot(path: Path) -> Shot:
    """What an image file tells of a photo and its camera (EXIF), without decoding it.

    Raises:
        InputError: there is no such file, or it is no image of a supported kind.
    """
    with _opened(path) as (image, _):
        exif, details = _exif(image)
        orientation = AS_STORED if image.format == "TIFF" else _orientation_tag(image)
        names = [str(exif.get(tag, "")).strip("\0 ") for tag in (ExifTags.Base.Make, ExifTags.Base.Model)]
        names.append(str(details.get(ExifTags.Base.LensModel, "")).strip("\0 "))
        lengths = (
            _positive(details.get(tag)) for tag in (ExifTags.Base.FocalLength, ExifTags.Base.FocalLengthIn35mmFilm)
        )
        return Shot(_decoded_size(image), orientation, " ".join(filter(None, names)), *lengths)


def decode_image(path: Path) -> DecodedImage:
    """The samples of an image file at full depth: 8 or 16 bits. CMYK, palettes and YCbCr are converted to RGB.

    Raises:
        InputError: there is no such file, or it cannot be decoded or is of a kind that is not read.
    """
    with _opened(path) as (image, largest):
        if image.mode == "I" or image.mode.startswith("I;"):
            return _grey_of_16_bits(image, largest)
        decoded = _of_8_bits(image)
        if largest <= 255:
            return decoded
        key = image.info.get("transparency")
        deep = _color_of_16_bits(path, decoded, largest)
    if isinstance(key, tuple):  # the colour of a PNG that is transparent
        alpha = np.uint8(255) * (deep.pixels != np.array(key)).any(axis=2)
        return deep._replace(alpha=alpha)
    return deep


@contextmanager
def _opened(path: Path) -> Iterator[tuple[ImageFile.ImageFile, int]]:
    """The image, header read and checked, and the sample that stands for white: up to 255 for 8 bits, else to 65535.

    Every failure is raised as an InputError about this file.
    """
    check_regular_file(path, "an image file")
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
            is_heif = is_heic(head) and _reads_heif()
            refused = None if is_heif else kind_not_read(head, path)
            if refused is not None:
                raise InputError(f"photo {path}: {refused}")
            largest = _largest_sample(file, head, path)
            file.seek(0)
            with Image.open(file, formats=(HEIF,) if is_heif else FORMATS) as image:
                _check_size(image, path)
                _check_pages(image, path)
                yield image, largest
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"photo {path}: expected an image file, found none; check the image folder") from None
    except PermissionError:
        raise InputError(f"photo {path}: cannot be read (permission denied); make it readable") from None
    except Image.DecompressionBombError:
        raise _too_large(path, "more than twice as many") from None
    except UnidentifiedImageError:
        raise InputError(
            f"photo {path}: is not an image file of a format that is read ({', '.join(FORMATS)}), or a damaged one; "
            "replace or remove it"
        ) from None
    except Exception as error:  # Pillow's decoders raise whatever the damaged bytes make their parsers raise
        if is_misuse(error):
            raise
        reason = str(error) or type(error).__name__
        raise InputError(f"photo {path}: cannot be decoded ({reason}); replace or remove it") from None


def _check_size(image: ImageFile.ImageFile, path: Path) -> None:
    width, height = image.size
    if width * height > LARGEST_PIXELS:
        raise _too_large(path, f"{width}x{height}")


def _too_large(path: Path, found: str) -> InputError:
    return InputError(
        f"photo {path}: expected at most {LARGEST_PIXELS // 10**6} million pixels, found {found}; "
        "reduce it, and its camera with it"
    )


def _check_pages(image: ImageFile.ImageFile, path: Path) -> None:
    """Refuse animations and TIFF files of several photos; further pages that are thumbnails or masks are accepted.

    The further pictures of a JPEG (MPO) or HEIC file are previews, depth or gain maps, and are ignored.
    """
    if image.format in ("MPO", HEIF) or not getattr(image, "is_animated", False):
        return
    if image.format != "TIFF":
        raise InputError(f"photo {path}: an animation is not read; save one picture of it as PNG")
    width = image.size[0]
    image.seek(1)
    is_photo = not is_part(_tags(image)) and image.size[0] >= width
    image.seek(0)
    if is_photo:
        raise InputError(f"photo {path}: expected a TIFF of one page, found several; save each picture as a file")


def _orientation_tag(image: ImageFile.ImageFile) -> int:
    tag = _tags(image).get(TAG, AS_STORED) if image.format == "TIFF" else _exif(image)[0].get(TAG, AS_STORED)
    return int(tag) if tag in INVERSE else AS_STORED


def _exif(image: ImageFile.ImageFile) -> tuple[Mapping[int, Any], Mapping[int, Any]]:
    """The EXIF tags of an image, and those of its photo (exposure, lens); none if they are damaged."""
    try:
        # Not `image.getexif`, which decodes a PNG file to find a tag behind its pixels.
        exif = Image.Image.getexif(image)
        return exif, exif.get_ifd(ExifTags.IFD.Exif)
    except Exception as error:  # damaged EXIF data, of which Pillow's parser raises anything
        if is_misuse(error):
            raise
        return {}, {}


def _positive(value: object) -> float | None:
    """A positive number of EXIF data; 0 stands for unknown, and fractions may have a denominator of 0."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if 0 < number < float("inf") else None


def _reads_heif() -> bool:
    """Whether HEIC files are read; registers Pillow's plug-in on first use."""
    try:
        import pillow_heif  # pyright: ignore[reportMissingImports] - optional
    except ImportError:
        return False
    pillow_heif.register_heif_opener()
    return True


def _decoded_size(image: ImageFile.ImageFile) -> tuple[int, int]:
    """(width, height) of the decoded pixels: older versions of Pillow open TIFF files with the stored size."""
    if image.format != "TIFF":
        return image.size
    tags = _tags(image)
    return turned_size((tags[WIDTH], tags[HEIGHT]), _orientation_tag(image))


def _tags(image: ImageFile.ImageFile) -> Mapping[int, Any]:
    """The tags of a TIFF file's current page; none of other formats."""
    return getattr(image, "tag_v2", {}) if image.format == "TIFF" else {}


def _has_alpha(image: ImageFile.ImageFile) -> bool:
    return image.mode in ("RGBA", "LA", "PA", "La", "RGBa") or "transparency" in image.info


def _largest_sample(file: BinaryIO, head: bytes, path: Path) -> int:
    """The sample that stands for white: up to 255 for 8 bits, else up to 65535.

    Args:
        head: the file's first `_HEAD_BYTES` bytes.

    Raises:
        InputError: samples of another kind.
    """
    if head.startswith(_TIFF):
        return (1 << bits_of_photo(read_tags(file), path)) - 1
    if head.startswith(_PNG):  # bits per sample, from IHDR, the first chunk
        return (1 << head[24]) - 1
    header = _PPM_HEADER.match(head)
    return 255 if header is None else int(header[3])


def _of_8_bits(image: ImageFile.ImageFile) -> DecodedImage:
    if _has_alpha(image):
        with_alpha = np.asarray(image.convert("RGBA"))
        return DecodedImage(np.ascontiguousarray(with_alpha[..., :3]), np.ascontiguousarray(with_alpha[..., 3]))
    mode = "L" if image.mode in ("1", "L") else "RGB"
    return DecodedImage(np.asarray(image if image.mode == mode else image.convert(mode)), None)


def _grey_of_16_bits(image: ImageFile.ImageFile, largest: int) -> DecodedImage:
    """A grey image of more than 8 bits, which Pillow decodes at full depth; those of PPM it scales to 65535."""
    samples = np.asarray(image).astype(np.uint16)
    if image.format == "PPM":
        return DecodedImage(samples, None)
    if _tags(image).get(PHOTOMETRIC) == WHITE_IS_ZERO:
        samples = largest - samples
    key = image.info.get("transparency")
    alpha = np.uint8(255) * (samples != key) if isinstance(key, int) else None
    return DecodedImage(_scaled(samples, largest), alpha)


def _color_of_16_bits(path: Path, coarse: DecodedImage, largest: int) -> DecodedImage:
    """A colour image of more than 8 bits. Pillow cuts them to 8 (`coarse`), so they are decoded otherwise.

    OpenCV decodes PNG and TIFF. It gets only files that Pillow has decoded as this format, and the result must agree with
    Pillow's, which reveals layouts that one of them misinterprets.
    """
    shape = coarse.pixels.shape
    data = np.fromfile(path, dtype=np.uint8)
    header = _PPM_HEADER.match(data[:_HEAD_BYTES].tobytes())
    if header is not None:
        if data[1] == ord("3"):
            raise InputError(f"photo {path}: a PPM of 16 bits as text is not read; save it as a PNG of 16 bits")
        samples = np.frombuffer(data, ">u2", int(np.prod(shape)), header.end()).reshape(shape)
        return DecodedImage(_scaled(np.minimum(samples, largest).astype(np.uint16), largest), None)
    found = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    if (
        found is not None
        and found.dtype == np.uint16
        and found.shape[:2] == shape[:2]
        and found.shape[2:] in ((3,), (4,))
    ):
        pixels = np.ascontiguousarray(found[..., 2::-1]).astype(np.uint16, copy=False)
        if np.array_equal((pixels >> 8).astype(np.uint8), coarse.pixels):
            return DecodedImage(pixels, coarse.alpha)
    raise InputError(f"photo {path}: its samples of 16 bits cannot be decoded; save it as a PNG of 16 bits")


def _scaled(samples: np.ndarray, largest: int) -> np.ndarray:
    """uint16 samples 0 to `largest` as 0 to 65535."""
    if largest == 65535:
        return samples
    return np.round(samples * np.float64(65535 / largest)).astype(np.uint16)
