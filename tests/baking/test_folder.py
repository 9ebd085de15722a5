"""From a file to a folder that is a scene, whole or not at all."""

import errno
import json
import sys

import numpy as np
import pytest
from scans import AMPLITUDE, displaced_finely, ellipsoid, ripples, write

import asperity
from asperity.baking import bake as baking
from asperity.contact.body_pair import BodyPair
from asperity.errors import AsperityError, OutputError
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.height_field import HeightField
from oracle.depth import reference_depth

FILES = {"object.obj", "heights.tiff", "scene.xml", "scene.toml", "bake.json"}
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """Return a PLY file of a rippled ellipsoid in millimetres, and its triangles [m]."""
    vertices, faces = displaced_finely(ellipsoid(2), ripples, 8)
    path = tmp_path_factory.mktemp("scan") / "stone.ply"
    return write(path, 1e3 * vertices, faces), vertices[faces]


@pytest.fixture(scope="module")
def baked(scan, tmp_path_factory):
    out = tmp_path_factory.mktemp("baked") / "stone"
    told = []
    result = asperity.bake(
        scan[0], out, faces=200, size=256, picture=False,
        on_progress=lambda stage, share: told.append((stage, share)),
    )  # fmt: skip
    return result, told


def _object(scene):
    return next(body for body in scene.bodies if body.name == "object")


def test_what_it_leaves(baked):
    result, told = baked
    assert {path.name for path in result.folder.glob("[!.]*")} == FILES
    report = json.loads((result.folder / "bake.json").read_text("utf-8"))
    assert report == result.report
    assert report["faces"] == 200
    assert report["full_faces"] == 320 * 64
    assert report["texture_size"] == [256, 256]
    assert report["coverage"] > 0.999
    assert 0.0 < report["error_um"]["rms"] < report["error_um"]["p99"] < report["error_um"]["max"]
    assert report["error_um"]["rms"] < 0.06e6 * AMPLITUDE
    assert report["seconds"] > 0.0
    assert report["closed"]
    assert any(note.startswith("unit guessed: mm, which makes it 40") for note in report["notes"])
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert told[-1] == ("done", 1.0)
    assert list(dict.fromkeys(stage for stage, _ in told)) == [
        "read", "simplify", "unwrap", "rays", "error", "pieces", "scene", "picture", "done",
    ]  # fmt: skip


def test_the_folder_is_a_scene_with_the_heights_that_were_baked(baked):
    scene = asperity.load_scene(baked[0].folder)
    body = _object(scene)
    assert len(body.mesh.faces) == 200
    assert body.mapping == "uv"
    import tifffile

    # The picture's bottom row is v = 0; nothing is centred, scaled or rounded.
    pixels = tifffile.imread(baked[0].folder / "heights.tiff")
    np.testing.assert_array_equal(body.texture.samples, pixels[::-1].astype(np.float64))
    assert scene.document["bodies"]["object"]["texture"]["unit"] == "m"


def test_the_probe_meets_the_scan_where_it_is(scan, baked):
    """Depth of a sphere in the baked body, and in the full mesh: certified, of both."""
    probe = Body("probe", [Geom("sphere", (1.5e-3,))])
    box = [Geom("mesh", (0.03, 0.03, 0.03))]
    vertices, faces = np.unique(scan[1].reshape(-1, 3), axis=0, return_inverse=True)
    full = Body("full", box, mesh=mesh_from_arrays(vertices, faces.reshape(-1, 3)))
    up = np.array([0.0, 0.0, 1.0])
    pairs = [BodyPair(probe, body) for body in (_object(baked[0].scene), full)]
    rng, found = np.random.default_rng(0), []
    for x, y in rng.uniform(-5e-3, 5e-3, (12, 2)):
        pose = UPRIGHT.copy()
        pose[:3] = x, y, 0.0131
        depths = [pair.depth(pose, UPRIGHT, up, smooth_overlap=2e-3) for pair in pairs]
        assert all(depth.certified for depth in depths)
        found.append([depth.depth for depth in depths])
    found = np.array(found)
    assert np.corrcoef(found.T)[0, 1] > 0.99
    assert np.sqrt(np.mean((found[:, 0] - found[:, 1]) ** 2)) < 0.05 * AMPLITUDE


def test_it_is_felt(baked):
    simulation = asperity.Simulation(baked[0].scene)
    poses = simulation.trajectory().poses
    start = np.array([simulation.step(pose) for pose in poses[:3]])
    assert np.isfinite(start).all()
    wanted = baked[0].scene.document["trajectory"]["press_force"]
    assert start[0, 2] == pytest.approx(wanted, rel=1e-3)
    rolled = np.array([simulation.step(pose)[2] for pose in poses[3:120]])
    assert (rolled > 0.2 * wanted).all()


