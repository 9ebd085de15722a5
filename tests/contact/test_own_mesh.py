"""A user's own files: many small smooth facets against two large ones with a picture on them.

Normals of the large ones are averaged round the rim, as those of a file without normals are; the
picture may be as rough as grain of one pixel.
"""

import time
from dataclasses import replace

import numpy as np
import pytest
from naive_meshes import ball_mesh, engine_of, roller, thing, touch, with_uv

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.facets.facets import mesh_facets
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.height_field import HeightField

RADIUS, HALF, PIXEL = 4e-3, (15e-3, 10e-3, 2.5e-3), 120e-6
SPECTRA = {"waves": 0.05, "self-affine": 0.2, "grain": 10.0}
CORNERS = np.array([(i & 4, i & 2, i & 1) for i in range(8)], dtype=bool)
FACES = np.array([
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
])  # fmt: skip


def picture(kind, seed=4):
    """Return a field of 8-bit grey levels, 0.2 mm from black to white."""
    rng = np.random.default_rng(seed)
    waves = np.hypot(*np.meshgrid(np.fft.fftfreq(128), np.fft.fftfreq(128)))
    shape = np.exp(-0.5 * (waves / SPECTRA[kind]) ** 2)
    if kind == "self-affine":
        shape = np.maximum(waves, 4 / 128) ** -1.5
    rough = np.fft.ifft2(np.fft.fft2(rng.normal(size=(128, 128))) * shape).real
    grey = np.round(255 * (rough - rough.min()) / np.ptp(rough))
    return HeightField((grey - grey.mean()) * 2e-4 / 255, PIXEL, border="wrap")


def scene(kind, mapping):
    """Return an engine, and its tile: a ball of 1,280 triangles over a box of 12."""
    texture = picture(kind)
    mesh = mesh_from_arrays(np.where(CORNERS, 1.0, -1.0) * HALF, FACES)
    if mapping == "uv":
        mesh = with_uv(mesh, texture, seed=2)
    tile = thing("plate", mesh, texture, mapping)
    return engine_of(thing("tool", ball_mesh(RADIUS, 3)), tile, stiffness=400.0), tile


def over(x, y, depth):
    """Return a pose with the ball that deep in the smooth tile."""
    return np.array([x, y, HALF[2] + RADIUS - depth, 1.0, 0.0, 0.0, 0.0])


def textured_top(tile, texture, x, y):
    """Return points of the tile's textured top over base points (x, y), (n, 3)."""
    mesh, out = tile.body.mesh, np.full((x.size, 3), np.nan)
    corners = mesh.vertices[mesh.faces]
    for k in np.flatnonzero(np.all(corners[:, :, 2] > 0.0, axis=1)):
        a, b, c = corners[k]
        share = np.linalg.solve(
            np.stack([b[:2] - a[:2], c[:2] - a[:2]], axis=1), np.stack([x, y]) - a[:2, None]
        )
        share = np.stack([1.0 - share.sum(axis=0), *share], axis=1)
        mine = share.min(axis=1) >= -1e-9
        share = share[mine]
        base, w = share @ corners[k], share @ mesh.normals[k]
        w /= np.linalg.norm(w, axis=1)[:, None]
        if mesh.uv is None:
            maps = [(1, 2), (2, 0), (0, 1)]
            heights = [texture.heights(base[:, i], base[:, j]) for i, j in maps]
            weights = w.T**4 / np.sum(w**4, axis=1)
            t = np.sum(weights * np.array(heights), axis=0)
        else:
            t = texture.heights(*((share @ mesh.uv[k]) * texture.size).T)
        out[mine] = base + t[:, None] * w
    return out


