"""The container and the data of glTF 2.0: GLB chunks, buffers, accessors, and extensions that are refused by name.

Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html.
"""

import base64
import binascii
import json
from collections.abc import Callable
from functools import cached_property

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.gltf_json import GltfObject, item
from fairing.util.budget import Budget

MAX_BYTES = 1 << 30
"""Of the arrays made of one file: some 30 million faces."""

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_HARMLESS = (
    "KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_", "KHR_xmp",
    "KHR_animation_", "KHR_mesh_quantization", "ADOBE_materials_",
)  # fmt: skip
"""Beginnings of the names of extensions that leave vertices and faces as they are read here."""
_MAGIC, _JSON, _BIN = b"glTF", b"JSON", b"BIN\0"


class GltfFile:
    """A glTF file with access to its accessors.

    Attributes:
        content: the JSON.
        binary: the GLB's binary chunk; empty without one.
        budget: for the arrays made of the file: instances and zeros multiply its data.
    """

    def __init__(self, data: bytes, resolve: Callable[[str], bytes]) -> None:
        """Parse a GLB or the JSON of a GLTF. `resolve` returns the bytes of a file by its URI.

        Raises:
            InputError: damaged, not glTF 2, or it requires an extension that is not supported.
        """
        text, self.binary = _chunks(data) if data.startswith(_MAGIC) else (data, b"")
        try:
            value = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"cannot be read as glTF (JSON: {error!s:.100}); export it again") from None
        if not isinstance(value, dict):
            raise InputError("expected a JSON object of glTF, found another value; export it again")
        self.content = GltfObject(value)
        self.budget = Budget(len(data), MAX_BYTES)
        self._resolve, self._loaded = resolve, dict[int, bytes]()
        self._check_version_and_extensions()

    def accessor(self, index: int) -> np.ndarray:
        """(count, components) float64 or int64: the values of an accessor, normalized if it says so.

        Raises:
            InputError: no such accessor, or it declares more than there is.
        """
        of = item(self._accessors, index, "accessor")
        components = _COMPONENTS.get(of.text("type"))
        type = _TYPES.get(of.whole("componentType"))
        if components is None or type is None:
            raise InputError(f"{of.where}: expected a type of glTF 2, found {of.value['type']!r:.20}; export it again")
        dtype, count = np.dtype(type), of.whole("count")
        sparse = of.child("sparse")
        if "bufferView" in of:
            values = self._view(of.where, of.whole("bufferView"), of.whole("byteOffset", 0), count, components, dtype)
        elif "sparse" in of:
            self.budget.take(count * components * 8)
            values = np.zeros((count, components), dtype)
        else:
            raise InputError(
                f"{of.where}: expected data (a bufferView), found none; export the mesh without compression"
            )
        self.budget.take(count * components * 8)
        with np.errstate(invalid="ignore"):  # a signalling NaN, which the check of the mesh refuses
            result = values.astype(np.int64 if dtype.kind in "iu" else np.float64)
        if "sparse" in of:
            n, at, new = sparse.whole("count"), sparse.child("indices"), sparse.child("values")
            index_type = np.dtype(_TYPES.get(at.whole("componentType"), "<f4"))
            places = self._view(at.where, at.whole("bufferView"), at.whole("byteOffset", 0), n, 1, index_type)[:, 0]
            changed = self._view(new.where, new.whole("bufferView"), new.whole("byteOffset", 0), n, components, dtype)
            if index_type.kind != "u" or places.max(initial=0) >= count:
                raise InputError(f"{at.where}: expected indices below {count}; export the mesh again")
            result[places] = changed
        if of.value.get("normalized") is True and dtype.kind in "iu":
            return np.maximum(result / np.iinfo(dtype).max, -1.0)
        return result

    def buffer(self, index: int) -> bytes:
        """The bytes of a buffer, loaded on first use.

        Raises:
            InputError: it has fewer bytes than it declares.
        """
        if index not in self._loaded:
            of = item(self.content.children("buffers"), index, "buffer")
            data = self._data(of, index)
            if len(data) < of.whole("byteLength"):
                raise InputError(
                    f"{of.where}: expected {of.whole('byteLength')} bytes, found {len(data)}; the file is incomplete"
                )
            if "uri" in of:
                self.budget.add(len(data))
            self._loaded[index] = data
        return self._loaded[index]

    @cached_property
    def _accessors(self) -> list[GltfObject]:
        return self.content.children("accessors")

    @cached_property
    def _views(self) -> list[GltfObject]:
        return self.content.children("bufferViews")

    def _view(self, where: str, index: int, offset: int, count: int, components: int, dtype: np.dtype) -> np.ndarray:
        """(count, components) values of a buffer view, without a copy."""
        of = item(self._views, index, "bufferView")
        size = components * dtype.itemsize
        stride, length, start = of.whole("byteStride", size), of.whole("byteLength"), of.whole("byteOffset", 0)
        needed = offset + (count - 1) * stride + size if count else 0
        data = self.buffer(of.whole("buffer"))
        if stride < size or needed > length or start + length > len(data):
            raise InputError(
                f"{where}: expected {count} values in {length} bytes of a buffer of {len(data)}, found fewer; "
                "the file is damaged, export it again"
            )
        return np.ndarray((count, components), dtype, data, start + offset, (stride, dtype.itemsize))

    def _data(self, of: GltfObject, index: int) -> bytes:
        if "uri" not in of:
            if index or not self.binary:
                raise InputError(f"{of.where}: expected data, found none; export the mesh without compression")
            return self.binary
        uri = of.text("uri")
        if not uri.startswith("data:"):
            return self._resolve(uri)
        kind, _, encoded = uri.partition(",")
        try:
            return base64.b64decode(encoded, validate=True) if kind.endswith(";base64") else b""
        except binascii.Error:
            raise InputError(f"{of.where}: expected data in base64, found something else; export it again") from None

    def _check_version_and_extensions(self) -> None:
        version = self.content.child("asset").text("version")
        if not version.startswith("2."):
            raise InputError(f"expected glTF 2.0, found version {version[:20]}; export it as glTF 2.0")
        for name in self.content.texts("extensionsRequired"):
            if not name.startswith(_HARMLESS):
                raise InputError(
                    f"requires the glTF extension {name[:60]}, which is not supported; export the mesh without it "
                    "(for compression: `gltf-transform copy`, or a mesh as PLY)"
                )


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    """The JSON and the binary chunk of a GLB."""
    version, length = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
    if version != 2:
        raise InputError(f"expected GLB version 2, found {version}; export it as glTF 2.0")
    if length > len(data):
        raise InputError(f"expected {length} bytes as declared, found {len(data)}; it is incomplete, export it again")
    chunks, at = [], 12
    while at + 8 <= length:
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > length:
            raise InputError(f"expected a chunk of {size} bytes as declared, found {length - at - 8}; export it again")
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    text = next((content for kind, content in chunks[:1] if kind == _JSON), None)
    if text is None:
        raise InputError("expected a GLB that begins with JSON, found none; export it again")
    return text, next((content for kind, content in chunks[1:] if kind == _BIN), b"")
