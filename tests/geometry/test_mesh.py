"""Meshes from arrays: what is refused, what is put right, and which corners share a normal."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from asperity.errors import AsperityError
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays

CUBE = 0.02 * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
CUBE_FACES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
])  # fmt: skip
SQUARE = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]])


def split(vertices, faces):
    """Return the same surface as STL has it: each triangle with vertices of its own."""
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def grid(n=8, height=lambda x, y: 0.0 * x, size=0.05):
    """Return a sheet of 2 n^2 triangles over a square."""
    x, y = np.meshgrid(np.linspace(0, size, n + 1), np.linspace(0, size, n + 1))
    vertices = np.stack([x, y, height(x, y)], axis=2).reshape(-1, 3)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    lower = np.stack([i, i + 1, i + n + 2], axis=1)
    upper = np.stack([i, i + n + 2, i + n + 1], axis=1)
    return vertices, np.concatenate([lower, upper])


def ball(n=2, radius=0.01):
    trimesh = pytest.importorskip("trimesh")
    sphere = trimesh.creation.icosphere(subdivisions=n, radius=radius)
    return np.array(sphere.vertices), np.array(sphere.faces)


def noted(mesh, text):
    return any(text in note for note in mesh.notes)


def volume(mesh):
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def facets(mesh):
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    product = np.cross(b - a, c - a)
    return product / np.linalg.norm(product, axis=1)[:, None]


# What is refused


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vertices": []}, "no vertices"),
        ({"faces": []}, "no faces"),
        ({"vertices": SQUARE[:, :2]}, r"\(4, 2\); valid: \(n, 3\)"),
        ({"vertices": "many"}, "real numbers"),
        ({"vertices": [[0, 0, 0], [1, 0]]}, "equal length"),
        ({"vertices": SQUARE * 1j}, "complex128"),
        ({"faces": [[0, 1, 2, 3]]}, r"\(1, 4\); valid: \(m, 3\)"),
        ({"faces": [[0.0, 1.0, 2.0]]}, "float64.*whole numbers"),
        ({"faces": [[True, False, True]]}, "bool"),
        ({"faces": [[0, 1, 2], [0, 1, 4]]}, "face 1 names vertex 4; valid: 0 to 3"),
        ({"faces": [[0, -1, 2]]}, "face 0 names vertex -1; valid: 0 to 3"),
        ({"faces": np.array([[0, 1, 2**64 - 1]], dtype=np.uint64)}, "a face names vertex 18446744"),
        ({"vertices": np.where(SQUARE > 0, np.nan, 0)}, r"vertices\[1\] is nan.* 4 values"),
        ({"vertices": np.where(SQUARE > 0, np.inf, 0)}, r"vertices\[1\] is inf"),
        ({"faces": [[0, 1, 1], [2, 2, 2]]}, "none of its 2 triangles has an area"),
        ({"vertices": np.zeros((4, 3))}, "all its vertices are at one place"),
        ({"vertices": SQUARE * [1, 0, 0]}, "none of its 2 triangles"),
        ({"vertices": SQUARE * 1e4}, "100 x 100 x 0 m; valid: 0.1 mm to 2 m.*in mm"),
        ({"vertices": SQUARE * 1e-4}, "valid: 0.1 mm to 2 m"),
        ({"vertices": SQUARE * 1e306}, "valid: 0.1 mm to 2 m"),
        ({"uv": np.zeros((3, 2))}, r"uv have shape \(3, 2\); valid: \(2, 3, 2\).*\(4, 2\)"),
        ({"uv": np.full((4, 2), np.nan)}, "uv.* is nan"),
        ({"uv": np.full((4, 2), 1e9)}, "uv reach 1e"),
        ({"normals": np.zeros((4, 2))}, "normals have shape"),
        ({"normals": np.full((2, 3, 3), np.inf)}, r"normals\[\(0, 0\)\] is inf"),
        ({"hard_angle": 200}, "hard_angle must lie between 0 and 180 degrees"),
        ({"hard_angle": "sharp"}, "hard_angle"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_line(change, said):
    with pytest.raises(AsperityError, match=said) as caught:
        mesh_from_arrays(**{"vertices": SQUARE, "faces": SQUARE_FACES} | change)
    assert "\n" not in str(caught.value)


# What is put right


def test_a_good_mesh_has_no_notes_and_arrays_that_stay():
    mesh = mesh_from_arrays(CUBE, CUBE_FACES, name="cube")
    assert mesh.notes == ()
    assert mesh.name == "cube"
    assert np.array_equal(mesh.faces, CUBE_FACES)
    assert mesh.faces.dtype == np.int64
    assert volume(mesh) == pytest.approx(0.02**3)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1


def test_triangles_without_area_or_there_twice_are_dropped():
    faces = np.concatenate([CUBE_FACES, [[0, 0, 1]], CUBE_FACES[[3]], CUBE_FACES[[5]][:, ::-1]])
    vertices = np.concatenate([CUBE, [[0.5, 0.5, 0.5]]])
    uv = np.arange(6.0 * len(faces)).reshape(-1, 3, 2)
    mesh = mesh_from_arrays(vertices, faces, uv=uv)
    assert np.array_equal(mesh.faces, CUBE_FACES)
    assert np.array_equal(mesh.uv, uv[:12])
    assert len(mesh.vertices) == 8
    assert noted(mesh, "1 triangle without area dropped")
    assert noted(mesh, "2 triangles dropped: the same three corners")
    assert noted(mesh, "1 vertex dropped")


@pytest.mark.parametrize("as_stl", [False, True])
@pytest.mark.parametrize("turned", [[0], [1, 5, 7], list(range(12)), list(range(9))])
def test_winding_is_made_to_face_outwards(turned, as_stl):
    faces = CUBE_FACES.copy()
    faces[turned] = faces[turned][:, ::-1]
    uv = np.random.default_rng(0).random((12, 3, 2))
    arrays_ = split(CUBE, faces) if as_stl else (CUBE, faces)
    mesh = mesh_from_arrays(*arrays_, uv=uv)
    assert volume(mesh) == pytest.approx(0.02**3)
    assert noted(mesh, "turned round")
    at = mesh.vertices[mesh.faces]
    for k, (corners, coordinates) in enumerate(zip(at, mesh.uv, strict=True)):
        for place, where in zip(corners, coordinates, strict=True):
            old = np.flatnonzero((CUBE[faces[k]] == place).all(axis=1))[0]
            assert np.array_equal(where, uv[k, old])
    assert np.array_equal(mesh.normals, np.repeat(facets(mesh)[:, None], 3, axis=1))
    outwards = np.sign(at - 0.01) / np.sqrt(3)
    smooth = mesh_from_arrays(*arrays_, uv=uv, hard_angle=180)
    assert smooth.normals == pytest.approx(outwards, abs=1e-12)


def test_a_cavity_keeps_facing_inwards():
    inner = 0.005 + 0.5 * CUBE
    vertices = np.concatenate([CUBE, inner])
    hollow = np.concatenate([CUBE_FACES, 8 + CUBE_FACES[:, ::-1]])
    mesh = mesh_from_arrays(vertices, hollow)
    assert mesh.notes == ()
    assert volume(mesh) == pytest.approx(0.02**3 * 7 / 8)
    mesh = mesh_from_arrays(vertices, hollow[:, ::-1])
    assert noted(mesh, "inside out")
    assert volume(mesh) == pytest.approx(0.02**3 * 7 / 8)
    beside = np.concatenate([CUBE, 2 * inner + 0.1])
    mesh = mesh_from_arrays(beside, hollow)
    assert noted(mesh, "inside out (negative volume): turned round, 12 of 24 triangles")
    assert volume(mesh) == pytest.approx(2 * 0.02**3)


def test_what_cannot_be_put_right_is_noted():
    assert noted(mesh_from_arrays(SQUARE, SQUARE_FACES), "it is open: 4 border edges")
    fin = np.concatenate([SQUARE, [[0, 0, 0.01]]])
    mesh = mesh_from_arrays(fin, [[0, 1, 2], [0, 2, 3], [0, 2, 4]])
    assert noted(mesh, "1 edge shared by more than two triangles")
    n = 12
    t, side = np.meshgrid(np.arange(n) * 2 * np.pi / n, [-1, 1], indexing="ij")
    across = 1 + 0.3 * side * np.cos(t / 2)
    strip = np.stack([across * np.cos(t), across * np.sin(t), 0.3 * side * np.sin(t / 2)], axis=2)
    i = np.arange(n - 1)[:, None]
    faces = np.concatenate([2 * i + [0, 2, 1], 2 * i + [1, 2, 3], [[2 * n - 2, 1, 2 * n - 1]]])
    faces = np.concatenate([faces, [[2 * n - 1, 1, 0]]])
    assert noted(mesh_from_arrays(0.1 * strip.reshape(-1, 3), faces), "Moebius")


def test_a_surface_that_runs_through_itself_is_noted():
    vertices, faces = ball()
    two = np.concatenate([faces, faces + len(vertices)])
    apart = np.concatenate([vertices, vertices + np.array([0.021, 0, 0])])
    assert mesh_from_arrays(apart, two).notes == ()
    across = np.concatenate([vertices, vertices + np.array([0.015, 0.001, 0])])
    assert noted(mesh_from_arrays(across, two), "runs through itself")
    # A needle through the middle of one large triangle.
    pierced = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.2, 0.21, -1], [0.2, 0.2, 1]]
    mesh = mesh_from_arrays(0.1 * np.array(pierced), [[0, 1, 2], [3, 4, 5]])
    assert noted(mesh, "2 triangles cross")
    beside = 0.1 * np.array(pierced) + 0.1 * np.array([[0, 0, 0]] * 3 + [[0.7, 0, 0]] * 3)
    assert not noted(mesh_from_arrays(beside, [[0, 1, 2], [3, 4, 5]]), "cross")


def test_touching_is_no_crossing_and_large_meshes_are_not_searched():
    stacked = np.concatenate([CUBE, 0.5 * CUBE + [0.005, 0.005, 0.02]])
    mesh = mesh_from_arrays(stacked, np.concatenate([CUBE_FACES, CUBE_FACES + 8]))
    assert mesh.notes == ()
    assert noted(mesh_from_arrays(*grid(101)), "not looked for")


# Normals


@pytest.mark.parametrize("as_stl", [False, True])
def test_all_corners_at_a_place_share_one_normal(as_stl):
    vertices, faces = ball()
    mesh = mesh_from_arrays(*(split(vertices, faces) if as_stl else (vertices, faces)))
    assert mesh.normals == pytest.approx(mesh.vertices[mesh.faces] / 0.01, abs=0.01)
    seen = {}
    corners = zip(
        mesh.vertices[mesh.faces].reshape(-1, 3), mesh.normals.reshape(-1, 3), strict=True
    )
    for place, normal in corners:
        seen.setdefault(tuple(place), set()).add(tuple(normal))
    assert all(len(normals) == 1 for normals in seen.values())


def test_normals_do_not_depend_on_how_a_face_is_split():
    """Weighted by angle: at a cube's corner the diagonals of its sides do not matter."""
    other = CUBE_FACES.copy()
    other[0], other[1] = [0, 1, 2], [1, 3, 2]
    for faces in (CUBE_FACES, other):
        mesh = mesh_from_arrays(CUBE, faces, hard_angle=180)
        outwards = np.sign(mesh.vertices[mesh.faces] - 0.01) / np.sqrt(3)
        assert mesh.normals == pytest.approx(outwards, abs=1e-14)


