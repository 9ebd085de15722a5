"""The brute-force reference on meshes, against geoms, closed forms and plain searches.

Wanted is 0.05 % of the texture's height from valley to crest; asked for here is far more where
the answer is exact: 1e-9 m or better of 1e-4 m.
"""

import math

import numpy as np
import pytest
from naive_bodies import AT_REST, UP, highest, plate, pose, ripple, rough, solid, turn
from naive_meshes import ball_mesh
from scipy import optimize
from scipy.spatial.transform import Rotation

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import Mesh
from oracle.depth import frame_along, reference_depth
from oracle.meshes import mesh_surface
from oracle.raster import Grid, envelope_of
from oracle.windows import windows_over

A, L = 50e-6, 1e-3
QUICK = {"samples": 120, "zooms": 5}
TARGET = 5e-4
"""Of the texture's height from valley to crest."""


def meshed(vertices, faces, texture=None, mapping="planar", normals=None, uv=None, **more):
    """Return a body with a mesh; without `normals` (of vertices) all its edges are hard."""
    vertices, faces = np.asarray(vertices, dtype=float), np.asarray(faces)
    x = vertices[faces]
    flat = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    flat /= np.linalg.norm(flat, axis=-1, keepdims=True)
    at_corners = np.repeat(flat[:, None], 3, axis=1) if normals is None else normals[faces]
    mesh = Mesh(vertices, faces, at_corners, uv)
    box = Geom("mesh", np.maximum(np.ptp(vertices, axis=0) / 2, 1e-6))
    return Body(more.pop("name", "meshed"), [box], texture, mapping, mesh=mesh, **more)


