"""Convex pieces: they hold the mesh, leave its holes, are kept on disk, and MuJoCo takes them."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from test_mesh import CUBE, CUBE_FACES, SQUARE, SQUARE_FACES, split

from asperity._core.kept_arrays import kept_folder
from asperity.errors import AsperityError
from asperity.geometry.convex import pieces as module
from asperity.geometry.convex.pieces import convex_pieces, piece_error
from asperity.geometry.mesh.files import read_mesh
from asperity.geometry.mesh.mesh import mesh_from_arrays

trimesh = pytest.importorskip("trimesh")


@pytest.fixture(scope="module", autouse=True)
def kept(tmp_path_factory):
    """Keep nothing from one run of these tests to the next; return the folder."""
    folder = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "kept_folder", lambda kind: folder / kind)
        yield folder


def compiled(solids):
    """Return what MuJoCo makes of solids; an inertia of its own, as a sheet of dust has none."""
    meshes = geoms = ""
    for i, solid in enumerate(solids):
        numbers = " ".join(map(repr, solid.ravel().tolist()))
        meshes += f'<mesh name="m{i}" inertia="shell" vertex="{numbers}"/>'
        geoms += f'<geom type="mesh" mesh="m{i}"/>'
    inertial = '<inertial pos="0 0 0" mass="0.1" diaginertia="1e-5 1e-5 1e-5"/><freejoint/>'
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{meshes}</asset><worldbody><body>{inertial}{geoms}</body></worldbody>"
        "</mujoco>"
    )


def check(mesh, solids):
    model = compiled(solids)
    assert model.ngeom == len(solids)
    assert all(solid.shape[1] == 3 and len(solid) >= 4 for solid in solids)
    size = np.ptp(mesh.vertices, axis=0).max()
    assert piece_error(mesh, solids) < 0.01 * size


def inside(point, solids):
    hulls = [ConvexHull(solid) for solid in solids]
    return any((h.equations @ np.append(point, 1.0)).max() <= 0 for h in hulls)


def of(solid):
    return mesh_from_arrays(solid.vertices, solid.faces)


def washer():
    return of(trimesh.creation.annulus(r_min=0.01, r_max=0.02, height=0.005, sections=16))


@pytest.fixture
def no_coacd(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "coacd", None)


# One piece


@pytest.mark.parametrize("as_stl", [False, True])
def test_a_convex_mesh_is_its_own_hull(no_coacd, as_stl):
    mesh = mesh_from_arrays(*(split(CUBE, CUBE_FACES) if as_stl else (CUBE, CUBE_FACES)))
    (solid,) = convex_pieces(mesh)
    assert sorted(map(tuple, solid)) == sorted(map(tuple, CUBE))
    assert piece_error(mesh, (solid,)) == 0
    check(mesh, (solid,))


def test_round_convex_meshes_of_single_precision_are_one_piece(no_coacd):
    creation = trimesh.creation
    for solid in (
        creation.icosphere(subdivisions=4, radius=0.03),
        creation.cylinder(radius=0.01, height=0.1, sections=200),
        creation.capsule(radius=0.01, height=0.1),
        creation.cone(radius=0.01, height=0.1),
    ):
        solid.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
        mesh = mesh_from_arrays(solid.vertices.astype(np.float32), solid.faces)
        solids = convex_pieces(mesh)
        assert len(solids) == 1
        check(mesh, solids)
        assert piece_error(mesh, solids) < 1e-8


def test_the_reach_beyond_a_piece_is_that_of_the_farthest_corner():
    """A cube of 3,072 triangles round one that is smaller by 0.2 mm: sqrt(3) times that."""
    cube = trimesh.creation.box((0.02, 0.02, 0.02))
    for _ in range(4):
        cube = cube.subdivide()
    mesh = mesh_from_arrays(1.02 * cube.vertices, cube.faces)
    assert piece_error(mesh, (cube.vertices,)) == pytest.approx(2e-4 * 3**0.5, rel=1e-6)


def test_an_error_is_measured_once_and_anew_when_its_file_is_damaged(kept, monkeypatch):
    cube = trimesh.creation.box((0.01, 0.02, 0.03))
    mesh, measured, measure = of(cube), [], module._largest_error
    monkeypatch.setattr(
        module, "_largest_error", lambda *given: measured.append(0) or measure(*given)
    )
    pieces = (0.9 * cube.vertices,)
    before = {*kept.glob("*/error-*")}
    first = piece_error(mesh, pieces)
    assert first == pytest.approx(0.1 * np.linalg.norm([0.005, 0.01, 0.015]))
    assert piece_error(mesh, pieces) == first
    assert len(measured) == 1
    (file,) = {*kept.glob("*/error-*")} - before
    for damaged in (np.float64(np.nan), np.float64(-1.0), np.zeros(2), np.int64(0)):
        np.savez(file, error=damaged)
        assert piece_error(mesh, pieces) == first
    file.write_bytes(b"PK")
    assert piece_error(mesh, pieces) == first
    assert len(measured) == 6
    assert piece_error(mesh, (0.8 * cube.vertices,)) > first


def test_of_a_fine_mesh_few_points_are_measured_exactly(monkeypatch):
    """All lie outside the piece: exact distances from 80,000 points to its facets take minutes."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.01)
    lumps = 1.0 + 0.02 * np.sin(400.0 * ball.vertices[:, :1])
    mesh = mesh_from_arrays(ball.vertices * lumps, ball.faces)
    piece = 0.97 * ball.vertices[::10]
    measured, exact = [], module._distances

    def counted(points, hull):
        measured.append(len(points))
        return exact(points, hull)

    monkeypatch.setattr(module, "_distances", counted)
    found = piece_error(mesh, (piece,))
    assert sum(measured) < 0.05 * len(module._samples(mesh.vertices, mesh.faces))
    points = mesh.vertices[np.argsort(-np.linalg.norm(mesh.vertices, axis=1))[:200]]
    assert found >= exact(points, ConvexHull(piece)).max() - 1e-12