@pytest.mark.parametrize("axis", [[0, 0, 1], [1, 2, 3], [-0.3, 0.7, 0.1]])
def test_normals_in_a_plane_are_exactly_equal(axis):
    from scipy.spatial.transform import Rotation

    turn, _ = Rotation.align_vectors([axis], [[0, 0, 1]])
    vertices, faces = grid()
    rng = np.random.default_rng(1)
    vertices[:, :2] += 1e-3 * rng.random((len(vertices), 2))
    mesh = mesh_from_arrays(turn.apply(vertices), faces)
    assert len(np.unique(mesh.normals.reshape(-1, 3), axis=0)) == 1
    assert mesh.normals[0, 0] == pytest.approx(np.array(axis) / np.linalg.norm(axis), abs=1e-12)
    assert noted(mesh_from_arrays(vertices.astype(np.float32), faces), "open")
    single = mesh_from_arrays(turn.apply(vertices).astype(np.float32), faces)
    assert len(np.unique(single.normals.reshape(-1, 3), axis=0)) == 1


def test_a_sliver_does_not_spoil_the_normals_round_it():
    """It has half a turn of angle at its middle corner, and a normal made of rounding."""
    middle = [0.005, 0.005 + 1e-10, 3e-10]
    vertices = np.concatenate([SQUARE, [middle]])
    mesh = mesh_from_arrays(vertices, [[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]])
    assert mesh.normals == pytest.approx(np.broadcast_to([0, 0, 1.0], mesh.normals.shape), abs=1e-6)