def deepest(tile, texture, ball, at, n):
    """Return the overlap along n by samples of the tile, ever finer round the deepest few."""
    points = ball.vertices[ball.faces] + at[:3]
    outward = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    facing = outward @ n < 0.0
    outward, points = outward[facing], points[facing, 0]
    offset = np.einsum("ij,ij->i", outward, points)

    def overlap(x, y):
        p = textured_top(tile, texture, x, y)
        # The ball is convex: its lower side is the highest of its facets' planes.
        along = outward @ n
        side = ((offset[:, None] - outward @ p.T) / along[:, None]).max(axis=0)
        beside = np.linalg.norm(p - at[:3] - ((p - at[:3]) @ n)[:, None] * n, axis=1)
        return np.where(beside < 0.8 * RADIUS, -side, -np.inf)

    step = 25e-6
    line = np.arange(-2.5e-3, 2.5e-3, step)
    x, y = (part.ravel() for part in np.meshgrid(at[0] + line, at[1] + line))
    best = -np.inf
    for _ in range(5):
        f = overlap(x, y)
        best = max(best, np.nanmax(f))
        keep = np.argsort(-np.nan_to_num(f, nan=-np.inf))[:60]
        fine = np.linspace(-step, step, 11)
        dx, dy = (part.ravel() for part in np.meshgrid(fine, fine))
        x, y = (x[keep, None] + dx).ravel(), (y[keep, None] + dy).ravel()
        step /= 5.0
    return best


@pytest.mark.parametrize("kind", SPECTRA)
@pytest.mark.parametrize("mapping", ["uv", "triplanar"])
def test_every_depth_is_certified_and_none_is_lost(kind, mapping):
    """Along a slide, deep in the tile: as deep as a plain search finds, and felt in every tick."""
    engine, tile = scene(kind, mapping)
    ball, texture = ball_mesh(RADIUS, 3), picture(kind)
    path = [over(x, 0.3 * x + 1e-3, 1.2e-3) for x in np.linspace(-6e-3, 6e-3, 40)]
    into = [over(*path[0][:2], depth) for depth in np.arange(-2e-4, 1.2e-3, 5e-5)]
    for at in into:
        touch(engine, at)
    for i, at in enumerate(path):
        found = touch(engine, at)
        assert len(found.depth) > 0
        assert (found.status == 0).all()
        assert found.gap.max() <= max(1e-3 * texture.rms, 1e-9)
        assert found.mean_depth > 1.0e-3
        if i % 8 == 0:
            plain = deepest(tile, texture, ball, at, found.normal[0])
            assert found.depth.max() == pytest.approx(plain, abs=found.gap.max() + 3e-8)


def _seconds(engine, path):
    """Return the median time of a tick; processor time, so that others do not count."""
    taken = []
    for at in path:
        begun = time.thread_time()
        touch(engine, at)
        taken.append(time.thread_time() - begun)
    return float(np.median(taken))


def test_triangles_cost_a_few_times_what_simple_solids_do():
    """Grain was a hundred times slower, and not certified at that."""
    engine, _ = scene("grain", "triplanar")
    texture = picture("grain")
    plate = Body("plate", [Geom("box", np.array(HALF))], texture)
    simple = engine_of(Body("tool", [Geom("sphere", np.array([RADIUS, 0, 0]))]), plate)
    path = [over(x, 1e-3, 1.2e-3) for x in np.linspace(-5e-3, 5e-3, 60)]
    into = [over(*path[0][:2], depth) for depth in np.arange(-2e-4, 1.2e-3, 5e-5)]
    for at in into:
        touch(engine, at)
        touch(simple, at)
    assert _seconds(engine, path) < 12.0 * _seconds(simple, path)


def random_solid(rng, corners, size):
    """Return a random hull round the origin, of a given largest side [m]."""
    trimesh = pytest.importorskip("trimesh")
    solid = trimesh.convex.convex_hull(rng.normal(size=(corners, 3)))
    solid.apply_translation(-solid.bounds.mean(axis=0))
    solid.apply_scale(size / solid.extents.max())
    return mesh_from_arrays(solid.vertices, solid.faces)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("kind", ["waves", "self-affine"])
