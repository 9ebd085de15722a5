"""Heights cast from a low-resolution mesh: right in size, place and side, over seams and walls."""

import numpy as np
import pytest
from scans import AMPLITUDE, AXES, displaced_finely, ellipsoid, ripples

from asperity.baking.error import bake_error, displaced, scattered
from asperity.baking.heights import bake_heights, places
from asperity.baking.nearest import Nearest
from asperity.baking.rays import FullSurface
from asperity.baking.simplify import simplified
from asperity.baking.texels import GUTTER, INSIDE, texels_of
from asperity.baking.unwrap import texture_span, unwrapped
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.geometry.mesh.topology import edges_of, next_corner
from asperity.texture.height_field import HeightField

SIZE = 256


@pytest.fixture(scope="module")
def rippled():
    """Return a low-resolution ellipsoid, the triangles of the displaced one, and its heights."""
    low = unwrapped(ellipsoid(2), SIZE)
    vertices, faces = displaced_finely(low, ripples, 16)
    full = vertices[faces]
    return low, full, bake_heights(low, full, SIZE)


def _field(low, baked):
    return HeightField(baked.heights, texture_span(low) / len(baked.heights))


def _heights(field, low, face, weights):
    u, v = (np.einsum("ij,ijk->ik", weights, low.uv[face]) * np.asarray(field.size)).T
    return field.heights(u, v)


def test_a_known_texture_comes_back(rippled):
    low, _, baked = rippled
    assert baked.coverage == 1.0
    face, weights = scattered(low.vertices[low.faces], 20_000, np.random.default_rng(0))
    points, _ = places(low, face, weights)
    off = _heights(_field(low, baked), low, face, weights) - ripples(points)
    # The full mesh is made of chords; its own facets are 0.3 % of the amplitude off.
    assert np.sqrt(np.mean(off**2)) < 0.01 * AMPLITUDE
    assert np.abs(off).max() < 0.04 * AMPLITUDE


def test_and_comes_back_over_a_mesh_made_of_the_full_one(rippled):
    _, full, _ = rippled
    vertices, faces = displaced_finely(ellipsoid(2), ripples, 16)
    low = unwrapped(simplified(mesh_from_arrays(vertices, faces), 500), 512)
    baked = bake_heights(low, full, 512)
    error = bake_error(low, _field(low, baked), full)
    assert error.rms < 0.02 * AMPLITUDE
    assert error.max < AMPLITUDE