def test_hard_edges_part_the_normals_of_a_cube():
    hard = mesh_from_arrays(CUBE, CUBE_FACES, hard_angle=30)
    assert np.array_equal(hard.normals, np.repeat(facets(hard)[:, None], 3, axis=1))
    assert noted(hard, "the displaced surface opens at 12 hard edges")
    assert np.array_equal(mesh_from_arrays(CUBE, CUBE_FACES).normals, hard.normals)
    for angle in (95, 180):
        soft = mesh_from_arrays(CUBE, CUBE_FACES, hard_angle=angle)
        assert soft.notes == ()
        assert abs(soft.normals) == pytest.approx(np.full((12, 3, 3), 3**-0.5))


def turned(vertices):
    """Return vertices turned about all axes, as float32 files have them."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).apply(vertices).astype(np.float32)


def cells(n, half, height=0.0):
    """Return a square of n x n cells of two triangles, facing up."""
    vertices, faces = grid(n, lambda x, y: height + 0.0 * x, 2 * half)
    return vertices - [half, half, 0], faces


def chamfered(n, angle, half=0.01, width=0.001):
    """Return an open slab of n x n cells with a chamfer that turns by `angle` degrees, and sides.

    The strips of the chamfer and of the sides have as many cells along the rim as the top.
    """
    vertices, faces = [cells(n, half)[0]], [cells(n, half)[1]]
    line = np.linspace(-1, 1, n + 1)
    drop = width * np.tan(np.radians(angle))
    rims = [(half, 0.0), (half + width, -drop), (half + width, -drop - 0.004)]
    for quarter in range(4):
        c, s = np.cos(quarter * np.pi / 2), np.sin(quarter * np.pi / 2)
        for (out, z), (below, lower) in itertools.pairwise(rims):
            upper = np.stack([np.full(n + 1, out), out * line, np.full(n + 1, z)], axis=1)
            under = np.stack([np.full(n + 1, below), below * line, np.full(n + 1, lower)], axis=1)
            points = np.concatenate([upper, under]) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
            i, start = np.arange(n), sum(map(len, vertices))
            vertices.append(points)
            a, b, low = i, i + 1, i + n + 1
            strip = np.concatenate(
                [np.stack([a, low, low + 1], axis=1), np.stack([a, low + 1, b], axis=1)]
            )
            faces.append(start + strip)
    return np.concatenate(vertices), np.concatenate(faces)


def top_normals(mesh, up):
    """Return the corner normals of the triangles that face up."""
    return mesh.normals[facets(mesh) @ up > 1 - 1e-4]


@pytest.mark.parametrize("angle", [44.5, 45, 45.5])
def test_flat_faces_with_sharp_edges_are_flat_however_they_are_meshed(angle):
    """A chamfer of 45 degrees, and all that turns more, is sharp without any option."""
    for n in (1, 2, 5, 16):
        vertices, faces = chamfered(n, angle)
        for turn in (lambda v: v, turned):
            mesh = mesh_from_arrays(turn(vertices), faces)
            flat = np.repeat(facets(mesh)[:, None], 3, axis=1)
            assert np.abs(mesh.normals - flat).max() < 2e-5
            assert not noted(mesh, "hard edge")


@pytest.mark.parametrize("angle", [10, 30])
def test_a_small_soft_rim_does_not_tilt_the_flat_face_it_surrounds(angle):
    """Neither for a slab of two triangles nor for one of 512: the rim takes the face's normal."""
    up = np.array([0.0, 0.0, 1.0])
    for n in (1, 2, 5, 16):
        vertices, faces = chamfered(n, angle)
        mesh = mesh_from_arrays(vertices, faces)
        assert np.array_equal(top_normals(mesh, up), np.broadcast_to(up, (2 * n * n, 3, 3)))
        mesh = mesh_from_arrays(turned(vertices), faces)
        up_turned = turned(up[None])[0].astype(float)
        assert np.abs(top_normals(mesh, up_turned) - up_turned).max() < 2e-5
        # And the rim is soft: the chamfer begins with the normal of the top.
        chamfer = np.abs(facets(mesh) @ up_turned - np.cos(np.radians(angle))) < 1e-3
        begins = (np.abs(mesh.normals[chamfer] - up_turned).max(axis=2) < 2e-5).sum()
        assert begins == 3 * 4 * n


