"""Low-resolution bodies of plates 5 and 6: closed, mapped true to size, in convex pieces."""

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from asperity.errors import AsperityError
from asperity.geometry.shapes.block import block
from asperity.geometry.shapes.shape import (
    cad_part,
    file_tool,
    hammer,
    read_shape,
    shipped_file,
    write_shape,
)
from asperity.scene.builtin.file_cad import BLADE_LENGTH, BLADE_THICKNESS, MACHINED, TEETH
from asperity.scene.builtin.file_cad import BOSS_TOP as SCENE_BOSS_TOP
from asperity.scene.builtin.hammer_blocks import BLOCKS, FACE_TIP, FORGED
from asperity.texture.patterns.patterns import PATTERNS
from tools.shapes import cad_part as part_generator
from tools.shapes import file_tool as file_generator
from tools.shapes import hammer as hammer_generator
from tools.shapes.__main__ import MAKERS
from tools.shapes.clip import clipped
from tools.shapes.patchwork import detail_triangles, triangle_areas
from tools.shapes.triangulate import triangulated

SHAPES = {
    "hammer": hammer(),
    "file": file_tool(),
    "part": cad_part(),
    "block": block(0.06, 0.04, 0.03),
    "small block": block(0.02, 0.01, 0.008, chamfer=5e-4),
}
PAPER = {"hammer": (518, 433_000), "file": (632, 286_000), "part": (720, 658_000)}
"""Triangles of each body, and of its full detail, in the paper."""
FLATS = {"hammer": 6, "file": 3, "part": 7, "block": 6, "small block": 6}
TEXTURES = {
    "hammer": (FORGED, None),
    "file": (TEETH, file_generator.CUT_FACES),
    "part": (MACHINED, None),
}

each = pytest.mark.parametrize("name", SHAPES)
each_of_paper = pytest.mark.parametrize("name", PAPER)


def corners_of(shape):
    return shape.vertices[shape.faces]


def facet_normals(shape):
    a, b, c = np.moveaxis(corners_of(shape), 1, 0)
    facets = np.cross(b - a, c - a)
    return facets / np.linalg.norm(facets, axis=1, keepdims=True)


def winding(shape, points):
    """Return how many times the surface goes round each point: the sum of its solid angles."""
    a, b, c = np.moveaxis(corners_of(shape)[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
    triple = np.einsum("pmi,pmi->pm", a, np.cross(b, c))
    dots = [np.einsum("pmi,pmi->pm", x, y) for x, y in ((a, b), (b, c), (c, a))]
    under = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return 2.0 * np.arctan2(triple, under).sum(axis=1) / (4.0 * math.pi)


def hulls_of(shape):
    # In centimetres: Qhull's tolerances are made for numbers near 1.
    return [ConvexHull(piece * 100.0) for piece in shape.pieces]


def outside_by(hulls, points):
    """Return how far [m] points (n, 3) lie beyond the nearest piece's worst plane; < 0 inside."""
    planes = [hull.equations for hull in hulls]
    far = [(points * 100.0 @ p[:, :3].T + p[:, 3]).max(axis=1) for p in planes]
    return np.min(far, axis=0) / 100.0


def make(texture):
    table = dict(texture)
    return PATTERNS[table.pop("kind")](**table)


@each_of_paper
def test_has_about_as_many_triangles_as_the_papers(name):
    assert len(SHAPES[name].faces) == pytest.approx(PAPER[name][0], rel=0.05)


@each
def test_is_closed_and_wound_outwards(name):
    shape = SHAPES[name]
    assert shape.faces.dtype == np.int64
    edges = np.concatenate([shape.faces[:, [i, (i + 1) % 3]] for i in range(3)]).tolist()
    once = set(map(tuple, edges))
    assert len(once) == len(edges)
    assert all((b, a) in once for a, b in once)
    assert np.unique(shape.faces).size == len(shape.vertices)
    a, b, c = np.moveaxis(corners_of(shape), 1, 0)
    assert np.einsum("mi,mi->", a, np.cross(b, c)) > 0.0
    assert triangle_areas(shape).min() > 1e-8  # 0.01 mm^2


@each
def test_normals_are_unit_and_within_reach_of_their_facets(name):
    shape = SHAPES[name]
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=2), 1.0, atol=1e-14)
    cosines = np.einsum("mci,mi->mc", shape.normals, facet_normals(shape))
    # A facet seen along n counts where f.n is 0.2 or more; leave room.
    assert cosines.min() > 0.45


