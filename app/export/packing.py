"""Packed arrays for the replay page: deflate and base64, with the name of the type. `web/unpack.js` reads them."""

import base64
import zlib

import numpy as np

_KINDS = {"uint8": "u1", "uint16": "u2", "uint32": "u4", "int16": "i2", "int32": "i4", "float32": "f4"}


def packed(values: np.ndarray) -> dict[str, str]:
    """An array of any shape, flattened. Signed integers are zigzag-coded (0, -1, 1, -2, ... as 0, 1, 2, 3, ...)."""
    kind = _KINDS[values.dtype.name]
    flat = values.ravel()
    if kind[0] == "i":
        wide = flat.astype(np.int64)
        flat = np.where(wide < 0, -2 * wide - 1, 2 * wide).astype(f"u{values.dtype.itemsize}")
    # All first bytes, then all second bytes, and so on: bytes of equal significance compress better together.
    planes = flat.astype(flat.dtype.newbyteorder("<")).view(np.uint8).reshape(-1, flat.dtype.itemsize).T
    text = base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode()
    return {"kind": kind, "deflated": text}
