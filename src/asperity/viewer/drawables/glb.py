"""Encoding of a mesh as a GLB file (glTF 2.0): normals, colours or an image, a dull material.

trimesh's exporter is not used: it stores vertex colours with 8 bits, unconverted, and an image
without the sampler that this page needs (see `glb`).
"""

from __future__ import annotations

import io
import json
import struct
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

_ARRAYS, _INDICES = 34962, 34963
_UINT, _FLOAT = 5125, 5126
_LINEAR = 9729
_QUALITY = 92
"""JPEG quality of the image in the file [percent]."""


def glb(
    vertices: NDArray[np.float64],
    normals: NDArray[np.float64],
    colours: NDArray[np.float64],
    faces: NDArray[np.int64],
    *,
    places: NDArray[np.float64] | None = None,
    image: NDArray[np.uint8] | None = None,
    roughness: float = 0.6,
    metallic: float = 0.0,
) -> bytes:
    """Return a mesh as a GLB file.

    Parameters
    ----------
    vertices, normals : (n, 3) arrays
    colours : (n, 3) array
        sRGB, 0 to 1; stored as linear values, as glTF requires.
    faces : (m, 3) array
        Counter-clockwise as seen from outside.
    places : (n, 2) array, optional
        Texture coordinates in the image, from its upper left corner, 0 to 1; the image then
        replaces the colours.
    image : (rows, columns, 3) uint8 array, optional
        sRGB.
    roughness, metallic : float
        Of the surface, 0 to 1.
    """
    painted = places is not None and image is not None
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    arrays: list[NDArray[Any]] = [
        np.ascontiguousarray(array, np.float32)
        for array in (vertices, normals, places if painted else linear)
    ]
    arrays.append(np.ascontiguousarray(faces, np.uint32).reshape(-1))
    accessors: list[dict[str, Any]] = [
        {
            "bufferView": i, "count": len(array),
            "componentType": _FLOAT if array.ndim == 2 else _UINT,
            "type": f"VEC{array.shape[1]}" if array.ndim == 2 else "SCALAR",
        }
        for i, array in enumerate(arrays)
    ]  # fmt: skip
    if len(vertices):  # the format requires the bounds of positions
        low, high = arrays[0].min(axis=0), arrays[0].max(axis=0)
        accessors[0] |= {"min": low.tolist(), "max": high.tolist()}
    surface: dict[str, Any] = {"metallicFactor": metallic, "roughnessFactor": roughness}
    tree: dict[str, Any] = {}
    blocks = [array.tobytes() for array in arrays]
    if painted and image is not None:
        surface["baseColorTexture"] = {"index": 0}
        tree = {
            "images": [{"bufferView": len(blocks), "mimeType": "image/jpeg"}],
            # Without mipmaps: a triangle is stretched into its region of the image, and the
            # level chosen for its narrow side would blur stripes across the wide one.
            "samplers": [{"magFilter": _LINEAR, "minFilter": _LINEAR}],
            "textures": [{"source": 0, "sampler": 0}],
        }
        blocks.append(_jpeg(image))
    views: list[dict[str, Any]] = []
    at = 0
    for block, target in zip_longest(blocks, (_ARRAYS, _ARRAYS, _ARRAYS, _INDICES)):
        of = {"target": target} if target else {}
        views.append({"buffer": 0, "byteOffset": at, "byteLength": len(block), **of})
        at += len(block)
    attributes = {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0" if painted else "COLOR_0": 2}
    tree |= {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": surface, "doubleSided": True}],
        "buffers": [{"byteLength": at}],
        "bufferViews": views,
        "accessors": accessors,
    }
    return _file(json.dumps(tree).encode(), b"".join(blocks))


def _jpeg(image: NDArray[np.uint8]) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(image).save(out, "JPEG", quality=_QUALITY, subsampling=0)
    return out.getvalue()


def _file(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    size = 12 + 8 + len(text) + 8 + len(data)
    return b"".join(
        (
            struct.pack("<4sII", b"glTF", 2, size),
            struct.pack("<I4s", len(text), b"JSON"), text,
            struct.pack("<I4s", len(data), b"BIN\0"), data,
        )
    )  # fmt: skip