@each
def test_flat_faces_have_one_normal_and_one_map(name):
    shape = SHAPES[name]
    facets, corners = facet_normals(shape), corners_of(shape)
    even = (shape.normals == shape.normals[:, :1]).all(axis=(1, 2))
    planes = {}
    for i in np.flatnonzero(even):
        normal = shape.normals[i, 0]
        np.testing.assert_allclose(normal, facets[i], atol=1e-9)
        planes.setdefault((normal.tobytes(), round(float(normal @ corners[i, 0]), 7)), []).append(i)
    assert len(planes) == FLATS[name]
    for faces in planes.values():
        normal, place = shape.normals[faces[0], 0], corners[faces[0], 0]
        level = np.abs((corners - place) @ normal).max(axis=1) < 1e-8
        assert np.flatnonzero(level & (facets @ normal > 0.999)).tolist() == faces
        points = corners[faces].reshape(-1, 3)
        known = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        uv = shape.uv[faces].reshape(-1, 2)
        affine = np.linalg.lstsq(known, uv, rcond=None)[0]
        np.testing.assert_allclose(known @ affine, uv, atol=1e-9)


@pytest.mark.parametrize("name", ["part", "block", "small block"])
def test_normals_are_smooth_everywhere(name):
    shape = SHAPES[name]
    for vertex in range(len(shape.vertices)):
        normals = shape.normals[shape.faces == vertex]
        np.testing.assert_array_equal(normals, np.broadcast_to(normals[0], normals.shape))


@each
def test_maps_are_true_to_size_and_not_mirrored(name):
    shape = SHAPES[name]
    corners, uv = corners_of(shape), shape.uv * np.array(shape.uv_size)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    right = first / np.linalg.norm(first, axis=1, keepdims=True)
    up = np.cross(facet_normals(shape), right)
    flat = np.stack(
        [np.einsum("mi,mi->m", e, axis) for axis in (right, up) for e in (first, second)]
    )
    sides = flat.T.reshape(-1, 2, 2)
    mapped = np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=2)
    maps = mapped @ np.linalg.inv(sides)
    areas = np.linalg.det(maps)
    assert areas.min() > 0.9
    assert areas.max() < 1.1
    stretch = np.linalg.svd(maps, compute_uv=False)
    assert stretch.min() > 0.88
    assert stretch.max() < 1.16


@each
def test_charts_do_not_overlap(name):
    shape = SHAPES[name]
    uv = shape.uv * np.array(shape.uv_size)
    rng = np.random.default_rng(3)
    places = rng.uniform(uv.min(axis=(0, 1)), uv.max(axis=(0, 1)), (4000, 2))
    a, ab, ac = uv[:, 0], uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    reach = places[:, None] - a
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    s = (reach[..., 0] * ac[:, 1] - reach[..., 1] * ac[:, 0]) / det
    t = (ab[:, 0] * reach[..., 1] - ab[:, 1] * reach[..., 0]) / det
    covered = ((s > 0) & (t > 0) & (s + t < 1)).sum(axis=1)
    assert covered.max() == 1


@each
def test_pieces_are_convex_solids_for_mujoco(name):
    shape = SHAPES[name]
    for piece, hull in zip(shape.pieces, hulls_of(shape), strict=True):
        heights = piece * 100.0 @ hull.equations[:, :3].T + hull.equations[:, 3]
        assert np.abs(heights.max(axis=1)).max() < 1e-7  # each corner lies on the hull
        assert hull.volume > 1e-3  # 1 mm^3
    meshes = "".join(
        f'<mesh name="m{i}" vertex="{" ".join(f"{x:.9g}" for x in piece.ravel())}"/>'
        for i, piece in enumerate(shape.pieces)
    )
    geoms = "".join(f'<geom type="mesh" mesh="m{i}"/>' for i in range(len(shape.pieces)))
    xml = f"<mujoco><asset>{meshes}</asset><worldbody><body><freejoint/>{geoms}</body></worldbody>"
    model = mujoco.MjModel.from_xml_string(xml + "</mujoco>")
    assert model.ngeom == len(shape.pieces)


