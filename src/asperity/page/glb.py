"""A coloured mesh as the bytes of a GLB file (glTF 2.0), with normals and a dull material."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_ARRAYS, _INDICES = 34962, 34963
_UINT, _FLOAT = 5125, 5126


def glb(
    vertices: NDArray[np.float64],
    normals: NDArray[np.float64],
    colours: NDArray[np.float64],
    faces: NDArray[np.int64],
    *,
    roughness: float = 0.6,
    metallic: float = 0.0,
) -> bytes:
    """Return a mesh as a GLB file.

    Parameters
    ----------
    vertices, normals : (n, 3) arrays
    colours : (n, 3) array
        sRGB, 0 to 1. The file holds them in linear light, as glTF wants it.
    faces : (m, 3) array
        Counter-clockwise, seen from outside.
    roughness, metallic : float
        Of the surface, 0 to 1.
    """
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    parts: list[tuple[NDArray[Any], int, str, int]] = [
        (np.ascontiguousarray(vertices, np.float32), _ARRAYS, "VEC3", _FLOAT),
        (np.ascontiguousarray(normals, np.float32), _ARRAYS, "VEC3", _FLOAT),
        (np.ascontiguousarray(linear, np.float32), _ARRAYS, "VEC3", _FLOAT),
        (np.ascontiguousarray(faces, np.uint32).reshape(-1), _INDICES, "SCALAR", _UINT),
    ]
    views, accessors, at = [], [], 0
    for array, target, kind, component in parts:
        views.append({"buffer": 0, "byteOffset": at, "byteLength": array.nbytes, "target": target})
        accessors.append(
            {
                "bufferView": len(accessors), "componentType": component, "type": kind,
                "count": len(array), **_bounds(array, len(accessors) == 0),
            }
        )  # fmt: skip
        at += array.nbytes
    material = {
        "pbrMetallicRoughness": {"metallicFactor": metallic, "roughnessFactor": roughness},
        "doubleSided": True,
    }
    attributes = {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}
    told = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3, "material": 0}]}],
        "materials": [material],
        "buffers": [{"byteLength": at}],
        "bufferViews": views,
        "accessors": accessors,
    }
    return _file(json.dumps(told).encode(), b"".join(array.tobytes() for array, *_ in parts))


def _bounds(array: NDArray[Any], wanted: bool) -> dict[str, Sequence[float]]:
    """Return what the format wants to know of positions."""
    if not wanted or not len(array):
        return {}
    return {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}


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