@pytest.mark.slow
def test_of_very_many_corners_some_are_kept(no_coacd):
    ball = of(trimesh.creation.icosphere(subdivisions=5, radius=0.03))
    solids = convex_pieces(ball)
    assert len(solids[0]) <= 4000 < len(ball.vertices)
    compiled(solids)
    assert 0 < piece_error(ball, solids) < 2e-3 * 0.03


@pytest.mark.parametrize("scale", [1e-4, 1e-3, 1.0])
@pytest.mark.parametrize("double", [False, True])
def test_a_convex_sheet_gets_a_hair_of_thickness(no_coacd, scale, double):
    vertices = scale * np.concatenate([SQUARE, SQUARE]) / 0.01
    vertices[4:, 2] += scale * 1e-6  # another sheet, nearer than a hair
    faces = np.concatenate([SQUARE_FACES, SQUARE_FACES[:, ::-1] + 4]) if double else SQUARE_FACES
    mesh = mesh_from_arrays(vertices, faces)
    (solid,) = convex_pieces(mesh)
    extents = np.ptp(solid, axis=0) / scale
    assert extents[:2] == pytest.approx([1, 1], abs=1e-3)
    assert 0.9e-4 < extents[2] < 1.1e-4
    check(mesh, (solid,))


def test_a_needle_has_a_piece(no_coacd):
    mesh = mesh_from_arrays([[0, 0, 0], [0.01, 0, 0], [0.005, 1e-10, 0]], [[0, 1, 2]])
    check(mesh, convex_pieces(mesh))


# Several


def test_parts_that_are_convex_need_no_cutting(no_coacd):
    faces = np.concatenate([CUBE_FACES, CUBE_FACES + 8])
    for shift in (0.005, 0.02, 0.05):
        mesh = mesh_from_arrays(np.concatenate([CUBE, CUBE + shift]), faces)
        solids = convex_pieces(mesh)
        assert len(solids) == 2
        check(mesh, solids)
        assert piece_error(mesh, solids) == 0


def test_a_cavity_stays_with_its_part(no_coacd, tmp_path):
    hollow = np.concatenate([CUBE_FACES, CUBE_FACES[:, ::-1] + 8])
    mesh = mesh_from_arrays(np.concatenate([CUBE, 0.005 + 0.5 * CUBE]), hollow)
    with pytest.raises(AsperityError, match="not convex"):
        convex_pieces(mesh, cache_folder=tmp_path)


def test_a_concave_mesh_keeps_its_hole(tmp_path):
    pytest.importorskip("coacd")
    mesh = washer()
    solids = convex_pieces(mesh, cache_folder=tmp_path)
    assert 3 <= len(solids) <= 16
    check(mesh, solids)
    assert not inside([0, 0, 0], solids)
    assert inside([0.015, 0, 0], solids)
    assert piece_error(mesh, solids) < 1e-4
    whole = (mesh.vertices[ConvexHull(mesh.vertices).vertices],)
    assert piece_error(mesh, whole) == 0
    assert piece_error(mesh, solids[1:]) > 1e-3