@each
def test_pieces_make_up_the_shape(name):
    shape, hulls = SHAPES[name], hulls_of(SHAPES[name])
    assert outside_by(hulls, shape.vertices).max() < 1e-8
    rng = np.random.default_rng(2)
    within = [
        rng.dirichlet(np.full(len(piece), 0.3), 60) @ (0.999 * piece + 0.001 * piece.mean(axis=0))
        for piece in shape.pieces
    ]
    assert winding(shape, np.concatenate(within)).min() > 0.5
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    points = rng.uniform(low, high, (3000, 3))
    inside = winding(shape, points) > 0.5
    # What fits is far below the 0.1 mm that contact may bear.
    assert outside_by(hulls, points[inside]).max() < 1e-8
    assert outside_by(hulls, points[~inside]).min() > -1e-8


@pytest.mark.parametrize(
    ("x", "radius", "top"),
    [(-0.028, 0.004, 0.009), (0.028, 0.004, 0.009), (0.0, 0.008, 0.022)],
)
def test_holes_are_open_and_round(x, radius, top):
    shape = SHAPES["part"]
    angles, z = np.meshgrid(
        np.linspace(0.0, 2.0 * math.pi, 73), np.linspace(-0.001, top + 0.001, 40)
    )

    def cylinder(r):
        return np.stack([x + r * np.cos(angles), r * np.sin(angles), z], axis=-1).reshape(-1, 3)

    hulls = hulls_of(shape)
    for share in (0.0, 0.5, 0.9):
        assert outside_by(hulls, cylinder(share * radius)).min() > 0.0
    assert np.abs(winding(shape, cylinder(0.9 * radius))).max() < 1e-6
    away = np.hypot(shape.vertices[:, 0] - x, shape.vertices[:, 1])
    deep = (shape.vertices[:, 2] > 1e-4) & (shape.vertices[:, 2] < top - 1e-4)
    wall = shape.vertices[deep & (away < 1.05 * radius)]
    reach = np.hypot(wall[:, 0] - x, wall[:, 1])
    assert np.abs(reach - radius).max() < 1e-4
    corners = len(wall) // 2  # a ring above and one below
    assert reach.min() * math.cos(math.pi / corners) > radius - 1e-4  # the sides' middles


@each_of_paper
def test_the_texture_is_worth_the_papers_triangles(name):
    shape, (texture, faces) = SHAPES[name], TEXTURES[name]
    field = make(texture)
    assert detail_triangles(shape, field.pixel_size, faces) == pytest.approx(
        PAPER[name][1], rel=0.1
    )
    np.testing.assert_allclose(shape.uv_size, field.size, rtol=1e-9)
    assert 2e-5 < field.relief < 4e-4


@pytest.mark.parametrize("made", BLOCKS)
def test_the_stripes_fit_their_blocks(made):
    field = make(made.texture)
    np.testing.assert_allclose(made.uv_size, field.size, rtol=1e-9)
    assert field.relief == pytest.approx(3e-4, rel=0.01)
    shape = block(*made.size, uv_size=made.uv_size)
    assert len(shape.faces) == 44
    np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), made.size, rtol=1e-12)


def test_the_hammers_size():
    shape = SHAPES["hammer"]
    np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), (0.098, 0.026, 0.300), atol=1e-3)


def test_the_files_belly():
    shape = SHAPES["file"]
    middle = shape.vertices[(np.abs(shape.vertices[:, 1]) < 1e-9) & (shape.vertices[:, 0] >= 0.0)]
    upper = middle[middle[:, 2] > 1e-3]
    highest = upper[:, 2].max()
    assert highest == pytest.approx(0.002, abs=1e-6)
    heel = upper[upper[:, 0] == 0.0, 2]
    assert highest - heel[0] == pytest.approx(1.5e-4, abs=1e-6)


