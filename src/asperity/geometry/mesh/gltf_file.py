"""The inside of a glTF 2.0 or GLB file: its tree of JSON, its buffers, and its accessors.

Accessors are read without loss: normalised integers (also of `KHR_mesh_quantization`), strides,
sparse ones. An extension that a file requires and that is not known here is refused by its name,
as the specification demands.
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.files import find_named, text_of
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError

COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_KNOWN = (
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual", "EXT_texture_webp",
    "KHR_texture_basisu", "MSFT_texture_dds", "KHR_xmp_json_ld", "KHR_animation_pointer",
    "KHR_node_visibility", "KHR_node_selectability", "KHR_node_hoverability",
)  # fmt: skip
"""Extensions that a file may require; those of materials are all known."""
_MATERIALS = "KHR_materials_"
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class GltfFile:
    """A glTF file: its tree, its buffers, and what is noted on the way."""

    def __init__(self, path: Path) -> None:
        self.path = path
        data = content_of(path)
        self.chunk: memoryview | None = None
        text = self._json_of_glb(data) if data[:4] == b"glTF" else data
        try:
            tree = json.loads(text_of(text))
        except (ValueError, RecursionError):
            raise self.refused("its JSON is damaged or cut short") from None
        if not isinstance(tree, dict):
            raise self.refused("its JSON is no table")
        self.tree: dict[str, Any] = tree
        self.notes: list[str] = []
        self.buffers: dict[int, bytes | memoryview] = {}
        self._check_version_and_extensions()

    def refused(self, reason: str) -> AsperityError:
        """Return the error that states why the file cannot be read."""
        return AsperityError(
            f"{self.path}: cannot be read as a {self.path.suffix.lower()} file: {reason}"
        )

    def _json_of_glb(self, data: bytes) -> bytes:
        """Return the JSON of a GLB file, and keep its binary chunk."""
        if len(data) < 12:
            raise self.refused("it is cut short")
        version, size = struct.unpack("<II", data[4:12])
        if version == 1:
            raise AsperityError(f"{self.path}: this is glTF 1.0; valid: glTF 2.0")
        if version != 2:
            raise self.refused(f"its head gives version {version}; valid: 2")
        if size > len(data):
            raise self.refused(f"it is cut short: it has {len(data)} of its {size} bytes")
        text, at = None, 12
        while at + 8 <= len(data):
            length, kind = struct.unpack("<I4s", data[at : at + 8])
            if kind == b"JSON" and text is None:
                text = data[at + 8 : at + 8 + length]
            elif kind == b"BIN\0" and self.chunk is None:
                self.chunk = memoryview(data)[at + 8 : at + 8 + length]
            at += 8 + length
        if text is None:
            raise self.refused("it has no JSON in it")
        return text

    def _check_version_and_extensions(self) -> None:
        asset = self.tree.get("asset")
        asset = asset if isinstance(asset, dict) else {}
        version = str(asset.get("minVersion", asset.get("version", "")))
        if version and not version.startswith("2."):
            raise AsperityError(
                f"{self.path}: this is glTF {version[:20]}; valid: glTF 2.0, to which other "
                "programs convert it"
            )
        required = self.tree.get("extensionsRequired", [])
        names = [str(name) for name in required] if isinstance(required, list) else []
        compressed = [name for name in names if name in COMPRESSED]
        if compressed:
            raise AsperityError(
                f"{self.path}: it is compressed ({', '.join(compressed)}); "
                "valid: exported uncompressed"
            )
        unknown = [n for n in names if n not in _KNOWN and not n.startswith(_MATERIALS)]
        if unknown:
            raise AsperityError(
                f"{self.path}: it requires the extension {', '.join(unknown)[:120]}, which is not "
                "known here; valid: exported without it"
            )

    def item(self, kind: str, number: Any) -> dict[str, Any]:
        """Return an item of one of the tree's lists."""
        items = self.tree.get(kind, [])
        whole = isinstance(number, int) and not isinstance(number, bool)
        if not (isinstance(items, list) and whole and 0 <= number < len(items)):
            raise self.refused(f"it has no {kind}[{str(number)[:20]}]")
        item = items[number]
        if not isinstance(item, dict):
            raise self.refused(f"{kind}[{number}] is no table")
        return item

    def vector(self, name: str, values: Any, count: int) -> Array:
        """Return so many numbers of the tree as an array."""
        try:
            out = np.array(values, dtype=np.float64)
        except (TypeError, ValueError):
            out = np.zeros(0)
        if out.shape != (count,) or not np.isfinite(out).all():
            raise self.refused(f"{name} has to be {count} numbers")
        return out

    def note(self, note: str) -> None:
        """Note what is not used, once."""
        if note not in self.notes:
            self.notes.append(note)

    def indices(self, number: Any) -> Indices:
        """Return the whole numbers of an accessor (n,)."""
        return self._values(number, 1, np.int64)[:, 0]

    def accessor(self, number: Any, width: int) -> Array:
        """Return the values of an accessor (n, width), integers normalised where it is stated."""
        return self._values(number, width, np.float64)

    def _values(self, number: Any, width: int, wanted: type[Any]) -> Any:
        accessor = self.item("accessors", number)
        where = f"accessors[{number}]"
        kind, count = accessor.get("componentType"), accessor.get("count")
        if kind not in _COMPONENTS or _WIDTHS.get(str(accessor.get("type"))) != width:
            raise self.refused(f"{where} has to hold {width} numbers of a known type")
        if not isinstance(count, int) or count < 0:
            raise self.refused(f"{where}.count is {str(count)[:20]}")
        dtype = np.dtype("<" + _COMPONENTS[kind])
        if "bufferView" in accessor:
            out = self._stored(where, accessor, dtype, count, width).astype(wanted)
        elif count > 2**27:
            raise self.refused(f"{where}.count is {count}")
        else:
            out = np.zeros((count, width), dtype=wanted)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            few = sparse["count"]
            at_type = np.dtype("<" + _COMPONENTS[sparse["indices"]["componentType"]])
            at = self._stored(where, sparse["indices"], at_type, few, 1)[:, 0].astype(np.int64)
            if len(at) and at.max() >= count:
                raise self.refused(f"{where}.sparse names value {at.max()} of {count}")
            out[at] = self._stored(where, sparse["values"], dtype, few, width)
        if accessor.get("normalized") and dtype.kind != "f" and wanted is np.float64:
            out = np.maximum(out / np.iinfo(dtype).max, -1.0)
        return out

    def _stored(self, where: str, view: dict[str, Any], dtype: Any, count: int, width: int) -> Any:
        """Return values (count, width) of a view of a buffer, as stored."""
        data, stride = self.view(view["bufferView"])
        size = dtype.itemsize * width
        stride = stride or size
        offset = view.get("byteOffset", 0)
        needed = offset + stride * (count - 1) + size if count else 0
        if min(offset, stride) < 0 or needed > len(data):
            raise self.refused(f"{where} needs {needed} bytes, its buffer has {len(data)}")
        if count == 0:
            return np.zeros((0, width), dtype=dtype)
        strides = (stride, dtype.itemsize)
        return np.ndarray((count, width), dtype, data, offset, strides)

    def view(self, number: Any) -> tuple[memoryview, int]:
        """Return the bytes of a view and its stride, 0 if it gives none."""
        view = self.item("bufferViews", number)
        if set(view.get("extensions", {})) & set(COMPRESSED) and "uri" not in self.item(
            "buffers", view.get("buffer")
        ):
            raise AsperityError(
                f"{self.path}: it is compressed ({', '.join(view['extensions'])}); "
                "valid: exported uncompressed"
            )
        whole = self._buffer(view.get("buffer"))
        start, length = view.get("byteOffset", 0), view.get("byteLength", 0)
        if start < 0 or length < 0 or start + length > len(whole):
            raise self.refused(
                f"bufferViews[{number}] ends at byte {start + length}, its buffer at {len(whole)}: "
                "it is cut short"
            )
        return memoryview(whole)[start : start + length], view.get("byteStride", 0)

    def _buffer(self, number: Any) -> bytes | memoryview:
        if number not in self.buffers:
            buffer = self.item("buffers", number)
            if "uri" in buffer:
                self.buffers[number] = self.data(buffer["uri"])
            elif self.chunk is not None:
                self.buffers[number] = self.chunk
            else:
                raise self.refused(f"buffers[{number}] has no data")
        return self.buffers[number]

    def data(self, uri: str) -> bytes:
        """Return what a URI holds: data in it, or a file beside this one."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2])
            except ValueError:
                raise self.refused("data in it is not base64") from None
        path = self.beside(uri)
        if not path.is_file():
            raise AsperityError(f"{self.path}: its file {uri[:120]} is not there")
        return path.read_bytes()

    def beside(self, uri: str) -> Path:
        """Return the path of a file that a URI names, which may be percent-encoded."""
        exact = self.path.parent / uri
        return exact if exact.is_file() else find_named(self.path.parent, unquote(uri))

    def files(self) -> list[Path]:
        """Return the paths of the buffers and images that have files."""
        items = [*self.tree.get("buffers", []), *self.tree.get("images", [])]
        uris = [item.get("uri", "") for item in items if isinstance(item, dict)]
        return [self.beside(uri) for uri in uris if uri and not uri.startswith("data:")]
