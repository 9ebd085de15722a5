"""glTF 2.0 and GLB: primitives of triangles, placed by their nodes, with materials and pictures.

Strips and fans become triangles, mirrored nodes are wound anew, `KHR_texture_transform` is applied
to the texture coordinates.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import Corners
from asperity.geometry.mesh.contents import Contents, FilePart
from asperity.geometry.mesh.gltf_file import COMPRESSED, GltfFile
from asperity.geometry.mesh.materials import MapImage, Material
from asperity.geometry.mesh.ply import strip_triangles

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_REPEAT = 10497
_BORDERS = {_REPEAT: "wrap", 33071: "clamp"}
"""What a picture does beyond its edges, by OpenGL's numbers; 33648 mirrors it."""
_PICTURES = (
    ("normal", ("normalTexture",)),
    ("colour", ("pbrMetallicRoughness", "baseColorTexture")),
    ("roughness", ("pbrMetallicRoughness", "metallicRoughnessTexture")),
)
_KINDS = {b"\x89PNG": ".png", b"\xff\xd8\xff": ".jpg", b"RIFF": ".webp", b"\xabKTX": ".ktx2"}
_DEEPEST = 1000
_MOST_PARTS = 100_000


def read_gltf(path: Path) -> Contents:
    """Return the triangles of a glTF or GLB file, a part for each primitive."""
    return _Reader(path).contents()