def test_the_cut_faces_come_first_and_run_along_the_file():
    shape = SHAPES["file"]
    corners, uv = corners_of(shape)[file_generator.CUT_FACES], shape.uv[file_generator.CUT_FACES]
    assert corners[..., 0].min() >= 0.0
    along = (corners[:, 1:, 0] - corners[:, :1, 0]) / shape.uv_size[0]
    np.testing.assert_allclose(uv[:, 1:, 0] - uv[:, :1, 0], along, atol=1e-9)


def test_another_tile_keeps_the_scale():
    shape, other = SHAPES["block"], block(0.06, 0.04, 0.03, uv_size=(0.01, 0.03))
    np.testing.assert_allclose(
        other.uv * np.array(other.uv_size), shape.uv * np.array(shape.uv_size), rtol=1e-12
    )


def corners_by_face(shape):
    """Return normals and texture coordinates of each face, from its least vertex on."""
    found = {}
    for face, normals, uv in zip(shape.faces, shape.normals, shape.uv, strict=True):
        turn = -int(np.argmin(face))
        rows = [np.roll(values, turn, axis=0) for values in (face, normals, uv)]
        found[tuple(rows[0].tolist())] = rows[1:]
    return found


@pytest.mark.parametrize("name", MAKERS)
def test_the_generator_reproduces_the_shipped_files(name):
    made, shipped = MAKERS[name](), read_shape(shipped_file(name))
    assert shipped_file(name).stat().st_size < 100_000
    assert len(made.pieces) == len(shipped.pieces)
    # Triangulations and hulls come from Qhull, linear algebra from LAPACK: to rounding. Which
    # diagonal cuts four points of a circle, and the order of the faces, depend on the machine.
    for one, other in zip(
        [made.vertices, made.uv_size, *made.pieces],
        [shipped.vertices, shipped.uv_size, *shipped.pieces],
        strict=True,
    ):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-13)
    mine, theirs = corners_by_face(made), corners_by_face(shipped)
    both = mine.keys() & theirs.keys()
    assert len(mine) == len(theirs)
    assert len(both) > 0.97 * len(theirs)
    for face in both:
        for one, other in zip(mine[face], theirs[face], strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12)


def test_a_shape_is_read_as_it_was_written(tmp_path):
    shape = SHAPES["block"]
    write_shape(tmp_path / "block.npz", shape)
    again = read_shape(tmp_path / "block.npz")
    for one, other in zip(shape[:4], again[:4], strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(shape.pieces[0], again.pieces[0])
    assert again.uv_size == shape.uv_size


def test_the_scenes_know_the_sizes_of_the_shipped_meshes():
    assert SCENE_BOSS_TOP == SHAPES["part"].vertices[:, 2].max() == part_generator.BOSS_TOP
    assert BLADE_LENGTH == SHAPES["file"].vertices[:, 0].max() == file_generator.LENGTH
    assert BLADE_THICKNESS == file_generator.THICKNESS
    tip = SHAPES["hammer"].vertices[:, 0].max()
    assert FACE_TIP == tip == hammer_generator.FACE_TIP


def test_a_block_without_room_for_its_chamfers_is_refused():
    with pytest.raises(AsperityError, match=r"chamfer must be above 0 and below 0\.004 m"):
        block(0.02, 0.01, 0.008, chamfer=0.004)


def test_a_face_with_a_hole_that_delaunay_cannot_keep_is_refused():
    outline = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    slot = np.array([(-0.9, -0.01), (0.9, -0.01), (0.9, 0.01), (-0.9, 0.01)])
    near = np.array([(-0.05, 0.05), (0.05, 0.05), (0.05, 0.15), (-0.05, 0.15)])
    with pytest.raises(AsperityError, match="its outline must be convex, holes round"):
        triangulated([outline, slot, near])


def test_clipping_a_cube():
    cube = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    left = clipped(cube, [(np.ones(3), 1.0)])
    assert sorted(map(tuple, left.round(12))) == [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)]