@pytest.mark.slow
def test_depths_follow_those_of_the_full_meshes(tmp_path):
    """The brute-force reference on two full meshes, against the certified search on the baked."""
    bodies, full = {}, {}
    box = [Geom("mesh", (0.03, 0.03, 0.03))]
    for name, subdivisions, scale in (("tool", 1, 0.5), ("target", 2, 1.0)):
        low = ellipsoid(subdivisions)
        low = mesh_from_arrays(low.vertices * scale, low.faces, hard_angle=180.0)
        vertices, faces = displaced_finely(low, ripples, 12)
        path = write(tmp_path / f"{name}.ply", vertices, faces)
        result = asperity.bake(path, tmp_path / name, faces=300, size=512, unit="m", picture=False)
        bodies[name] = _object(result.scene)
        full[name] = Body(name, box, mesh=mesh_from_arrays(vertices, faces))
    pair = BodyPair(bodies["tool"], bodies["target"])
    up, rng, found = np.array([0.0, 0.0, 1.0]), np.random.default_rng(1), []
    for x, y in rng.uniform(-3e-3, 3e-3, (8, 2)):
        pose = UPRIGHT.copy()
        pose[:3] = x, y, 0.0178
        depth = pair.depth(pose, UPRIGHT, up, smooth_overlap=2e-3)
        true = reference_depth(
            full["tool"], pose, full["target"], UPRIGHT, up, depth_range=(-1e-3, 3e-3)
        )
        found.append((depth.depth, true.depth))
    found = np.array(found)
    assert np.corrcoef(found.T)[0, 1] > 0.95
    assert np.sqrt(np.mean((found[:, 0] - found[:, 1]) ** 2)) < 0.05 * AMPLITUDE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options", "rms"),
    [
        ("spot.obj", {"faces": 372, "unit": "dm", "up": "y"}, 60.0),
        ("hammerhead.stl", {"faces": 256, "unit": "m"}, 20.0),
        ("featuretype.STL", {"faces": 800, "unit": "cm"}, 20.0),
        ("assembly_peg_ring.stl", {"faces": 300, "unit": "m"}, 20.0),
    ],
)
def test_real_meshes(data, tmp_path, name, options, rms):
    # The picture takes as long as all else: one of them is drawn.
    drawn = name == "spot.obj"
    result = asperity.bake(
        data / "meshes" / name, tmp_path / "out", size=512, picture=drawn, **options
    )
    assert (tmp_path / "out" / "picture.png").is_file() == drawn
    assert result.report["faces"] <= 1.03 * options["faces"]
    assert result.report["coverage"] > 0.995
    assert result.report["error_um"]["rms"] < rms
    assert result.report["closed"]


def test_onto_a_given_mesh_with_texture_coordinates_of_its_own(tmp_path, scan):
    from asperity.baking.folder import write_mesh
    from asperity.baking.unwrap import unwrapped

    low = unwrapped(ellipsoid(2), 128)
    (tmp_path / "low").mkdir()
    base = write_mesh(low, tmp_path / "low", 180.0)
    target = write(tmp_path / "full.ply", *displaced_finely(low, ripples, 6))
    result = asperity.bake(
        target, tmp_path / "out", size=128, unit="m", base=tmp_path / "low" / "object.obj",
        picture=False,
    )  # fmt: skip
    body = _object(result.scene)
    np.testing.assert_allclose(body.mesh.uv, base.uv, atol=1e-8)
    assert result.report["faces"] == 320
    # On the mesh that was displaced the heights are those that displaced it.
    assert body.texture.samples.max() == pytest.approx(AMPLITUDE, rel=0.1)
    with pytest.raises(AsperityError, match="does not lie where the full mesh does"):
        asperity.bake(
            scan[0], tmp_path / "no", size=64, unit="cm", base=tmp_path / "low" / "object.obj"
        )


