"""Records of the narrow phase, each one element of a structured array.

Kernels get a record as one pointer (`result = results[i]`) and use its fields by name
(`result.depth`). Lengths are in metres; `(u, v, z)` are the axes of the contact frame, whose z
points out of the body that a surface belongs to.
"""

from __future__ import annotations

import numpy as np

PENETRATION = np.dtype(
    [
        ("depth", "f8"),  # largest overlap found [m]; -inf where nothing overlaps along n
        ("gap", "f8"),  # upper bound of the depth minus the depth [m]; 0 for a depth of -inf
        ("nodes", "i8"),  # boxes evaluated
        ("status", "i8"),  # CERTIFIED or BUDGET_SPENT
        ("ties", "i8"),  # number of equally deep points
        ("area", "f8"),  # that they represent, 0 for single points [m^2]
        ("point", "f8", 3),  # their mean on A's surface, from the contact's origin [m]
        ("slope_normal", "f8", 3),  # m = n - s_u u - s_v v, mean over the ties; world axes
        ("moment", "f8", 3),  # mean of point x m [m]
        ("friction", "f8"),  # mean of Coulomb's coefficient if there is a friction map; else nan
        ("unknown", "f8"),  # share of the points at which neither surface has a coefficient
        ("turn", "f8", 3),  # derivative by n beyond -depth m, of steep faces alone [m]
        ("scale", "f8"),  # square root of the stiffness there over that of the law; 0: no map
    ],
    align=True,
)
"""Penetration depth of two bodies along n, the point where it is attained, and its gradient."""

CERTIFIED, BUDGET_SPENT = 0, 1
"""Status: the gap is within the tolerance; the search ended before that."""

BORDER = np.dtype(
    [
        ("constant", "f8"),  # k0
        ("from_x", "f8"),  # k1
        ("from_y", "f8"),  # k2
        ("from_root", "f8"),  # k3
        ("from_square", "f8"),  # k4
        ("is_edge", "?"),  # an edge of the body, not a limit of the patch alone
    ],
    align=True,
)
"""Inequality that bounds a patch: k0 + k1 x + k2 y + k3 root(x, y) + k4 (x^2 + y^2) <= 0."""

MAX_BORDERS, MAX_CORNERS = 10, 8

