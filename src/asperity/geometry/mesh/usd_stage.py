"""Stages of USD, by usd-core: meshes placed by their prims, materials.

Read are polygons with their texture coordinates and normals, instances, subsets of faces with
materials of their own, and the pictures of `UsdPreviewSurface`. This module runs in a separate
process (`asperity.geometry.mesh.usd`).
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Tf, Usd, UsdGeom, UsdShade, UsdUtils

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import UNITS, Corners
from asperity.geometry.mesh.contents import Contents, FilePart, triangulated
from asperity.geometry.mesh.gltf import placed
from asperity.geometry.mesh.materials import MapImage, Material
from asperity.geometry.mesh.usd import damaged

_INPUTS = {
    "displacement": "displacement", "normal": "normal", "diffuseColor": "colour",
    "roughness": "roughness",
}  # fmt: skip
_MOST_PARTS = 100_000
_COORDINATES = re.compile(r"(st|uv|uvmap|map|texcoord)_?\d*", re.IGNORECASE)
"""Names of texture coordinates whose type does not state that they are any."""


def contents_of(path: Path) -> Contents:
    """Return the meshes of a USD file, a part for each prim and subset, in its unit."""
    return _Reader(path).contents()


def layers_of(path: Path) -> list[Path]:
    """Return the files of USD that a file refers to, itself left out."""
    layers, _, _ = UsdUtils.ComputeAllDependencies(str(path))
    return [Path(layer.realPath) for layer in layers if Path(layer.realPath) != path.resolve()]


class _Reader:
    """A stage whose meshes are read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.out = Contents()
        self._materials: dict[str, int] = {}

    def contents(self) -> Contents:
        """Return all parts in the frame of the stage, and the materials."""
        try:
            self._read(Usd.Stage.Open(str(self.path)))
        except (Tf.ErrorException, RuntimeError):
            raise damaged(self.path) from None
        return self.out

    def _read(self, stage: Any) -> None:
        """Read the parts of an open stage."""
        self._read_units(stage)
        errors = " ".join(map(str, stage.GetCompositionErrors()))
        for lost in dict.fromkeys(re.findall(r"Could not open asset @([^@]+)@", errors)):
            self._note(f"a file that it refers to is not there: {Path(lost).name}")
        time = Usd.TimeCode.EarliestTime()
        frames = UsdGeom.XformCache(time)
        for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
            if prim.IsA(UsdGeom.PointInstancer):
                self._note("a PointInstancer is left out: what it repeats is there once")
            if not prim.IsA(UsdGeom.Mesh):
                if prim.IsA(UsdGeom.Gprim):
                    self._note(f"{prim.GetTypeName()} in it is left out: only meshes are read")
                continue
            imageable = UsdGeom.Imageable(prim)
            hidden = imageable.ComputeVisibility(time) == UsdGeom.Tokens.invisible
            if hidden or imageable.ComputePurpose() in (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide):
                self._note("what is invisible, or a proxy or guide, is left out")
                continue
            transform = np.array(frames.GetLocalToWorldTransform(prim)).T
            for part in self._parts(prim, time):
                self.out.parts.append(part._replace(corners=placed(part.corners, transform)))
            if len(self.out.parts) > _MOST_PARTS:
                raise AsperityError(f"{self.path}: more than {_MOST_PARTS} meshes are in it")

    def _note(self, text: str) -> None:
        if text not in self.out.notes:
            self.out.notes.append(text)

    def _read_units(self, stage: Any) -> None:
        """Read how many metres a unit has, and which axis points upwards."""
        out = self.out
        metres = float(UsdGeom.GetStageMetersPerUnit(stage))
        near = [name for name, value in UNITS.items() if np.isclose(value, metres, rtol=1e-6)]
        if not near:
            valid = ", ".join(f"{value:g}" for value in UNITS.values())
            raise AsperityError(f"{self.path}: its metersPerUnit is {metres:g}; valid: {valid}")
        out.unit = near[0]
        if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            self._note("it states no metersPerUnit: cm, the default of USD")
        out.up = str(UsdGeom.GetStageUpAxis(stage)).lower()

    def _parts(self, prim: Any, time: Any) -> Iterator[FilePart]:
        """Yield the triangles of a mesh, a part for each material."""
        mesh = UsdGeom.Mesh(prim)
        points = np.asarray(mesh.GetPointsAttr().Get(time) or (), dtype=np.float64).reshape(-1, 3)
        counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(time) or (), dtype=np.int64)
        at = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(time) or (), dtype=np.int64)
        if not len(counts):
            return
        wrong = counts.min() < 0 or counts.sum() != len(at)
        if wrong or at.size == 0 or at.min() < 0 or at.max() >= len(points):
            raise AsperityError(f"{self.path}: {prim.GetPath()} has faces of points that it lacks")
        if mesh.GetSubdivisionSchemeAttr().Get() != "none" and not self._normals(mesh, time):
            self._note("its subdivision is left out: the mesh is taken as its control cage")
        triangles, polygon = triangulated(points[at], counts)
        holes = np.asarray(mesh.GetHoleIndicesAttr().Get(time) or (), dtype=np.int64)
        if len(holes):
            whole = ~np.isin(polygon, holes)
            triangles, polygon = triangles[whole], polygon[whole]
        if not len(triangles):
            return
        if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
            triangles = triangles[:, ::-1]
        uv, normals = self._uv(prim, time), self._normals(mesh, time)
        attributes = [
            None if found is None else self._at_corners(*found, at, triangles, polygon, len(points))
            for found in (uv, normals)
        ]
        own = np.full(len(counts), self._material(UsdShade.MaterialBindingAPI(prim)))
        for subset in UsdGeom.Subset.GetGeomSubsets(mesh, UsdGeom.Tokens.face, "materialBind"):
            faces = np.asarray(subset.GetIndicesAttr().Get(time) or (), dtype=np.int64)
            faces = faces[(faces >= 0) & (faces < len(own))]
            own[faces] = self._material(UsdShade.MaterialBindingAPI(subset.GetPrim()))
        of_triangle = own[polygon]
        for number in np.unique(of_triangle):
            which = of_triangle == number
            rest = [None if a is None else a[which] for a in attributes]
            yield FilePart(Corners(points, at[triangles[which]], *rest), int(number))

    def _uv(self, prim: Any, time: Any) -> tuple[Array, str] | None:
        """Return texture coordinates and where they are: of `st`, or the first that there are."""
        found = [
            primvar
            for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
            if str(primvar.GetTypeName()) in ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]")
            or (_COORDINATES.fullmatch(str(primvar.GetPrimvarName())) and primvar.HasValue())
        ]
        found.sort(key=lambda primvar: str(primvar.GetPrimvarName()) != "st")
        if not found:
            return None
        if len(found) > 1:
            self._note(f"of its sets of texture coordinates {found[0].GetPrimvarName()} is used")
        values = found[0].ComputeFlattened(time)
        values = np.asarray(values if values is not None else (), dtype=np.float64)
        return (values, str(found[0].GetInterpolation())) if values.ndim == 2 else None

    def _normals(self, mesh: Any, time: Any) -> tuple[Array, str] | None:
        primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
        if primvar and primvar.HasValue():
            values, where = primvar.ComputeFlattened(time), primvar.GetInterpolation()
        else:
            values, where = mesh.GetNormalsAttr().Get(time), mesh.GetNormalsInterpolation()
        values = np.asarray(values if values is not None else (), dtype=np.float64)
        return (values, str(where)) if values.ndim == 2 and len(values) else None

    def _at_corners(
        self, values: Array, where: str, at: Indices, triangles: Indices, polygon: Indices,
        points: int,
    ) -> Array | None:  # fmt: skip
        """Return an attribute at the corners of triangles (m, 3, k)."""
        wanted = {
            "faceVarying": (len(at), triangles), "vertex": (points, at[triangles]),
            "varying": (points, at[triangles]), "uniform": (polygon.max() + 1, polygon[:, None]),
        }  # fmt: skip
        count, index = wanted.get(where, (-1, polygon))
        if len(values) < count or count < 0:
            self._note(
                f"an attribute of interpolation {where!r} with {len(values)} values left out"
            )
            return None
        return np.broadcast_to(values[index], (len(triangles), 3, values.shape[1]))

    def _material(self, binding: Any) -> int:
        """Return the number of the material of a prim, -1 without."""
        material, _ = binding.ComputeBoundMaterial()
        if not material:
            return -1
        name = str(material.GetPath())
        if name not in self._materials:
            self._materials[name] = len(self.out.materials)
            self.out.materials.append(self._read_material(material))
        return self._materials[name]

    def _read_material(self, material: Any) -> Material:
        surface = material.ComputeSurfaceSource()[0]
        maps, colour = {}, None
        for name, kind in _INPUTS.items():
            source = surface.GetInput(name) if surface else None
            if source is None or not source:
                continue
            found = [attribute for attribute in source.GetValueProducingAttributes()]
            shader = UsdShade.Shader(found[0].GetPrim()) if found else None
            if shader and shader.GetIdAttr().Get() == "UsdUVTexture":
                picture = self._picture(shader, kind)
                if picture is not None:
                    maps[kind] = picture
            elif kind == "colour" and found:
                value = np.clip(np.asarray(found[0].Get() or (1, 1, 1), dtype=np.float64), 0, 1)
                linear = np.maximum(value, 1e-9) ** (1 / 2.4)
                srgb = np.where(value <= 0.0031308, 12.92 * value, 1.055 * linear - 0.055)
                colour = tuple(float(x) for x in srgb)
        return Material(str(material.GetPrim().GetName()), maps, colour)  # type: ignore[arg-type]

    def _picture(self, shader: Any, kind: str) -> MapImage | None:
        """Return the picture of a texture node."""
        file = shader.GetInput("file")
        asset = file.Get() if file else None
        if asset is None or not asset.path:
            return None
        name = Path(asset.path.replace("\\", "/")).name
        scale = shader.GetInput("scale")
        height = float(scale.Get()[0]) if scale and scale.Get() is not None else None
        height = height if kind == "displacement" else None
        wraps = [found.Get() for key in ("wrapS", "wrapT") if (found := shader.GetInput(key))]
        border = "wrap" if {*wraps} <= {"repeat", "useMetadata"} else "other"
        border = "clamp" if wraps == ["clamp", "clamp"] else border
        coordinates = shader.GetInput("st")
        if coordinates and any(
            UsdShade.Shader(a.GetPrim()).GetIdAttr().Get() == "UsdTransform2d"
            for a in coordinates.GetValueProducingAttributes()
        ):
            self._note(f"the transform of the texture coordinates of {name} is left out")
        package, _, inner = asset.resolvedPath.partition("[")
        if inner:
            with zipfile.ZipFile(package) as archive:
                return MapImage(None, name, archive.read(inner.rstrip("]")), height, border=border)
        path = Path(asset.resolvedPath) if asset.resolvedPath else self.path.parent / name
        return MapImage(path, name, height_range=height, border=border)