def test_the_axis_that_points_upwards(tmp_path):
    low = ellipsoid(1)
    path = write(tmp_path / "stone.obj", low.vertices, low.faces)
    result = asperity.bake(
        path, tmp_path / "out", faces=80, size=64, unit="m", up="x", picture=False
    )
    extents = np.ptp(low.vertices, axis=0)
    assert result.report["extents_mm"] == pytest.approx(1e3 * extents[[1, 2, 0]], rel=1e-6)


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left")])
def test_nothing_is_left_of_one_that_is_stopped(tmp_path, scan, monkeypatch, failure):
    def stop(*_, **__):
        raise failure

    monkeypatch.setattr(baking, "write_scene", stop)
    raised = OutputError if isinstance(failure, OSError) else KeyboardInterrupt
    with pytest.raises(raised, match=None if raised is KeyboardInterrupt else "No space left"):
        asperity.bake(scan[0], tmp_path / "deep" / "out", faces=60, size=64, picture=False)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"faces": 3}, "faces must be a whole number from 4, got 3"),
        ({"faces": 10**6}, "faces = 1000000, but the mesh has 20480 triangles; valid: 4 to 20480"),
        ({"size": 16}, "size must lie between 32 and 8192 texels, got 16"),
        ({"size": 9000}, "size must lie between 32 and 8192 texels, got 9000"),
        ({"unit": "parsec"}, "unknown unit 'parsec'"),
        ({"unit": "m"}, "mm"),
        ({"up": "w"}, "unknown up 'w'"),
        ({"base": "nowhere.obj"}, "nowhere.obj: there is no such file"),
    ],
)
def test_values_that_are_refused(tmp_path, scan, options, told):
    with pytest.raises(AsperityError) as caught:
        asperity.bake(scan[0], tmp_path / "out", **{"faces": 60, "size": 64, **options})
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_files_that_are_refused(tmp_path):
    def said(name, content=None, **options):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(AsperityError) as caught:
            asperity.bake(tmp_path / name, tmp_path / "out", **options)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    assert "there is no such file" in said("none.ply")
    assert "empty" in said("empty.obj", b"")
    assert "unknown kind of file '.doc'" in said("a.doc", b"x")
    assert "no triangles" in said("lines.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\n")
    assert "3 points are too few" in said("few.xyz", b"0 0 0\n1 0 0\n0 1 0\n")
    assert "no line of it holds three numbers" in said("bad.xyz", b"a b c\n" * 40)
    assert "base= is for meshes" in said("few.xyz", base="x.obj")
    assert "this is a folder" in said(".")


def test_a_package_that_is_missing_is_named(tmp_path, scan, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(AsperityError, match=r"embreex, which is not installed; valid: pip install"):
        asperity.bake(scan[0], tmp_path / "out", faces=60, size=64)


def test_a_height_map_becomes_a_plate_that_carries_it_as_it_is(tmp_path):
    v, u = np.indices((40, 60))
    heights = 1e-4 * np.sin(u / 5.0) * np.cos(v / 7.0) + 2e-6 * u
    np.savez(tmp_path / "map.npz", height=heights, pixel_size=2e-4)
    result = asperity.bake(tmp_path / "map.npz", tmp_path / "out", picture=False)
    assert result.report["kind"] == "plate"
    assert result.report["error_um"]["max"] < 1e-3
    probe = Body("probe", [Geom("sphere", (5e-4,))])
    field = HeightField(heights - heights.min(), 2e-4)
    flat = Body("flat", [Geom("box", (6e-3, 4e-3, 1e-3), (0.0, 0.0, -1e-3))], field)
    up = np.array([0.0, 0.0, 1.0])
    for x, y in ((0.0, 0.0), (2.1e-3, -1.3e-3), (-4e-3, 2.2e-3)):
        pose = UPRIGHT.copy()
        pose[:3] = x, y, 5.5e-4
        one, two = (
            BodyPair(probe, body).depth(pose, UPRIGHT, up, smooth_overlap=1e-3).depth
            for body in (_object(result.scene), flat)
        )
        assert one == pytest.approx(two, abs=1e-9)


def test_points_of_one_side_become_a_plate(tmp_path):
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-10.0, 10.0, (2, 40_000))
    z = 0.2 * np.sin(x) * np.cos(y) + rng.normal(0.0, 2e-3, x.size)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = np.stack([x, y, z], axis=1) @ turn.T
    np.savetxt(tmp_path / "scan.xyz", points)
    result = asperity.bake(tmp_path / "scan.xyz", tmp_path / "out", unit="mm", picture=False)
    inner = _object(result.scene).texture.samples[10:-50, 10:-10]
    assert inner.std() == pytest.approx(1e-4, rel=0.06)
    assert np.ptp(inner) == pytest.approx(4e-4, rel=0.05)
    assert sorted(result.report["extents_mm"])[1:] == pytest.approx([20.0, 20.0], rel=0.02)


def test_points_all_round_are_refused(tmp_path):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(5000, 3))
    points *= 20.0 / np.linalg.norm(points, axis=1, keepdims=True)
    np.savetxt(tmp_path / "ball.xyz", points)
    with pytest.raises(
        AsperityError, match=r"the points are no height map: .* a mesh made of them"
    ):
        asperity.bake(tmp_path / "ball.xyz", tmp_path / "out", unit="mm")
