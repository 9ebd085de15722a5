"""User-level description of an elastic body: material, support, mesh.

The modal form of a body takes seconds to compute, so it is cached on disk for a modulus of 1 Pa and
a density of 1 kg/m^3, from which that of any other follows: `K ~ E` and `M ~ rho`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity._core.kept_arrays import kept_folder, read_arrays, write_arrays
from asperity._core.kernels import source_hash
from asperity.contact.deformable.box_mesh import box_counts, box_tetrahedra
from asperity.contact.deformable.elastic_body import (
    MOST_TETRAHEDRA,
    MOST_VERTICES,
    ElasticBody,
    elastic_body,
    require_tetrahedra,
    tetrahedra_in,
)
from asperity.contact.deformable.elastic_contact import ElasticContact
from asperity.contact.deformable.surface import DeformableSurface
from asperity.contact.soft.skin import foundation_modulus
from asperity.errors import AsperityError, did_you_mean, require_between, require_positive
from asperity.geometry.bodies import Body
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.topology import crosses
from asperity.geometry.poses import rotation_of

SIDES: dict[str, tuple[tuple[int, int], ...]] = {
    "bottom": ((2, -1),), "top": ((2, 1),), "left": ((0, -1),), "right": ((0, 1),),
    "front": ((1, -1),), "back": ((1, 1),), "ends": ((0, -1), (0, 1)),
    "rim": ((0, -1), (0, 1), (1, -1), (1, 1)),
}  # fmt: skip
"""Parts that can be held: sides of the body, by axis of its frame and direction."""
FEW_VERTICES, FEW_TAXELS = 700, 150_000
"""Largest numbers of the surface with a default spacing and pitch."""
FILE_KIND = "elastic-bodies"


@dataclass(frozen=True, eq=False)
class ElasticSolid:
    """A linear-elastic body of a scene: one box, or a mesh, with its texture on an elastic layer.

    Parameters
    ----------
    body : Body
    modulus : float
        Young's modulus E [Pa], 1 to 1e13.
    poisson : float
        Poisson's ratio, 0 to below 0.5; also of the layer.
    density : float
        [kg/m^3], above 0.
    damping : float
        Damping ratio of each mode, 0 to 10.
    modes : int
        Number of dynamic modes; the rest of the deformation is quasi-static.
    fixed : str
        Part that is held: one of `SIDES`, in the body's frame.
    fixed_depth : float, optional
        Depth of the held part [m]; by default a quarter of the spacing.
    spacing : float, optional
        Length of the elements' edges [m]; by default a quarter of the smallest side, or more.
    friction : float
        Coulomb's coefficient [-], 0 to 100; see `SkinContact`.
    layer_thickness, layer_modulus : float, optional
        Of the layer with the texture [m], [Pa]; by default half the spacing, and the body's.
    pitch : float, optional
        Distance between taxels [m]; by default the smaller of an eighth of the spacing and a third
        of the texture's shortest wavelength.

    Raises
    ------
    AsperityError
        A value is outside its range, or leads to a mesh that is too large; the message begins with
        its name. Or the body is neither one box nor a mesh.
    """

    body: Body
    modulus: float
    poisson: float = 0.4
    density: float = 1000.0
    damping: float = 0.1
    modes: int = 30
    fixed: str = "bottom"
    fixed_depth: float | None = None
    spacing: float | None = None
    friction: float = 0.0
    layer_thickness: float | None = None
    layer_modulus: float | None = None
    pitch: float | None = None
    notes: tuple[str, ...] = field(default=(), init=False)
    """Notes on chosen defaults."""

    def __post_init__(self) -> None:
        require_between("modulus", self.modulus, 1.0, 1e13, "Pa")
        foundation_modulus(self.modulus, self.poisson, 1.0)
        require_positive("density", self.density, "kg/m^3")
        require_between("damping", self.damping, 0.0, 10.0)
        require_between("modes", self.modes, 1, 1000)
        if self.modes != int(self.modes):
            raise AsperityError(f"modes must be a whole number, got {self.modes!r}")
        object.__setattr__(self, "modes", int(self.modes))
        if self.fixed not in SIDES:
            raise AsperityError(
                f"fixed must be one of {', '.join(SIDES)}, got {self.fixed!r}"
                f"{did_you_mean(self.fixed, SIDES)}"
            )
        require_between("friction", self.friction, 0.0, 100.0)
        for name in ("spacing", "fixed_depth", "layer_thickness", "pitch"):
            if getattr(self, name) is not None:
                require_between(name, getattr(self, name), 1e-6, 1.0, "m")
        if self.layer_modulus is not None:
            require_between("layer_modulus", self.layer_modulus, 1.0, 1e13, "Pa")
        if self.body.mesh is not None:
            require_tetrahedra()
        elif len(self.body.geoms) != 1 or self.body.geoms[0].kind != "box":
            kinds = ", ".join(geom.kind for geom in self.body.geoms)
            raise AsperityError(
                f"body {self.body.name!r} is made of {kinds}; valid: one box, or a mesh"
            )
        self._choose()
        self._refuse_undivided()

    def _choose(self) -> None:
        """Set the defaults of parameters that are not given, and note them."""
        chosen = {}
        spacing = self._default_spacing() if self.spacing is None else float(self.spacing)
        if self.spacing is None:
            chosen["spacing"] = spacing
        if self.fixed_depth is None:
            object.__setattr__(self, "fixed_depth", 0.25 * spacing)
        if self.layer_thickness is None:
            chosen["layer_thickness"] = 0.5 * spacing
        if self.pitch is None:
            waves = [texture.shortest_wavelength for texture in self.body.fields]
            fine = min(0.125 * spacing, *(wave / 3.0 for wave in waves), 1.0)
            area = 0.5 * float(np.linalg.norm(crosses(self._corners), axis=1).sum())
            chosen["pitch"] = max(fine, float(np.sqrt(area / FEW_TAXELS)))
        texts = [f"{name} {1e3 * value:.3g} mm" for name, value in chosen.items()]
        if self.layer_modulus is None:
            chosen["layer_modulus"] = self.modulus
            texts.append(f"layer_modulus {self.modulus:.3g} Pa")
        for name, value in chosen.items():
            object.__setattr__(self, name, value)
        if texts:
            note = f"elastic: chosen {', '.join(texts)}; held at the {self.fixed}"
            object.__setattr__(self, "notes", (note,))

    @property
    def _corners(self) -> Array:
        """Corners of the triangles of the undivided surface [m], (m, 3, 3)."""
        if self.body.mesh is not None:
            return np.asarray(self.body.mesh.vertices[self.body.mesh.faces])
        nodes, _, faces = box_tetrahedra(self.body.geoms[0].size, (1, 1, 1))
        return np.asarray(nodes[faces])

    def _default_spacing(self) -> float:
        if self.body.mesh is not None:
            return 0.25 * float(np.ptp(self.body.mesh.vertices, axis=0).min())
        half = self.body.geoms[0].size
        spacing = 0.5 * min(half)
        while _vertices(box_counts(half, spacing)) > FEW_VERTICES:
            spacing *= 1.1
        return spacing

    @cached_property
    def divided(self) -> tuple[Mesh, Array, Indices]:
        """The surface, and nodes (n, 3) [m] and tetrahedra (t, 4) in it, in the body's frame."""
        assert self.spacing is not None
        if self.body.mesh is not None:
            return self.body.mesh, *self._fill_with_tetrahedra(self.body.mesh, self.spacing)
        geom = self.body.geoms[0]
        counts = box_counts(geom.size, self.spacing)
        if _vertices(counts) > MOST_VERTICES or 6 * np.prod(counts) > MOST_TETRAHEDRA:
            raise AsperityError(
                f"spacing {self.spacing:g} m divides the box into {6 * np.prod(counts)} tetrahedra "
                f"with {_vertices(counts)} vertices on the surface; valid: at most "
                f"{MOST_TETRAHEDRA}, and {MOST_VERTICES}, so a larger spacing"
            )
        nodes, tetrahedra, faces = box_tetrahedra(geom.size, counts)
        placed = nodes @ rotation_of(geom.quaternion).T + geom.position
        used, corner = np.unique(faces, return_inverse=True)
        mesh = mesh_from_arrays(placed[used], corner.reshape(-1, 3), name=self.body.name)
        return mesh, placed, tetrahedra

    def _fill_with_tetrahedra(self, mesh: Mesh, spacing: float) -> tuple[Array, Indices]:
        """Return nodes and tetrahedra that fill a mesh, cached on disk."""
        file = _cache_file(f"tetrahedra {spacing!r}", mesh.vertices, mesh.faces)
        found = read_arrays(file) or {}
        if not {"nodes", "tetrahedra"} <= found.keys():
            try:
                nodes, tetrahedra = tetrahedra_in(mesh, spacing)
            except AsperityError as error:
                raise AsperityError(f"spacing: {error}") from None
            found = {"nodes": nodes, "tetrahedra": tetrahedra}
            write_arrays(file, found, "tetrahedra")
        return found["nodes"], found["tetrahedra"]

    def held(self, nodes: Array) -> Mask:
        """Return whether each node (n, 3), in the body's frame, is held."""
        assert self.fixed_depth is not None
        out = np.zeros(len(nodes), bool)
        for axis, direction in SIDES[self.fixed]:
            along = direction * nodes[:, axis]
            out |= along > along.max() - self.fixed_depth
        return out

    def _refuse_undivided(self) -> None:
        nodes = self.divided[1]
        fixed = nodes[self.held(nodes)]
        if len(fixed) < 3 or np.linalg.matrix_rank(fixed - fixed[0], 1e-9) < 2:
            raise AsperityError(
                f"fixed_depth {self.fixed_depth:.3g} m holds {len(fixed)} nodes at the "
                f"{self.fixed}; valid: a depth that holds three or more that are not on one line"
            )
        if len(fixed) == len(nodes):
            raise AsperityError(
                f"fixed_depth {self.fixed_depth:.3g} m holds all of the body; valid: less"
            )
        free = 3 * (len(nodes) - len(fixed))
        if self.modes >= free:
            raise AsperityError(f"modes must be 1 to {free - 1}, got {self.modes!r}")
        _ = self.surface  # refuses a pitch of too many taxels

    @cached_property
    def elastic(self) -> ElasticBody:
        """The body in modal form, from the cache on disk if possible."""
        mesh, nodes, tetrahedra = self.divided
        inputs = (mesh.vertices, mesh.faces, nodes, tetrahedra, self.held(nodes))
        file = _cache_file(f"modal {self.poisson!r} {self.modes}", *inputs)
        found, v = read_arrays(file) or {}, len(mesh.vertices)
        shapes = {
            "modes": (3 * v, self.modes), "frequencies": (self.modes,),
            "compliance": (3 * v, 3 * v), "mass": (),
        }  # fmt: skip
        if any(name not in found or found[name].shape != shapes[name] for name in shapes):
            unit = elastic_body(
                mesh, nodes, tetrahedra, modulus=1.0, density=1.0, held=self.held,
                poisson=self.poisson, modes=self.modes,
            )  # fmt: skip
            found = {name: np.array(getattr(unit, name)) for name in shapes}
            write_arrays(file, found, "elastic bodies")
        return ElasticBody(
            mesh, found["modes"] / np.sqrt(self.density),
            found["frequencies"] * np.sqrt(self.modulus / self.density),
            found["compliance"] / self.modulus, float(found["mass"]) * self.density,
        )  # fmt: skip

    @cached_property
    def surface(self) -> DeformableSurface:
        """The layer with the texture, on the body's mesh."""
        assert self.layer_thickness is not None
        assert self.layer_modulus is not None
        assert self.pitch is not None
        laid = self.body.surfaces[0]
        return DeformableSurface(
            self.divided[0], thickness=self.layer_thickness, modulus=self.layer_modulus,
            poisson=self.poisson, pitch=self.pitch, texture=laid.texture, mapping=laid.mapping,
            offset=laid.offset, friction=self.friction,
        )  # fmt: skip

    def contact(self, others: Sequence[Body], **options: Any) -> ElasticContact:
        """Return the contact with other bodies, in this body's frame; see `ElasticContact`."""
        return ElasticContact(self.elastic, self.surface, others, damping=self.damping, **options)

    def __getstate__(self) -> dict[str, Any]:
        """Omit large arrays that are cached on disk or quickly made."""
        made = ("divided", "elastic", "surface")
        return {name: value for name, value in vars(self).items() if name not in made}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)


def _vertices(counts: tuple[int, int, int]) -> int:
    """Return the number of vertices on the surface of a divided box."""
    inner = np.prod([n - 1 for n in counts])
    return int(np.prod([n + 1 for n in counts]) - inner)


def _cache_file(what: str, *arrays: Any) -> Path:
    """Return the cache file of a result computed from arrays by this version of the code."""
    code = source_hash(Path(__file__).with_name("elastic_body.py"))
    digest = hashlib.sha256(f"{code} {what}".encode())
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return kept_folder(FILE_KIND) / f"{digest.hexdigest()[:32]}.npz"
