"""Penetration depth of two bodies at given poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.contact.body_arrays import flatten_bodies
from asperity.contact.broad_phase.facet_bvh import facet_table
from asperity.contact.narrow_phase.geom_depth import (
    BodyGeoms,
    DepthQuery,
    SearchLimits,
    depth_along,
)
from asperity.contact.narrow_phase.mesh_depth import facets_along
from asperity.contact.narrow_phase.mesh_workspace import (
    MAX_CANDIDATES,
    MAX_SURFACE_PATCHES,
    facet_space,
)
from asperity.contact.narrow_phase.records import CERTIFIED, PENETRATION
from asperity.contact.narrow_phase.workspace import workspace
from asperity.errors import AsperityError, require_between, require_finite, require_positive
from asperity.geometry.bodies import Body, unit_quaternion
from asperity.geometry.poses import rotation_of


class Depth(NamedTuple):
    """Directional penetration depth of a tool A in a body B.

    Attributes
    ----------
    depth : float
        delta [m], above 0 where the textured bodies overlap; -inf if no part of A is over B along
        n, or, without a certificate, if the search ended before it found any.
    gradient : (6,) array
        Derivative of the depth by A's translation [-] and rotation about the origin of its frame
        [m], world axes, with n fixed in B's frame.
    point : (3,) array
        Deepest point, on A's textured surface, world axes [m].
    slope_normal : (3,) array
        m = n - s_u u - s_v v, the normal of the textured surfaces there, not of unit length.
    gap : float
        Upper bound of the true depth minus `depth` [m].
    certified : bool
        Whether the gap is within the tolerance.
    nodes : int
        Boxes that the search evaluated.
    ties : int
        Number of equally deep points.
    """

    depth: float
    gradient: NDArray[np.float64]
    point: NDArray[np.float64]
    slope_normal: NDArray[np.float64]
    gap: float
    certified: bool
    nodes: int
    ties: int


class BodyPair:
    """A tool A and a body B, prepared for queries of their penetration depth.

    Parameters
    ----------
    body_a, body_b : Body
        The tool and the other body.
    tolerance : float
        Gap at which a depth counts as certified [m], above 0.
    max_nodes : int
        Maximum number of boxes that one search evaluates, 100 to 1e9.

    Raises
    ------
    AsperityError
        A value is outside its range.

    Examples
    --------
    >>> pair = BodyPair(tip, plate)
    >>> pair.depth(pose_of_tip, pose_of_plate, normal=(0, 0, 1)).gradient
    """

    def __init__(
        self, body_a: Body, body_b: Body, *, tolerance: float = 1e-9, max_nodes: int = 50000
    ) -> None:
        self.tolerance = require_positive("tolerance", tolerance, "[m]")
        self.max_nodes = int(require_between("max_nodes", max_nodes, 100, 1e9))
        bodies = (body_a, body_b)
        self._textures, self._geometry = flatten_bodies(bodies)
        self._geoms = [np.flatnonzero(self._geometry.body == i).astype(np.int64) for i in (0, 1)]
        self._facets = None
        if any(body.mesh is not None for body in bodies):
            self._facets = facet_table(bodies, self._textures, self._geometry)
            self._facet_space = facet_space(self._facets, len(self._geometry.kind))
            self._space = workspace(MAX_SURFACE_PATCHES, MAX_CANDIDATES)
        else:
            most = max(len(body.geoms) for body in bodies)
            self._space = workspace(3 * most, 9 * most * most)

    def depth(
        self,
        pose_a: ArrayLike,
        pose_b: ArrayLike,
        normal: ArrayLike,
        *,
        smooth_overlap: float = 1.0,
    ) -> Depth:
        """Return the depth of A in B along `normal`.

        Parameters
        ----------
        pose_a, pose_b : (7,)
            Position [m] and unit quaternion wxyz of each body's frame.
        normal : (3,)
            n, the unit normal of B's smooth surface towards A, world axes.
        smooth_overlap : float
            If a body is a mesh: upper limit of the smooth overlap of facets along the normal of B's
            facet [m], above 0. It excludes the far side of a body.

        Returns
        -------
        Depth

        Raises
        ------
        AsperityError
            A pose or the normal has a wrong shape or is not finite, the normal is not of unit
            length, or too many pairs of facets are within `smooth_overlap`.
        """
        a, b = (np.array(require_finite("pose", pose, 7)) for pose in (pose_a, pose_b))
        n = np.array(require_finite("normal", normal, 3))
        if not abs(np.linalg.norm(n) - 1.0) < 1e-6:
            raise AsperityError(f"normal must have length 1, got {normal!r}")
        found = np.zeros(1, PENETRATION)
        limits = SearchLimits(self.tolerance, self.max_nodes)
        at_a, at_b, n = _relative_frame(a, a[:3]), _relative_frame(b, a[:3]), n / np.linalg.norm(n)
        if self._facets is not None:
            fits = facets_along(
                (self._textures, self._facets, self._geometry), (at_a, at_b), n,
                require_positive("smooth_overlap", smooth_overlap, "[m]"), limits,
                self._space, self._facet_space, found,
            )  # fmt: skip
            if not fits:
                raise AsperityError(
                    f"more than {MAX_CANDIDATES} pairs of facets face each other within "
                    f"smooth_overlap = {smooth_overlap:g} m; reduce it, or use a coarser mesh"
                )
        else:
            geoms_a, geoms_b = self._geoms
            tool = BodyGeoms(geoms_a, geoms_a.size, at_a, 0.0)
            ground = BodyGeoms(geoms_b, geoms_b.size, at_b, 0.0)
            query = DepthQuery(tool, ground, n, np.full(3, np.nan))
            depth_along(self._textures, self._geometry, query, limits, self._space, found)
        out = found[0]
        m = out["slope_normal"].copy()
        # For a contact it is enough that nothing touches; here the distance matters.
        ended = out["depth"] == -np.inf and self._space.search[0]["upper_bound"] > -np.inf
        return Depth(
            depth=float(out["depth"]),
            gradient=np.concatenate([-m, -out["moment"]]),
            point=out["point"] + a[:3],
            slope_normal=m,
            gap=float(out["gap"]),
            certified=bool(out["status"] == CERTIFIED and not ended),
            nodes=int(out["nodes"]),
            ties=int(out["ties"]),
        )


def _relative_frame(pose: NDArray[np.float64], origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the frame (3, 4) of a pose relative to `origin`."""
    rotation = rotation_of(unit_quaternion(tuple(pose[3:])))
    return np.ascontiguousarray(np.hstack([rotation, (pose[:3] - origin)[:, None]]))
