"""Baking a mesh of 433,000 triangles to the paper's 518 and a texture of 1024 by 1024.

The mesh is asperity's own hammer, every triangle divided into 841, displaced along its smooth
normals by waves that run through space, so that it is closed; then taken as if it were a scan. The
process is measured as a whole: wall time, and the largest memory that it held. Convex pieces are
cut anew, not read from the user's cache. Run by `python benchmarks/bench_bake.py`.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.geometry.shapes.shape import hammer

Array = NDArray[np.float64]
DIVISIONS = 29
"""Of each side: 528 x 29^2 = 444,048 triangles, the paper's 433,000 to 3 %."""
RELIEF, LONGEST, SHORTEST, WAVES = 1e-4, 1.2e-2, 2.5e-3, 60
FACES, SIZE = 518, 1024
BARS = {"seconds": 120.0, "memory_gib": 4.0}


def waves(points: Array, seed: int = 5) -> Array:
    """Return heights [m] at points (n, 3): plane waves through space, of about equal slope."""
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(SHORTEST), np.log(LONGEST), WAVES))
    way = rng.normal(size=(WAVES, 3))
    way *= (2.0 * np.pi / length / np.linalg.norm(way, axis=1))[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, WAVES)
    share = length / np.sqrt(0.5 * np.sum(length**2))
    out = np.zeros(len(points))
    for k in range(WAVES):
        out += share[k] * np.cos(points @ way[k] + phase[k])
    return RELIEF * out


def fine(divisions: int = DIVISIONS) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and faces of the hammer at full detail."""
    shape = hammer()
    mesh = mesh_from_arrays(shape.vertices, shape.faces)
    n = divisions
    i, j = (a.ravel() for a in np.indices((n + 1, n + 1)))
    i, j = i[i + j <= n], j[i + j <= n]
    number = np.full((n + 2, n + 2), -1)
    number[i, j] = np.arange(len(i))
    up = i + j < n
    corners = [np.stack([number[i, j], number[i + 1, j], number[i, j + 1]], axis=1)[up]]
    down = i + j < n - 1
    corners += [np.stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]], axis=1)[down]]
    weights = np.stack([n - i - j, i, j], axis=1) / n
    points = (weights @ mesh.vertices[mesh.faces]).reshape(-1, 3)
    along = (weights @ mesh.normals).reshape(-1, 3)
    faces = np.concatenate(corners)[None] + len(i) * np.arange(len(mesh.faces))[:, None, None]
    # Points on the sides of triangles are there twice, and the same but for rounding.
    _, first, one = np.unique(
        np.round(points / 1e-9), axis=0, return_index=True, return_inverse=True
    )
    points, along = points[first], along[first]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return points + waves(points)[:, None] * along, one.reshape(-1)[faces.reshape(-1, 3)]


def write_ply(path: Path, divisions: int = DIVISIONS) -> int:
    """Write the hammer at full detail; return its number of triangles."""
    import trimesh

    points, faces = fine(divisions)
    trimesh.Trimesh(points, faces, process=False).export(path)
    return len(faces)


def _child(source: str, out: str) -> None:
    """Bake in a process of its own, so that its largest memory is that of baking."""
    from asperity.baking import bake as baking
    from asperity.geometry.convex import pieces

    stages: list[tuple[str, float]] = []
    keep = pieces.read_pieces
    pieces.read_pieces = lambda file: None  # cut anew
    start = time.perf_counter()

    def show(stage: str, share: float) -> None:
        if not stages or stages[-1][0] != stage:
            stages.append((stage, time.perf_counter() - start))

    # Its striking face upwards.
    options = {"faces": FACES, "size": SIZE, "unit": "m", "up": "x"}
    result = baking.bake(source, out, **options, on_progress=show)
    pieces.read_pieces = keep
    seconds = time.perf_counter() - start
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(json.dumps({
        "seconds": seconds, "memory_gib": memory, "report": result.report,
        "stages": {a: b1 - b0 for (a, b0), (_, b1) in pairwise(stages)},
    }))  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--child", nargs=2, metavar=("SOURCE", "OUT"))
    parser.add_argument("--out", type=Path, help="where to leave the baked folder")
    arguments = parser.parse_args()
    if arguments.child:
        _child(*arguments.child)
        return
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "hammer.ply"
        count = write_ply(source)
        out = arguments.out or Path(folder) / "baked"
        done = subprocess.run(
            [sys.executable, __file__, "--child", str(source), str(out)],
            check=True, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
    found = json.loads(done.stdout.splitlines()[-1])
    report = found["report"]
    print(f"{count:,} triangles -> {report['faces']}, texture {report['texture_size']}")
    for stage, seconds in found["stages"].items():
        print(f"  {stage:<10}{seconds:7.2f} s")
    for key, bar in BARS.items():
        verdict = "held" if found[key] <= bar else "MISSED"
        print(f"{key}: {found[key]:.2f}, bar {bar:g}: {verdict}")
    error = report["error_um"]
    print(f"coverage {100 * report['coverage']:.4g} %; against the full mesh: rms "
          f"{error['rms']:.3g}, p99 {error['p99']:.3g}, max {error['max']:.4g} um "
          f"(relief {1e6 * RELIEF:g} um rms)")  # fmt: skip
    for note in report["notes"]:
        print(f"  {note}")


if __name__ == "__main__":
    main()