class _Reader(GltfFile):
    """A glTF file of which parts and materials are read."""

    def contents(self) -> Contents:
        """Return all parts in the frame of the scene, and the materials."""
        out = Contents(unit="m", up="y", notes=self.notes)
        listed = self.tree.get("materials", [])
        count = len(listed) if isinstance(listed, list) else 0
        out.materials = [self.material(number) for number in range(count)]
        meshes: dict[int, list[FilePart]] = {}
        for number, transform in self._placed_meshes():
            if number not in meshes:
                meshes[number] = list(self._primitives(number))
            for corners, material in meshes[number]:
                out.parts.append(FilePart(placed(corners, transform), material))
            if len(out.parts) > _MOST_PARTS:
                raise self.refused(f"its nodes place more than {_MOST_PARTS} parts")
        return out

    def _placed_meshes(self) -> Iterator[tuple[int, Array]]:
        """Yield the numbers of the meshes of the scene, and the transforms that place them."""
        scenes = self.tree.get("scenes")
        if scenes:
            roots = self.item("scenes", self.tree.get("scene", 0)).get("nodes", [])
        else:
            children = {
                child for node in self.tree.get("nodes", []) for child in node.get("children", [])
            }
            roots = [i for i in range(len(self.tree.get("nodes", []))) if i not in children]
        if isinstance(scenes, list) and len(scenes) > 1:
            self.notes.append(f"one of its {len(scenes)} scenes is read")
        waiting = [(node, np.eye(4), 0) for node in reversed(roots)]
        seen = 0
        while waiting:
            number, above, depth = waiting.pop()
            seen += 1
            if depth > _DEEPEST or seen > _MOST_PARTS:
                raise self.refused("its nodes contain themselves, or are too many")
            node = self.item("nodes", number)
            transform = above @ self._transform(number, node)
            if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
                self.note("EXT_mesh_gpu_instancing is left out: a repeated part is there once")
            if node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible") is False:
                self.note("what is invisible is left out")
                continue
            if "mesh" in node:
                if any(node.get("weights", [])):
                    self.note("its morph targets are left out")
                if "skin" in node:
                    self.note("the skin of its bones is left out: it stands as it was modelled")
                yield node["mesh"], transform
            waiting += [(c, transform, depth + 1) for c in reversed(node.get("children", []))]

    def _transform(self, number: int, node: dict[str, Any]) -> Array:
        """Return the transform of a node (4, 4)."""
        out = np.eye(4)
        if "matrix" in node:
            out = self.vector(f"nodes[{number}].matrix", node["matrix"], 16).reshape(4, 4).T
        else:
            turn = self.vector(f"nodes[{number}].rotation", node.get("rotation", (0, 0, 0, 1)), 4)
            scale = self.vector(f"nodes[{number}].scale", node.get("scale", (1, 1, 1)), 3)
            moved = self.vector(
                f"nodes[{number}].translation", node.get("translation", (0, 0, 0)), 3
            )
            length = np.linalg.norm(turn)
            if length == 0.0:
                raise self.refused(f"nodes[{number}].rotation is no quaternion")
            x, y, z, w = turn / length
            across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            out[:3, :3] = (np.eye(3) + 2.0 * w * across + 2.0 * across @ across) * scale
            out[:3, 3] = moved
        return out

    def _primitives(self, number: int) -> Iterator[FilePart]:
        """Yield the primitives of triangles of a mesh."""
        mesh = self.item("meshes", number)
        for i, primitive in enumerate(mesh.get("primitives", [])):
            where = f"meshes[{number}].primitives[{i}]"
            mode = primitive.get("mode", _TRIANGLES)
            attributes = primitive.get("attributes", {})
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                self.note("points or lines in it are left out")
                continue
            if "POSITION" not in attributes:
                self.note(f"{where} has no positions: left out")
                continue
            stored = self.item("accessors", attributes["POSITION"])
            if (
                set(primitive.get("extensions", {})) & set(COMPRESSED)
                and "bufferView" not in stored
            ):
                raise AsperityError(
                    f"{self.path}: {where} is compressed ({', '.join(primitive['extensions'])}); "
                    "valid: exported uncompressed"
                )
            if primitive.get("targets") and any(mesh.get("weights", [])):
                self.note("its morph targets are left out")
            points = self.accessor(attributes["POSITION"], 3)
            faces = self._faces(primitive, mode, len(points))
            if not len(faces):
                continue
            if faces.max() >= len(points):
                raise self.refused(
                    f"{where} names vertex {faces.max()}; valid: 0 to {len(points) - 1}"
                )
            normals = uv = None
            if "NORMAL" in attributes:
                normals = self._at(faces, self.accessor(attributes["NORMAL"], 3))
            material = primitive.get("material", -1)
            info = self._texture_info(material)
            # Without a picture any material is laid as the first set of coordinates.
            which, transform = self._laying(info)
            if f"TEXCOORD_{which}" in attributes:
                uv = self._at(faces, self.accessor(attributes[f"TEXCOORD_{which}"], 2))
                uv = uv @ transform[:2, :2].T + transform[:2, 2]
                uv[..., 1] = 1.0 - uv[..., 1]
            yield FilePart(Corners(points, faces, uv, normals), material)

    def _at(self, faces: Indices, values: Array) -> Array:
        if faces.max() >= len(values):
            raise self.refused("an attribute has fewer values than there are positions")
        return values[faces]

    def _faces(self, primitive: dict[str, Any], mode: int, count: int) -> Indices:
        """Return the triangles (m, 3) of a primitive."""
        run = self.indices(primitive["indices"]) if "indices" in primitive else np.arange(count)
        if mode == _STRIP:
            return np.asarray(strip_triangles(run), dtype=np.int64)
        if mode == _FAN:
            first = np.full(max(len(run) - 2, 0), run[0] if len(run) else 0)
            return np.stack([first, run[1:-1], run[2:]], axis=1)
        return run[: len(run) // 3 * 3].reshape(-1, 3)

    def material(self, number: int) -> Material:
        """Return a material with the pictures that it names."""
        item = self.item("materials", number)
        maps = {}
        for kind, keys in _PICTURES:
            info = item
            for key in keys:
                info = info.get(key, {})
            if info:
                found = self._picture(info)
                if found is not None:
                    maps[kind] = found
        factor = item.get("pbrMetallicRoughness", {}).get("baseColorFactor")
        colour = None
        if factor is not None:
            linear = np.clip(self.vector("baseColorFactor", factor, 4)[:3], 0.0, 1.0)
            colour = tuple(float(x) for x in _srgb(linear))
        name = str(item.get("name", f"material {number}"))
        return Material(name, maps, colour)  # type: ignore[arg-type]

    def _picture(self, info: dict[str, Any]) -> MapImage | None:
        texture = self.item("textures", info.get("index"))
        sources = [texture.get("source")]
        sources += [e.get("source") for e in texture.get("extensions", {}).values()]
        source = next((s for s in sources if s is not None), None)
        if source is None:
            return None
        image = self.item("images", source)
        scale = float(info.get("scale", 1.0))
        sampler = self.item("samplers", texture["sampler"]) if "sampler" in texture else {}
        wraps = [sampler.get(key, _REPEAT) for key in ("wrapS", "wrapT")]
        border = _BORDERS.get(wraps[0], "other") if wraps[0] == wraps[1] else "other"
        if "bufferView" in image:
            data = bytes(self.view(image["bufferView"])[0])
        elif str(image.get("uri", "")).startswith("data:"):
            data = self.data(image["uri"])
        elif "uri" in image:
            return MapImage(
                self.beside(image["uri"]), Path(image["uri"]).name, scale=scale, border=border
            )
        else:
            return None
        suffix = next((s for magic, s in _KINDS.items() if data.startswith(magic)), ".png")
        name = Path(str(image.get("name") or f"image{source}")).stem + suffix
        return MapImage(None, name, data, scale=scale, border=border)

    def _texture_info(self, material: Any) -> dict[str, Any]:
        """Return the texture info of a material that lays its texture: of normals, else colours."""
        if material == -1:
            return {}
        item = self.item("materials", material)
        infos = []
        for _, keys in _PICTURES:
            info = item
            for key in keys:
                info = info.get(key, {})
            if info:
                infos.append(info)
        if len({json.dumps(self._laid(info)) for info in infos}) > 1:
            self.note("its pictures are laid differently: all as the first of normals and colours")
        return infos[0] if infos else {}

    def _laid(self, info: dict[str, Any]) -> tuple[int, Any]:
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        rest = {key: transform[key] for key in ("offset", "rotation", "scale") if key in transform}
        return transform.get("texCoord", info.get("texCoord", 0)), rest

    def _laying(self, info: dict[str, Any]) -> tuple[int, Array]:
        """Return the set of texture coordinates of a texture, and their transform (3, 3)."""
        which, values = self._laid(info)
        offset = self.vector("offset", values.get("offset", (0, 0)), 2)
        scale = self.vector("scale", values.get("scale", (1, 1)), 2)
        (turn,) = self.vector("rotation", (values.get("rotation", 0.0),), 1)
        c, s = np.cos(turn), np.sin(turn)
        out = np.eye(3)
        # Counter-clockwise as seen, with v downwards: as its example has it, and three.js.
        out[:2, :2] = np.array([[c, s], [-s, c]]) * scale
        out[:2, 2] = offset
        return which, out


def _srgb(linear: Array) -> Array:
    """Return linear colours as sRGB, both 0 to 1 (IEC 61966-2-1)."""
    return np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055
    )


def placed(part: Corners, transform: Array) -> Corners:
    """Return a part moved by a transform (4, 4), which may mirror or shear it."""
    if np.array_equal(transform, np.eye(4)):
        return part
    matrix = transform[:3, :3]
    vertices = part.vertices @ matrix.T + transform[:3, 3]
    # The cofactor matrix is the inverse transpose up to a factor, and needs no inverse.
    cofactors = np.cross(np.roll(matrix, -1, axis=0), np.roll(matrix, -2, axis=0))
    mirrored = np.linalg.det(matrix) < 0.0
    faces, uv, normals = part.faces, part.uv, part.normals
    if normals is not None:
        normals = normals @ (-cofactors.T if mirrored else cofactors.T)
    if mirrored:
        faces = faces[:, ::-1]
        uv = None if uv is None else uv[:, ::-1]
        normals = None if normals is None else normals[:, ::-1]
    return Corners(vertices, faces, uv, normals)