@pytest.mark.parametrize("sides", [3, 4, 5, 6, 8])
def test_a_prism_is_sharp_and_a_round_solid_smooth(sides):
    trimesh = pytest.importorskip("trimesh")
    prism = trimesh.creation.cylinder(radius=0.01, height=0.02, sections=sides)
    mesh = mesh_from_arrays(turned(prism.vertices), prism.faces)
    assert np.abs(mesh.normals - facets(mesh)[:, None]).max() < 1e-5
    cylinder = trimesh.creation.cylinder(radius=0.01, height=0.02, sections=3 * sides)
    mesh = mesh_from_arrays(cylinder.vertices, cylinder.faces)
    side = np.abs(facets(mesh)[:, 2]) < 0.5
    outwards = mesh.vertices[mesh.faces][side] * [100, 100, 0]
    assert mesh.normals[side] == pytest.approx(outwards, abs=1e-9)


@pytest.mark.parametrize("n", [0, 1, 2])
def test_a_sphere_of_few_triangles_is_smooth(n):
    """Down to an icosahedron of 20, whose edges turn by 41.8 degrees."""
    vertices, faces = ball(n)
    mesh = mesh_from_arrays(vertices, faces)
    assert mesh.normals == pytest.approx(vertices[faces] / 0.01, abs=0.01)