def test_the_two_sides_of_every_seam_agree(rippled):
    low, _, baked = rippled
    field = _field(low, baked)
    h, g = edges_of(low.faces).pairs.T
    seam = np.abs(
        low.uv.reshape(-1, 2)[h] - low.uv.reshape(-1, 2)[next_corner(g)]
    ).max(axis=1) > 1e-9  # fmt: skip
    h, g = h[seam], g[seam]
    assert len(h) > 20
    for share in (0.0, 0.3, 0.5, 0.8):
        sides = []
        for half, along in ((h, share), (g, 1.0 - share)):
            weights = np.zeros((len(half), 3))
            k = np.arange(len(half))
            weights[k, half % 3], weights[k, (half + 1) % 3] = 1.0 - along, along
            sides.append(_heights(field, low, half // 3, weights))
        assert np.abs(sides[0] - sides[1]).max() < 0.02 * AMPLITUDE


def test_a_bump_is_where_it_is_and_outwards():
    tip = np.array([AXES[0], 0.0, 0.0])

    def bump(points):
        return 3e-4 * np.exp(-np.sum((points - tip) ** 2, axis=1) / (2.0 * 2e-3**2))

    low = unwrapped(ellipsoid(2), SIZE)
    vertices, faces = displaced_finely(low, bump, 12)
    baked = bake_heights(low, vertices[faces], SIZE)
    field = _field(low, baked)
    row, column = np.unravel_index(
        np.argmax(np.where(baked.texels.kind == INSIDE, baked.heights, 0.0)), baked.heights.shape
    )
    which = np.flatnonzero((baked.texels.where == (row, column)).all(axis=1))[0]
    place, along = places(low, baked.texels.face[[which]], baked.texels.weights[[which]])
    assert np.linalg.norm(place[0] - tip) < 1e-3
    assert along[0, 0] > 0.9
    assert baked.heights.max() == pytest.approx(3e-4, rel=0.02)
    # What the renderer makes of it stands out of the ellipsoid at the tip and nowhere else.
    face, weights = scattered(low.vertices[low.faces], 5000, np.random.default_rng(1))
    points = displaced(low, field, face, weights)
    away = Nearest(vertices[faces]).to(points)[1]
    assert away.max() < 2e-5


def test_rays_do_not_take_the_far_side_of_a_thin_wall():
    # A sheet of 0.4 mm, displaced by as much as that: each side is near both of the full one.
    side, thick = 0.02, 4e-4
    n = 120
    x, y = np.meshgrid(*(np.linspace(-side, side, n + 1),) * 2)

    def wave(x):
        return 1.5e-4 * np.cos(2.0 * np.pi * x / 8e-3)

    sheets = [np.stack([x, y, wave(x) + s * thick / 2.0], axis=-1).reshape(-1, 3) for s in (1, -1)]
    k = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (q.ravel() for q in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    up = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    full = np.concatenate([sheets[0][up], sheets[1][up[:, ::-1]]])
    points = np.random.default_rng(0).uniform(-0.9 * side, 0.9 * side, (2000, 2))
    for s in (1.0, -1.0):
        base = np.column_stack([points, np.full(len(points), s * thick / 2.0)])
        along = np.tile([0.0, 0.0, s], (len(points), 1))
        found = FullSurface(full).heights(base, along, 1e-3)
        assert np.abs(found - s * wave(points[:, 0])).max() < 3e-6
        assert np.isnan(FullSurface(full).heights(base + 2e-3 * along, along, 1e-3)).all()


def test_texels_beyond_a_border_show_what_lies_over_the_edge():
    low = unwrapped(ellipsoid(2), SIZE)
    texels = texels_of(low, SIZE)
    points, _ = places(low, texels.face, texels.weights)
    where = {tuple(w): k for k, w in enumerate(texels.where.tolist())}
    texel = texture_span(low) / SIZE
    gutter = np.argwhere(texels.kind == GUTTER)
    steps = []
    for iv, iu in gutter[::7].tolist():
        for beside in ((iv, iu + 1), (iv + 1, iu), (iv, iu - 1), (iv - 1, iu)):
            if beside in where and texels.kind[beside] == INSIDE:
                steps.append(np.linalg.norm(points[where[iv, iu]] - points[where[beside]]))
    # One texel on, however the seam runs: the charts are flat, the body is not.
    assert len(steps) > 100
    assert np.percentile(steps, 95) < 1.3 * texel
    assert np.median(steps) == pytest.approx(texel, rel=0.1)


def test_nearest_places_are_those_of_all_triangles():
    rng = np.random.default_rng(3)
    triangles = rng.normal(size=(60, 3, 3))
    points = rng.normal(size=(200, 3))
    found = Nearest(triangles).to(points)[1]
    shares = rng.dirichlet(np.ones(3), 4000)
    samples = np.einsum("sk,fkd->fsd", shares, triangles).reshape(-1, 3)
    sampled = np.array([np.linalg.norm(samples - p, axis=1).min() for p in points])
    assert (found <= sampled + 1e-12).all()
    assert (sampled - found).max() < 0.12


def test_a_mesh_baked_to_itself_has_no_error_however_coarse_the_texture():
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.01
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)])
    low = unwrapped(mesh_from_arrays(corners, faces), 64)
    baked = bake_heights(low, corners[faces], 64)
    error = bake_error(low, _field(low, baked), corners[faces])
    assert error.max < 1e-9