PATCH = np.dtype(
    [
        # The base surface: origin + x lateral[:, 0] + y lateral[:, 1] + z (slope . (x, y) + ...).
        ("origin", "f8", 3),  # base point at x = y = 0 without the root's term [m]
        ("lateral", "f8", (2, 2)),  # (u, v) from (x, y)
        ("slope", "f8", 2),  # z from (x, y)
        ("bulge", "f8"),  # z from root(x, y) = sqrt(1 - a^T E a) [m]; 0 for planes
        ("ellipse", "f8", 3),  # E11, E12, E22 [1/m^2]
        # Outward normal w in the contact frame, not of unit length unless `is_unit`.
        ("normal", "f8", 3),
        ("normal_from_x", "f8", 3),
        ("normal_from_y", "f8", 3),
        ("normal_from_root", "f8", 3),
        ("is_unit", "?"),
        # Texture: its index (-1: none), mapping (PLANAR, ...), and the base point in its frame.
        ("texture", "i8"),
        ("mapping", "i8"),
        ("texture_origin", "f8", 3),  # [m]
        ("texture_from_x", "f8", 3),
        ("texture_from_y", "f8", 3),
        ("texture_from_root", "f8", 3),  # [m]
        # The normal in the body's frame, whose fourth powers weight the three maps (triplanar).
        ("body_normal", "f8", 3),
        ("body_normal_from_x", "f8", 3),
        ("body_normal_from_y", "f8", 3),
        ("body_normal_from_root", "f8", 3),
        # Cylindrical map; `map_start` of a triplanar map is the origin of each of its maps.
        ("map_start", "f8", 2),  # texture coordinates u at y = 0 and v at x = 0 [m]
        ("radius", "f8"),  # [m]
        ("map_sense", "f8"),  # 1 where u grows with y, else -1
        ("map_stretch", "f8"),  # factor by which u is stretched to close round the axis
        ("lean", "f8"),  # v from the root [m]
        # Friction: its map among the textures (-1: none) or else Coulomb's coefficient (nan: none),
        # and its map coordinates: scale times texture coordinates plus shift [m].
        ("friction_map", "i8"),
        ("friction", "f8"),
        ("friction_scale", "f8", 2),
        ("friction_shift", "f8", 2),
        # Stiffness: its map among the textures (-1: none), mapped as the texture, or else the
        # compliance (0: none).
        ("stiffness_map", "i8"),
        ("compliance", "f8"),  # [m/N]
        # Extent.
        ("rectangle", "f8", 4),  # x0, x1, y0, y1 [m]
        ("rectangle_is_edge", "?"),
        ("border_count", "i8"),
        ("borders", BORDER, MAX_BORDERS),
        ("min_root", "f8"),  # least root within the patch
        ("extent", "f8", 4),  # facets: u0, u1, v0, v1 of the base [m]
        ("corner_count", "i8"),  # facets that are bounded by their sides, which come first
        ("corners", "f8", (MAX_CORNERS, 2)),  # (x, y) of a facet's corners [m]
        # Derived quantities for the bounds.
        ("lateral_inverse", "f8", (2, 2)),  # (x, y) from (u, v)
        ("lateral_min", "f8"),  # singular values of `lateral`
        ("lateral_max", "f8"),
        ("ellipse_min", "f8"),  # eigenvalues of E [1/m^2]
        ("ellipse_max", "f8"),
        ("ellipse_uv", "f8", 3),  # lateral^-T E lateral^-1: 11, 12, 22 [1/m^2]
        ("ellipse_uv_min", "f8"),  # least eigenvalue of it [1/m^2]
        ("is_level", "?"),  # plane with its normal along z: the texture moves no point laterally
        ("aspect", "f8"),  # largest semi-axis over the smallest
        ("map_min", "f8"),  # singular values of texture coordinates from (x, y), without root
        ("map_max", "f8"),
        ("map_root", "f8"),  # size of the root's term in texture coordinates [m]
        ("normal_slope", "f8"),  # planes: bound of |w'| of the unit normal [1/m]
        ("normal_bend", "f8"),  # planes: bound of |w''| [1/m^2]
        ("texture_top", "f8"),  # highest texture on a facet [m]; inf: use that of the whole map
        ("lowered", "f8"),  # how far a steep plane is lowered along z [m]: see `lower_steep`
        ("lowered_rate", "f8", 2),  # its derivative by a rotation of z towards u and v [m]
        ("normal_lateral", "f8"),  # largest lateral part of the unit normal
        ("base_top", "f8"),  # largest z of the base within its borders [m]
        ("normal_min", "f8"),  # facets: least length of w
        ("normal_rise", "f8"),  # facets: largest z of the unit normal
        ("fold", "f8"),  # lateral shear by the texture, over `lateral_min`
    ],
    align=True,
)
"""Part of a body's textured surface in the contact frame; see `surface_patch`."""

POINT = np.dtype(
    [
        ("p", "f8", 3),
        ("p_x", "f8", 3),
        ("p_y", "f8", 3),
        ("p_xx", "f8", 3),
        ("p_xy", "f8", 3),
        ("p_yy", "f8", 3),
    ],
    align=True,
)
"""Point of a displaced surface in (u, v, z) [m] and its derivatives by the parameters (x, y)."""

OVERLAP = np.dtype(
    [
        ("f", "f8"),  # overlap [m]; -inf where one of the two patches has no such point
        ("f_x", "f8"),  # its derivatives by (x, y)
        ("f_y", "f8"),
        ("f_xx", "f8"),
        ("f_xy", "f8"),
        ("f_yy", "f8"),
        ("x", "f8"),  # parameters on the patch that is searched [m]
        ("y", "f8"),
        ("other_x", "f8"),  # parameters on the other patch [m]
        ("other_y", "f8"),
        ("jacobian", "f8", (2, 2)),  # (other_x, other_y) by (x, y)
        ("jacobian_bend", "f8", (2, 3)),  # their second derivatives by xx, xy, yy [1/m]
        ("slope", "f8", 2),  # slopes over (u, v) of the surface that is searched
        ("other_slope", "f8", 2),  # and of the other
        ("point", "f8", 3),  # (u, v, z) of the point on the surface that is searched [m]
        ("other_z", "f8"),  # z of the other surface there, along its own z [m]
        ("pair", "i8"),  # number of the pair of patches, -1: none
        ("weight", "f8"),  # area that the point represents [m^2]; 0: an isolated peak
    ],
    align=True,
)
"""Overlap of two patches at one point, with its derivatives."""