def test_two_rough_random_solids_that_slide_are_certified(kind, seed):
    """Wide, deep contact, in which one point may be the deepest of several sub-regions.

    The budget counts the search for it once, and only the last of several rounds of facets.
    """
    rng = np.random.default_rng(seed)
    target, tool = random_solid(rng, 60, 40e-3), random_solid(rng, 200, 12e-3)
    engine = engine_of(
        thing("tool", tool, picture(kind, seed=1), "triplanar"),
        thing("plate", target, picture(kind, seed=2), "triplanar"),
        stiffness=400.0,
    )
    pose = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    high, low = 40e-3, 0.0
    for _ in range(30):  # as deep as pushes with 0.6 N
        pose[2] = 0.5 * (high + low)
        engine.reset()
        is_light = touch(engine, pose, 0.0).wrench[2] < 0.6
        high, low = (pose[2], low) if is_light else (high, pose[2])
    engine.reset()
    certified = total = 0
    for _ in range(40):
        status = touch(engine, pose).status
        certified, total = certified + int(np.sum(status == 0)), total + len(status)
        pose[0] += 83e-6
    assert total >= 40
    assert certified >= 0.995 * total


def pen():
    """Return a cone that points down, its tip at the origin, 6 mm high."""
    phi = 2 * np.pi * np.arange(24) / 24
    rim = np.column_stack([2e-3 * np.cos(phi), 2e-3 * np.sin(phi), np.full(24, 6e-3)])
    k, after = np.arange(24), (np.arange(24) + 1) % 24
    sides = np.column_stack([k, np.full(24, 24), after])
    top = np.column_stack([np.full(24, 25), k, after])
    vertices = np.concatenate([rim, [[0, 0, 0], [0, 0, 6e-3]]])
    return mesh_from_arrays(vertices, np.concatenate([sides, top]), hard_angle=40.0)


def coin(uv_noise):
    """Return a body whose ends are fans of 64 triangles, with a picture on it."""
    texture = picture("waves")
    mesh = with_uv(roller(12e-3, 1e-3, 64), texture, seed=3)
    noise = uv_noise * np.random.default_rng(1).uniform(-1.0, 1.0, mesh.uv.shape)
    return thing("coin", replace(mesh, uv=mesh.uv + noise), texture, "uv"), texture


@pytest.mark.parametrize("uv_noise", [0.0, 1e-7, 1e-4], ids=["exact", "single", "coarse"])
def test_a_tip_on_the_seam_of_two_triangles_feels_the_texture_there(uv_noise):
    """Facets that meet in a line have no common area, and an edge of either must not turn F."""
    target, texture = coin(uv_noise)
    engine = engine_of(thing("tool", pen()), target, stiffness=400.0)
    mesh = target.body.mesh
    top = np.flatnonzero(np.all(mesh.vertices[mesh.faces][:, :, 2] > 0.0, axis=1))
    steepest = max(np.abs(d).max() for d in texture.derivatives(*np.meshgrid(
        *(np.linspace(0, s, 300) for s in texture.size)))[1:3])  # fmt: skip
    for x in np.linspace(-11e-3, -1e-3, 21):
        engine.reset()
        pose = np.array([x, 0.0, 1e-3 - 3e-4, 1.0, 0.0, 0.0, 0.0])
        felt = touch(engine, pose)
        assert felt.status.tolist() == [0]
        heights = []
        for k in top:  # the tip is on the edge of two of them
            corners, uv = mesh.vertices[mesh.faces[k]][:, :2], mesh.uv[k] * texture.size
            share = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), [x, 0.0, 1.0])
            if share.min() > -1e-9:
                heights.append(texture.heights(*(share @ uv)[:, None])[0])
        assert felt.depth[0] == pytest.approx(3e-4 + max(heights), abs=2e-9)
        assert np.hypot(*felt.wrench[:2]) < 1.5 * steepest * felt.wrench[2]


def test_texture_coordinates_in_single_precision_leave_a_flat_face_whole():
    for uv_noise, most in ((0.0, 160), (1e-7, 160), (1e-4, 256)):
        target, _ = coin(uv_noise)
        mesh = target.body.mesh
        facets = mesh_facets(
            mesh.vertices, mesh.faces, mesh.normals, mesh.uv * target.body.texture.size
        )
        assert len(facets) <= most
        if uv_noise == 1e-4:
            assert len(facets) == 256