def test_smoothing_goes_round_a_place_fan_by_fan():
    """A crease that ends inside a surface parts nothing at its end, though its edge is hard."""
    n = 8
    vertices, faces = grid(n, lambda x, y: 0.6 * abs(x - 0.025) * np.clip(1 - y / 0.03, 0, 1))
    mesh = mesh_from_arrays(vertices, faces, hard_angle=40)
    assert noted(mesh, "hard edge")
    corners = np.round(mesh.vertices[mesh.faces].reshape(-1, 3), 9)
    normals = mesh.normals.reshape(-1, 3)

    def directions(x, y):
        here = np.isclose(corners[:, :2], [x, y], atol=1e-8).all(axis=1)
        return len(np.unique(np.round(normals[here], 9), axis=0))

    assert directions(0.025, 0.0) == 2
    assert directions(0.025, 0.00625) == 2
    assert directions(0.025, 0.0375) == 1
    hard = [directions(0.025, y) for y in np.linspace(0, 0.05, n + 1)]
    # Hard from the border to some place, soft from there on.
    assert hard == sorted(hard, reverse=True)


def test_closed_solids_that_touch_in_a_corner_keep_to_themselves():
    vertices = np.concatenate([CUBE, CUBE + 0.02])
    mesh = mesh_from_arrays(vertices, np.concatenate([CUBE_FACES, CUBE_FACES + 8]), hard_angle=180)
    centre = np.repeat([0.01, 0.03], 12)[:, None, None]
    outwards = np.sign(mesh.vertices[mesh.faces] - centre) / np.sqrt(3)
    assert mesh.normals == pytest.approx(outwards, abs=1e-12)


def test_cracks_and_seams_do_not_tear():
    """Four triangles round a place that share no vertices and two of them no edge."""
    vertices = 0.01 * np.array([
        [0, 0, 0], [1, 0, 0], [0.5, 0.5, 0.2], [0, 1, 0], [1, 1, 0], [0, 0.9, 0.01],
    ])  # fmt: skip
    mesh = mesh_from_arrays(
        *split(vertices, np.array([[0, 1, 2], [1, 4, 2], [4, 3, 2], [5, 0, 2]])), hard_angle=180
    )
    at_top = mesh.vertices[mesh.faces][:, 2, 2] == 0.002
    assert at_top.all()
    assert len(np.unique(mesh.normals[:, 2], axis=0)) == 1


def test_given_normals_carry_the_displacement():
    vertices, faces = ball()
    rng = np.random.default_rng(2)
    given_ = vertices / 0.01 + 0.05 * rng.normal(size=vertices.shape)
    unit = given_ / np.linalg.norm(given_, axis=1)[:, None]
    for normals in (given_, 1e-200 * given_, -given_, given_[faces]):
        mesh = mesh_from_arrays(vertices, faces, normals=normals)
        assert mesh.normals == pytest.approx(unit[faces], abs=1e-12)
    assert noted(mesh_from_arrays(vertices, faces, normals=-given_), "pointed inwards")
    given_[5] = 0
    assert noted(mesh_from_arrays(vertices, faces, normals=given_), "of no length")
    flat = np.repeat(facets(mesh)[:, None], 3, axis=1)
    mesh = mesh_from_arrays(vertices, faces, normals=flat)
    assert np.array_equal(mesh.normals, flat)
    assert noted(mesh, "given normals differ across 100 % of the edges")
    smooth = mesh_from_arrays(vertices, faces, normals=flat, hard_angle=180)
    assert np.array_equal(smooth.normals, mesh_from_arrays(vertices, faces).normals)


# Texture coordinates


def square(uv, **more):
    return mesh_from_arrays(SQUARE, SQUARE_FACES, uv=np.array(uv, dtype=float), **more)