LIMIT = np.dtype(
    [
        ("g", "f8"),  # [m]
        ("g_x", "f8"),
        ("g_y", "f8"),
        ("g_xx", "f8"),
        ("g_xy", "f8"),
        ("g_yy", "f8"),
        ("owner", "i8"),  # 0: a limit of a patch alone; 1, 2: an edge of the first, second body
        ("is_concave", "?"),  # g is not convex: the feasible region bends round the border
    ],
    align=True,
)
"""Limit of either patch, g(x, y) <= 0, at a point of the search: value and derivatives."""

HALF_PLANE = np.dtype([("n_x", "f8"), ("n_y", "f8"), ("limit", "f8")], align=True)
"""Feasible steps: n_x dx + n_y dy <= limit."""

NODE = np.dtype(
    [
        ("x0", "f8"),
        ("x1", "f8"),
        ("y0", "f8"),
        ("y1", "f8"),
        ("bound", "f8"),  # upper bound of the overlap over the box [m]
        ("candidate", "i4"),  # row of its pair of patches
        ("is_whole", "?"),  # the box is that of its candidate
        ("is_pruned", "?"),
    ],
    align=True,
)
"""Box of the searched patch's parameters."""

CANDIDATE = np.dtype(
    [
        ("bound", "f8"),  # upper bound of the overlap [m]; -inf: searched, or nothing overlaps
        ("base_x", "f8"),  # parameters at which the smooth bases overlap most [m]
        ("base_y", "f8"),
        ("is_initialised", "?"),  # ascended once
        ("number", "i8"),  # A's patch * stride + B's patch
        ("box", "f8", 4),  # planes: x0, x1, y0, y1 over which they overlap [m]
        ("extent", "f8", 4),  # planes, one of them rough: u0, u1, v0, v1 of both [m]; else nan
        ("lifts", "f8", 5),  # planes: see `bounds.planes.Lifts`
    ],
    align=True,
)
"""Pair of patches that may hold the deepest point."""

PATCH_SLOT = np.dtype(
    [
        ("first", "i8"),
        ("end", "i8"),
        ("made", "i8"),
        ("seen", "i8"),
        ("extent", "f8", 4),  # u0, u1, v0, v1 of the base [m]
        ("top", "f8"),  # highest z of the base, raised by the highest texture [m]
        ("shift", "f8"),  # upper bound of the texture's lateral displacement of points [m]
    ],
    align=True,
)
"""Patches `first` to `end - 1` of a facet or a geom, valid in the query with the number `made`.

Extent, top and shift, filled before a facet's patch is made, are valid in the query number `seen`.
"""

QUEUE_STATE = np.dtype([("retired", "i8"), ("stored", "i8"), ("used", "i8")], align=True)
"""Numbers of nodes retired and stored by the last search of a whole region, and in use now."""

MAX_TIES, MAX_STACK, MAX_LIMITS, MAX_HALF_PLANES = 1024, 1024, 26, 32
MAX_SIDES = 36
"""Maximum number of corners of a polygon while it is clipped."""

SEARCH = np.dtype(
    [
        ("incumbent", "f8"),  # largest overlap found, a lower bound of the depth [m]
        ("ceiling", "f8"),  # a search ends once it has found a larger overlap [m]
        ("upper_bound", "f8"),  # of what has been pruned or left unsearched [m]
        ("nodes", "f8"),  # boxes evaluated; cheap bounds count as a fraction
        ("node_limit", "f8"),
        ("deadline", "f8"),  # by `seconds_now` [s]; 0: none
        ("next_clock_read", "f8"),  # node count at which the clock is read next
        ("is_cut_short", "?"),  # ended by the clock, since this was last cleared
        ("last_bound", "f8"),  # of the box that was evaluated last [m]
        ("load", "f8"),  # see `compliance` [N^(1/2) m^(1/2)]; 0: the overlap itself is searched
        ("usual", "f8"),  # compliance where no surface has one [m/N]; 0: ignore stiffness maps
        ("best", OVERLAP),
        ("tie_count", "i8"),
        ("ties", OVERLAP, MAX_TIES),  # points as deep as the best, and stale ones
        # Scratch memory of one evaluation.
        ("at", OVERLAP),
        ("trial", OVERLAP),
        ("surface", POINT),
        ("other_surface", POINT),
        ("limits", LIMIT, MAX_LIMITS),
        ("half_planes", HALF_PLANE, MAX_HALF_PLANES),
        ("polygon", "f8", (2 * MAX_SIDES, 2)),  # rows x, y; the second half is for clipping
        ("stack", NODE, MAX_STACK),
        ("start_boxes", "f8", (9, 4)),
    ],
    align=True,
)
"""State of a search for the deepest point, and its scratch memory."""
