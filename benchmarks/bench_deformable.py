"""Time of a tick of deformable surfaces: 512 moving triangles, a texture of 1024 x 1024 samples.

    python benchmarks/bench_deformable.py

The same ball slides over a surface that is still, over one whose vertices all move every tick, and
over an elastic body; and, beside them, over
a soft skin of 64 x 64 taxels. Time is that of the processor, so that other processes count
little, in turns of 200 ticks each.
"""

from __future__ import annotations

import time

import numpy as np

from asperity.contact.deformable.elastic_body import elastic_body
from asperity.contact.deformable.elastic_contact import ElasticContact
from asperity.contact.deformable.surface import DeformableSurface
from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.texture.patterns.patterns import rough

HALF, HEIGHT, RADIUS, DEPTH = 20e-3, 12e-3, 4e-3, 4e-4
TURNS, TICKS = 10, 200


def sheet(n: int = 17):
    """Return a sheet of 512 triangles that faces up."""
    x, y = np.meshgrid(*[np.linspace(-HALF, HALF, n)] * 2, indexing="ij")
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (p.ravel() for p in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return mesh_from_arrays(np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3), faces)


def slab(mesh):
    """Return an elastic body below the sheet, held at its base."""
    import skfem

    lines = np.linspace(-HALF, HALF, 9), np.linspace(-HALF, HALF, 9), np.linspace(-HEIGHT, 0.0, 4)
    grid = skfem.MeshTet.init_tensor(*lines)
    return elastic_body(
        mesh, grid.p.T, grid.t.T, modulus=2e4, density=1000.0, held=lambda p: p[:, 2] < -0.0119
    )


def ticks():
    """Return what each kind does at a place along the way [m] in tick k."""
    mesh = sheet()
    texture = rough(
        size=1024 * 2e-5,
        pixel_size=2e-5,
        hurst=0.7,
        rms_slope=0.2,
        rolloff=2e-3,
        cutoff=1e-4,
        seed=1,
    )
    options = {"thickness": 2e-3, "modulus": 1e5, "friction": 0.3}
    surface = DeformableSurface(mesh, pitch=4e-4, texture=texture, **options)
    ball = Body("ball", [Geom("sphere", (RADIUS,))])
    still, moving = SurfaceContact(surface, [ball]), SurfaceContact(surface, [ball])
    elastic = ElasticContact(slab(mesh), surface, [ball])
    pad = Body("pad", [Geom("box", (HALF, HALF, 5e-3), (0.0, 0.0, -5e-3))], texture)
    skin = SkinContact(SoftSkin(pad, taxels=(64, 64), **options), [ball])
    phase = mesh.vertices[:, 0] / 8e-3

    def place(s: float, depth: float = DEPTH):
        return np.array([s, 0.3e-3, RADIUS - depth, 1.0, 0.0, 0.0, 0.0])

    def wave(k: int):
        moved = mesh.vertices.copy()
        moved[:, 2] += 2e-4 * np.sin(phase + 0.02 * k)
        return moved

    def of_skin(s: float, _: int) -> None:
        skin.place([place(s)])
        skin.wrench((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))

    return {
        "soft skin, 64 x 64 taxels": of_skin,
        "surface, still": lambda s, k: still.press(mesh.vertices, [place(s)]),
        "surface, all vertices move": lambda s, k: moving.press(wave(k), [place(s)]),
        "elastic body, 40 modes": lambda s, k: elastic.step([place(s, 1.5e-3)], 1e-3),
    }  # fmt: skip


def main() -> None:
    """Print median and p99.9 of each kind, and over those of the soft skin."""
    kinds = ticks()
    times: dict[str, list[float]] = {name: [] for name in kinds}
    tick = {name: 0 for name in kinds}
    for turn in range(TURNS + 1):
        for name, step in kinds.items():
            for _ in range(TICKS):
                k = tick[name]
                tick[name] += 1
                way = 1e-2 * np.sin(2e-3 * k)
                begun = time.process_time()
                step(way, k)
                if turn:  # the first compiles
                    times[name].append(time.process_time() - begun)
    base = np.median(times["soft skin, 64 x 64 taxels"])
    print(f"{'ms':30}{'median':>9}{'p99.9':>9}{'over skin':>11}")
    for name, values in times.items():
        median, late = np.median(values), np.quantile(values, 0.999)
        print(f"{name:30}{1e3 * median:9.3f}{1e3 * late:9.3f}{median / base:11.2f}")


if __name__ == "__main__":
    main()