def test_the_pieces_of_a_sheet_with_a_notch_leave_it(tmp_path):
    pytest.importorskip("coacd")
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]])
    mesh = mesh_from_arrays(0.02 * corners, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    solids = convex_pieces(mesh, cache_folder=tmp_path)
    assert len(solids) > 1
    check(mesh, solids)
    assert not inside([0.03, 0.03, 0], solids)


def test_pieces_are_kept_on_disk_and_made_anew_when_damaged(tmp_path, monkeypatch):
    pytest.importorskip("coacd")
    runs = []
    cut = module._cut
    monkeypatch.setattr(module, "_cut", lambda *args: runs.append(1) or cut(*args))
    mesh = washer()
    first = convex_pieces(mesh, cache_folder=tmp_path)
    (file,) = tmp_path.iterdir()
    again = convex_pieces(mesh, cache_folder=tmp_path)
    assert len(runs) == 1
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    whole = file.read_bytes()
    for damage in (b"", b"PK", whole[:-40], whole[:300] + b"???" + whole[303:]):
        file.write_bytes(damage)
        runs.clear()
        assert len(convex_pieces(mesh, cache_folder=tmp_path)) == len(first)
        assert runs == [1]
        assert len(file.read_bytes()) == len(whole)
    convex_pieces(mesh, threshold=0.3, cache_folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def test_pieces_lie_in_the_users_cache_folder(tmp_path, monkeypatch):
    pytest.importorskip("coacd")
    monkeypatch.setattr(module, "kept_folder", kept_folder)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    convex_pieces(washer())
    assert len(list((tmp_path / "convex-pieces").glob("*.npz"))) == 1


def test_a_cache_that_cannot_be_written_is_only_a_warning(tmp_path, caplog):
    pytest.importorskip("coacd")
    (tmp_path / "file").write_text("in the way")
    assert convex_pieces(washer(), cache_folder=tmp_path / "file")
    assert "convex pieces are not kept" in caplog.text


def test_without_coacd_a_concave_mesh_names_the_extra(no_coacd, tmp_path):
    with pytest.raises(AsperityError, match=r"coacd.*; valid: pip install 'asperity\[bake\]'"):
        convex_pieces(washer(), cache_folder=tmp_path)


@pytest.mark.parametrize("threshold", [0, 2, float("nan"), "fine"])
def test_a_threshold_out_of_range_is_refused(threshold):
    with pytest.raises(AsperityError, match=r"threshold must lie between 0.01 and 1, got"):
        convex_pieces(washer(), threshold=threshold)


def test_the_error_is_the_distance_to_the_nearest_piece():
    """Beyond a corner that is more than the height over any plane."""
    mesh = mesh_from_arrays(
        [[0.03, 0.03, 0.03], [0.02, 0.01, 0.01], [0.01, 0.01, 0.02]], [[0, 1, 2]]
    )
    assert piece_error(mesh, (CUBE,)) == pytest.approx(0.01 * np.sqrt(3), rel=1e-9)
    assert piece_error(mesh, (CUBE, CUBE + 0.015)) == 0


# Real ones


def real(data, tmp_path, file, unit):
    mesh = read_mesh(data / "meshes" / file, unit=unit)
    solids = convex_pieces(mesh, cache_folder=tmp_path)
    check(mesh, solids)
    return mesh, solids


@pytest.mark.parametrize("file", ["block.stl", "hammerblock.stl", "hammerhandle.stl"])
def test_real_convex_meshes_are_one_piece(no_coacd, data, tmp_path, file):
    mesh, solids = real(data, tmp_path, file, "m")
    assert len(solids) == 1
    assert piece_error(mesh, solids) < 1e-6


@pytest.mark.parametrize("file", ["nail.stl", "assembly_peg_ring.stl"])
def test_small_real_concave_meshes(data, tmp_path, file):
    pytest.importorskip("coacd")
    mesh, solids = real(data, tmp_path, file, "m")
    assert 2 <= len(solids) <= 16
    assert piece_error(mesh, solids) < 1e-3 * np.ptp(mesh.vertices, axis=0).max()
    if file.startswith("assembly"):
        assert not inside(0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)), solids)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "unit"),
    [
        ("angle_block.STL", "in"), ("featuretype.STL", "in"), ("fuze.obj", "m"),
        ("hammerhead.stl", "m"), ("idler_riser.STL", "in"), ("octagonal_pocket.ply", "m"),
        ("spot.obj", "dm"), ("spot_control_mesh.obj", "dm"), ("wallhole.obj", "cm"),
    ],
)  # fmt: skip
def test_large_real_concave_meshes(data, tmp_path, file, unit):
    pytest.importorskip("coacd")
    mesh, solids = real(data, tmp_path, file, unit)
    assert len(solids) <= 16
    assert piece_error(mesh, solids) < 1e-3 * np.ptp(mesh.vertices, axis=0).max()