def test_good_texture_coordinates_are_kept_as_they_are():
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    mesh = square(uv)
    assert np.array_equal(mesh.uv, np.array(uv)[SQUARE_FACES])
    assert mesh.notes == ("it is open: 4 border edges",)


@pytest.mark.parametrize(
    ("uv", "said"),
    [
        ([[1, 0], [0, 0], [0, 1], [1, 1]], "mirrored on 100 % of the area, in 1 of 1 charts"),
        ([[0, 0], [1, 0], [1, 1], [1, 1]], "of 1 triangle have no area: smooth there, 50 %"),
        ([[0.5, 0.5]] * 4, "of 2 triangles have no area: smooth there, 100 %"),
        ([[0, 0], [2, 0], [2, 1], [0, 1]], "leave 0..1 on 100 % of the area"),
        ([[0, 0], [2, 0], [2, 1], [0, 1]], "100 % of the texture that is used is used more"),
        ([[0, 0], [1, 0], [1, 1], [0.99, 0.01]], "mirrored on 50 % of the area"),
        ([[0, 0], [1e6, 0], [1e6, 1e6], [0, 1e6]], "leave 0..1"),
    ],
)
def test_odd_texture_coordinates_are_noted(uv, said):
    mesh = square(uv)
    assert noted(mesh, said), mesh.notes
    assert np.array_equal(mesh.uv, np.array(uv, dtype=float)[SQUARE_FACES])


def test_the_share_of_overlapping_charts_is_that_of_the_areas():
    vertices = np.concatenate([SQUARE, SQUARE + np.array([0.02, 0, 0])])
    faces = np.concatenate([SQUARE_FACES, SQUARE_FACES + 4])
    one = 0.5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    for shift in (0.0, 0.1, 0.25, 0.5):
        mesh = mesh_from_arrays(
            vertices, faces, uv=np.concatenate([one, one + np.array([shift, 0])])
        )
        expected = 100 * (0.5 - shift) / (0.5 + shift)
        if expected == 0:
            assert not noted(mesh, "more than once")
        else:
            (note,) = (n for n in mesh.notes if "more than once" in n)
            assert float(note.split()[0]) == pytest.approx(expected, rel=0.02)


# Anything at all


def mesh_or_line(make, *arguments, **options):
    """Return the mesh that is made; None if it is refused, in one line."""
    try:
        return make(*arguments, **options)
    except AsperityError as error:
        if "\n" in str(error):
            raise
        return None


def check(mesh):
    assert isinstance(mesh, Mesh)
    m = len(mesh.faces)
    assert m >= 1
    assert mesh.normals.shape == (m, 3, 3)
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    assert np.linalg.norm(mesh.normals, axis=2) == pytest.approx(np.ones((m, 3)), abs=1e-9)
    assert mesh.uv is None or (mesh.uv.shape == (m, 3, 2) and np.isfinite(mesh.uv).all())
    assert all("\n" not in note for note in mesh.notes)
    again = mesh_from_arrays(mesh.vertices, mesh.faces, uv=mesh.uv, normals=mesh.normals)
    assert len(again.faces) == m


coarse = st.integers(-3, 3).map(lambda i: 0.01 * i)
any_length = st.one_of(coarse, st.floats(-1, 1), st.floats(allow_nan=False), st.just(1e-12))


@settings(max_examples=200, deadline=None)
@given(
    data=st.data(),
    n=st.integers(1, 9),
    m=st.integers(1, 14),
    hard=st.sampled_from([None, 0, 30, 90, 180]),
)
def test_any_arrays_give_a_mesh_or_one_line(data, n, m, hard):
    """Mostly on a coarse lattice: there triangles coincide, cross, fold back and cancel."""
    lengths = data.draw(st.sampled_from([coarse, coarse, any_length]))
    vertices = data.draw(arrays.arrays(float, (n, 3), elements=lengths))
    faces = data.draw(arrays.arrays(np.int64, (m, 3), elements=st.integers(0, n - 1)))
    some = st.one_of(st.none(), arrays.arrays(float, (n, 3), elements=any_length))
    uv, normals = data.draw(some), data.draw(some)
    with np.errstate(over="ignore", invalid="raise", divide="raise"):
        mesh = mesh_or_line(
            mesh_from_arrays, vertices, faces, uv=None if uv is None else uv[:, :2],
            normals=normals, hard_angle=hard,
        )  # fmt: skip
    if mesh is not None:
        check(mesh)