def box_mesh(half, middle=(0.0, 0.0, 0.0)):
    """Return vertices and 12 triangles of a box."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners * half + middle, np.array(faces)


def icosphere(radius, cuts):
    """Return vertices, faces and vertex normals of an icosahedron cut in four `cuts` times."""
    mesh = ball_mesh(radius, cuts)
    return mesh.vertices, mesh.faces, mesh.vertices / radius


def roof(slope, half=2e-3, depth=1.5e-3):
    """Return vertices, faces and smooth normals of two slopes that meet at x = 0."""
    c, s = math.cos(slope), math.sin(slope)
    x = [(i * half, j * depth, -abs(i) * half * s / c) for i in (-1, 0, 1) for j in (-1, 1)]
    w = [(i * s, 0.0, c if i else 1.0) for i in (-1, 0, 1) for _ in range(2)]
    return np.array(x), np.array([(0, 2, 1), (1, 2, 3), (2, 4, 3), (3, 4, 5)]), np.array(w)


@pytest.mark.parametrize("ground", ["plane", "bumps"])
@pytest.mark.parametrize("tilt", [0.0, 0.03, 0.4])
def test_a_box_of_triangles_is_a_box(tilt, ground):
    texture, half = rough(1, 15e-6), (2e-3, 1.5e-3, 1.2e-3)
    under = solid("plane") if ground == "plane" else plate(rough(2, 10e-6))
    at = pose(2e-4, 1e-4, 1.3e-3, turn([1, 2, 0], tilt))
    bodies = (
        Body("box", [Geom("box", half)], texture, offset=(1e-4, 3e-4)),
        meshed(*box_mesh(half), texture, offset=(1e-4, 3e-4)),
    )
    of_geom, of_mesh = (reference_depth(b, at, under, AT_REST, UP, **QUICK) for b in bodies)
    assert of_mesh.depth == pytest.approx(of_geom.depth, abs=1e-9)
    assert of_mesh.resolution < 1e-8


def test_a_mesh_may_be_the_ground_and_meet_a_mesh():
    texture, half = rough(1, 15e-6), (4e-3, 4e-3, 1e-3)
    at, low = pose(3e-4, 1e-4, 1.48e-3, turn([1, 0, 1], 1.0)), pose(0, 0, -1e-3)
    tools = Body("box", [Geom("box", (9e-4,) * 3)], texture), meshed(*box_mesh([9e-4] * 3), texture)
    grounds = Body("ground", [Geom("box", half)], texture), meshed(*box_mesh(half), texture)
    depths = [
        reference_depth(tool, at, ground, low, UP, **QUICK).depth
        for tool in tools for ground in grounds
    ]  # fmt: skip
    assert np.ptp(depths) < 1e-9


@pytest.mark.parametrize("finest", [3, pytest.param(4, marks=pytest.mark.slow)])
def test_a_finer_sphere_is_rounder_to_second_order(finest):
    """A chord of length h lies h^2 / 8 R below its arc: half the length, a quarter of the error."""
    radius, errors = 1.5e-3, []
    texture = rough(4, 20e-6, shortest=1e-3)
    exact_body = Body("ball", [Geom("sphere", (radius,))], texture, "triplanar")
    poses = [pose(0, 0, 1.4e-3, turn(axis, 1.0)) for axis in ([1, 0, 0], [1, 2, 3], [-1, 3, 1])]
    exact = [reference_depth(exact_body, at, solid("plane"), AT_REST, UP, **QUICK) for at in poses]
    for cuts in range(finest - 2, finest + 1):
        vertices, faces, normals = icosphere(radius, cuts)
        ball = meshed(vertices, faces, texture, "triplanar", normals)
        off = [
            reference_depth(ball, at, solid("plane"), AT_REST, UP, **QUICK).depth - true.depth
            for at, true in zip(poses, exact, strict=True)
        ]
        errors.append(math.sqrt(np.mean(np.square(off))))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((orders > 1.5) & (orders < 2.6)), errors
    longest = 1.2 * radius / 2**finest
    assert errors[-1] < longest**2 / (8 * radius)


def test_plates_in_and_out_of_register():
    tool = meshed(*box_mesh((2e-3, 1e-3, 1e-3)), ripple(A, L))
    ground = meshed(*box_mesh((8e-3, 8e-3, 2e-3), (0, 0, -2e-3)), ripple(A, L))
    for shift, clearance in ((0.0, 0.0), (0.5 * L, 2 * A)):
        at = pose(shift, 0, 1e-3 + 1.7 * A)
        found = reference_depth(tool, at, ground, AT_REST, UP, **QUICK)
        assert found.depth == pytest.approx(0.3 * A - clearance, abs=1e-10)


@pytest.mark.parametrize("border", ["wrap", "clamp"])
def test_texture_coordinates_say_what_a_planar_map_says(border):
    kept = rough(6, 15e-6)
    texture = type(kept)(kept.samples, kept.pixel_size, border)
    vertices, faces = box_mesh((2e-3, 2e-3, 1e-3), (0, 0, -1e-3))
    # A clamped planar map has its middle at the offset, the unit square its corner at 0.
    middle = 0.5 * np.array(texture.size) if border == "clamp" else 0.0
    uv = (vertices[faces][..., :2] + middle) / texture.size
    at = pose(4e-4, -1e-4, 1.48e-3)
    depths = [
        reference_depth(solid("sphere"), at, ground, AT_REST, UP, **QUICK).depth
        for ground in (
            meshed(vertices, faces, texture, "planar", offset=(2e-4, 1e-4)),
            meshed(vertices, faces, texture, "uv", uv=uv, offset=(2e-4, 1e-4)),
        )
    ]
    assert depths[0] == pytest.approx(depths[1], abs=1e-12)


@pytest.mark.parametrize(
    "angle", [math.pi, *(pytest.param(angle, marks=pytest.mark.slow) for angle in (0.4, -2.0))]
)
def test_a_cylindrical_map_goes_round_a_prism_without_a_seam(angle):
    """Of a ripple along the circumference, on one side of a prism: a maximum over one number."""
    radius, sides, texture = 1e-3, 48, ripple(20e-6, 0.4e-3)
    phi = 2 * math.pi * np.arange(sides) / sides + 0.01
    rim = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
    x = np.concatenate([radius * rim + [0, 0, z] for z in (-2e-3, 2e-3)])
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = np.concatenate(
        [np.stack([k, after, k + sides], -1), np.stack([after, after + sides, k + sides], -1)]
    )
    roller = meshed(x, faces, texture, "cylindrical", np.concatenate([rim, rim]))
    whole = round(2 * math.pi * radius / texture.size[0])
    lying = Rotation.from_euler("y", 90, degrees=True) * Rotation.from_euler("z", angle)
    at = pose(0, 0, radius, np.roll(lying.as_quat(), 1))
    found = reference_depth(roller, at, solid("plane"), AT_REST, UP, **QUICK)
    down = lying.inv().apply(-UP)

    def reach(share, a, b):
        share = np.asarray(share)[..., None]
        w = (1 - share) * rim[a] + share * rim[b]
        along = (phi[a] + share[..., 0] * 2 * math.pi / sides) * whole / (2 * math.pi)
        t = texture.heights(along * texture.size[0], 0.0)
        return (radius * w + t[..., None] * w / np.linalg.norm(w, axis=-1, keepdims=True)) @ down

    seen = [k for k in range(sides) if rim[k] @ down > 0.5]
    exact = max(
        highest(lambda s, k=k: reach(s, k, after[k]), 0.0, 1.0, 2001) for k in seen
    )  # fmt: skip
    assert found.depth == pytest.approx(exact - radius, abs=1e-9)


def test_a_smooth_crease_does_not_tear():
    """Facet normals would open the crease by 2 t sin(10 degrees), and lines would fall through."""
    vertices, faces, normals = roof(math.radians(10.0))
    texture = type(rough(7, 1e-6))(np.full((4, 4), 3e-4), 1e-3, "wrap")
    grid = Grid(np.array([-5e-4, -5e-4]), 4.03e-6, (248, 248))
    region = np.array([[-5e-4, -5e-4], [5e-4, 5e-4]])
    gaps = []
    for w in (normals, None):
        body = meshed(vertices, faces, texture, "planar", w)
        side = mesh_surface(body, AT_REST, frame_along(UP), np.zeros(3), 1.0)
        rise = envelope_of(windows_over(side, region, 1e-3), grid).rise
        # The second axis of the grid is x.
        gaps.append(np.count_nonzero(np.isinf(rise).any(axis=0)) * grid.spacing)
    assert gaps[0] == 0.0
    assert gaps[1] == pytest.approx(2 * 3e-4 * math.sin(math.radians(10.0)), abs=5e-6)


def test_a_creased_mesh_on_a_plane_is_a_plain_search():
    """Dense samples of every facing triangle, then a climb from the best: no silhouettes here."""
    vertices, faces, normals = roof(math.radians(25.0))
    texture = rough(8, 20e-6)
    body = meshed(vertices, faces, texture, "triplanar", normals, offset=(1e-4, 0.0))
    upside_down = Rotation.from_euler("xyz", [math.pi + 0.2, 0.15, 0.4])
    at = pose(0, 0, 5e-4, np.roll(upside_down.as_quat(), 1))
    found = reference_depth(body, at, solid("plane"), AT_REST, UP, **QUICK)

    def reach(b, face):
        b = np.moveaxis(np.asarray([1 - b[0] - b[1], b[0], b[1]]), 0, -1)
        base, w = b @ vertices[face], b @ normals[face]
        w = w / np.linalg.norm(w, axis=-1, keepdims=True)
        x, y, z = np.moveaxis(base, -1, 0)
        maps = [texture.heights(u - 1e-4, v) for u, v in ((y, z), (z, x), (x, y))]
        t = np.sum(w**4 * np.stack(maps, axis=-1), axis=-1) / np.sum(w**4, axis=-1)
        return -upside_down.apply((base + t[..., None] * w).reshape(-1, 3))[:, 2]

    marks = np.stack(np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401)))
    inside = marks[:, marks.sum(axis=0) <= 1 + 1e-12]
    best = -math.inf
    for face in faces:
        values = reach(inside, face)
        for k in np.argsort(-values)[:3]:
            climb = optimize.minimize(
                lambda b, f=face: -reach(b, f)[0] / A, inside[:, k], method="SLSQP",
                bounds=[(0, 1), (0, 1)], options={"ftol": 1e-13},
                constraints={"type": "ineq", "fun": lambda b: 1 - b.sum()},
            )  # fmt: skip
            if climb.success and climb.x.sum() <= 1 + 1e-9:
                best = max(best, -climb.fun * A)
        best = max(best, values.max())
    assert found.depth == pytest.approx(best - 5e-4, abs=1e-9)
    assert TARGET * texture.relief > 1e-9


def test_moving_both_bodies_changes_nothing():
    vertices, faces, normals = icosphere(1.5e-3, 2)
    ball = meshed(vertices, faces, rough(4, 15e-6), "triplanar", normals)
    x, f, w = roof(0.2)
    ridge = meshed(x, f, rough(5, 15e-6), "planar", w)
    low, high = pose(0, 0, 0), pose(2e-4, -3e-4, 1.45e-3, turn([1, 2, 3], 0.7))
    depths = []
    for seed in (None, 1, 2):
        moved = Rotation.identity() if seed is None else Rotation.random(random_state=seed)
        poses = [
            pose(
                *(moved.apply(at[:3]) + np.array([0.3, -0.2, 0.1])),
                np.roll((moved * Rotation.from_quat(np.roll(at[3:], -1))).as_quat(), 1),
            )
            for at in (high, low)
        ]
        n = moved.apply(UP)
        depths.append(reference_depth(ball, poses[0], ridge, poses[1], n, **QUICK).depth)
    assert depths[0] > 0
    assert np.ptp(depths) < 1e-9


def shelves(as_mesh):
    """Return two shelves, whose tops lie at 0 and at 4 mm; the upper one is 1 mm thick."""
    if not as_mesh:
        low, high = (Geom("box", (3e-3, 3e-3, 5e-4), (0, 0, z)) for z in (-5e-4, 3.5e-3))
        return Body("shelves", [low, high], rough(9, 10e-6))
    parts = [box_mesh((3e-3, 3e-3, 5e-4), (0, 0, z)) for z in (-5e-4, 3.5e-3)]
    faces = np.concatenate([parts[0][1], parts[1][1] + 8])
    return meshed(np.concatenate([parts[0][0], parts[1][0]]), faces, rough(9, 10e-6))


@pytest.mark.parametrize("as_mesh", [True, False])
@pytest.mark.parametrize("tilt", [0.1, pytest.param(0.0, marks=pytest.mark.slow)])
def test_a_range_of_overlap_leaves_out_the_far_shelf(as_mesh, tilt):
    tool = meshed(*box_mesh((1e-3, 1e-3, 1e-3)))
    at = pose(0, 0, 1.05e-3, turn([0.5, 1, 0], tilt))
    lower = Body("lower", [Geom("box", (3e-3, 3e-3, 5e-4), (0, 0, -5e-4))], rough(9, 10e-6))
    alone = reference_depth(tool, at, lower, AT_REST, UP, **QUICK).depth
    everything = reference_depth(tool, at, shelves(as_mesh), AT_REST, UP, **QUICK).depth
    assert everything > 3.9e-3
    near = reference_depth(
        tool, at, shelves(as_mesh), AT_REST, UP, **QUICK, depth_range=(-1e-3, 1e-3)
    )
    assert near.depth == pytest.approx(alone, abs=1e-9)
    none = reference_depth(tool, at, lower, AT_REST, UP, **QUICK, depth_range=(1e-3, 2e-3))
    assert none.depth == -math.inf


def test_pairs_of_shelves_do_not_mix():
    """A fork with a tine over each shelf: the lower tine is under the upper shelf, too."""
    tines = [box_mesh((2e-3, 2e-3, 5e-4), (0, 0, z)) for z in (4.8e-4, 4.46e-3)]
    faces = np.concatenate([tines[0][1], tines[1][1] + 8])
    fork = meshed(np.concatenate([tines[0][0], tines[1][0]]), faces)
    smooth = Body("smooth", shelves(False).geoms)
    found = reference_depth(fork, AT_REST, smooth, AT_REST, UP, **QUICK, depth_range=(-1e-3, 1e-3))
    # 20 um at the lower shelf, 40 um at the upper one.
    assert found.depth == pytest.approx(4e-5, abs=1e-12)


def test_a_region_cuts_the_domain():
    tilt, half = 0.1, 2e-3
    tool = meshed(*box_mesh((half, half, half)))
    at = pose(1e-3, 2e-3, half, turn([0, 1, 0], tilt))
    frame = frame_along(UP)
    c, s = math.cos(tilt), math.sin(tilt)

    def bottom(x):
        """Height of the lower face over x of the world; the box turned about its middle."""
        return half - (half + s * (x - 1e-3)) / c

    # x of the world at most 1.4 mm; a slanted border, deepest at its end; all of it.
    for cut in ([1, 0, 0], [1, 0.4, 0], None):
        if cut is None:
            region, x = None, 1e-3 + half * c - half * s
        else:
            across = frame[:2] @ np.array(cut, dtype=float)
            region = [
                [*across, cut @ np.array([1.4e-3, 0.0, 0.0])],
                [*-(frame[:2] @ [0, 1, 0]), 0.0],
            ]
            # With y >= 0, x + 0.4 y <= 1.4 mm leaves x up to 1.4 mm, where y = 0.
            x = 1.4e-3
        found = reference_depth(tool, at, plate(half=2e-2), AT_REST, UP, **QUICK, region=region)
        assert found.depth == pytest.approx(-bottom(x), abs=1e-9)
        assert found.point_on_a[0] == pytest.approx(x, abs=1e-7)


def test_a_region_on_a_ripple_leaves_the_crests_inside():
    """The border is slanted; the deepest place is on a crest inside, or on the border."""
    ground = meshed(*box_mesh((4e-3, 4e-3, 1e-3), (0, 0, -1e-3)), ripple(A, L))
    inward = np.array([1.0, 0.3]) / math.hypot(1.0, 0.3)
    across = frame_along(UP)[:2, :2] @ inward
    for limit in (2e-4, -2.5e-4):
        region = [[*across, limit], [*-across, 3.5e-4 - limit]]
        found = reference_depth(
            solid("sphere"), pose(0, 0, 1.5e-3), ground, AT_REST, UP, **QUICK, region=region
        )
        u = np.linspace(limit - 3.5e-4, limit, 701)[:, None]
        v = np.linspace(-8e-4, 8e-4, 1601)
        x, y = u * inward[0] - v * inward[1], u * inward[1] + v * inward[0]
        gap = ground.texture.heights(x, 0.0) + np.sqrt(1.5e-3**2 - x * x - y * y) - 1.5e-3
        # Samples 1 um apart miss a maximum by 2 nm at most.
        assert 0.0 <= found.depth - gap.max() < 2e-9 + 1e-12


def test_limits_are_checked():
    tool, at = solid("sphere"), pose(0, 0, 1.4e-3)
    for wrong in ({"region": [[1, 2]]}, {"region": [[0, 0, 1]]}, {"depth_range": (1, 0)}):
        with pytest.raises(AsperityError, match=next(iter(wrong))):
            reference_depth(tool, at, plate(), AT_REST, UP, **wrong)
    found = reference_depth(tool, at, plate(), AT_REST, UP, region=[[1, 0, -1.0]])
    assert found.depth == -math.inf


def test_faces_that_look_away_take_no_part():
    found = reference_depth(
        solid("sphere"), pose(0, 0, 1.4e-3), meshed(*roof(0.1)[:2]), AT_REST, -UP, **QUICK
    )
    assert found.depth == -math.inf
