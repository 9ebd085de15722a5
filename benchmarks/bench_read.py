"""Reading of users' files beside the library underneath, as ratios of one run.

Each file is read by turns by asperity and by the library that parses it; medians of the times are
compared. "same work" does with the library what asperity does with its result: heights as 64-bit
metres, and a look for missing values. Files have a quarter, one and four million samples, points
and poses a quarter and one million. A picture of 100 million samples is read in a process of its
own. Run by `python benchmarks/bench_read.py`.
"""

from __future__ import annotations

import argparse
import gc
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
import trimesh
from numpy.typing import NDArray
from PIL import Image

from asperity.baking.points import read_points
from asperity.geometry.mesh.files import read_contents
from asperity.scene.trajectory_file import read_poses
from asperity.texture.files.reading import read_heights

MOST = 1.2
"""Ratio that is aimed at."""
LARGE, SECONDS, GIB = 10_000, 10.0, 4.0
"""Side of the large picture, and what it may take."""
Read = Callable[[], Any]


def metres(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return values as 64-bit heights, looked through for missing ones and scaled."""
    heights = np.array(values, dtype=np.float64)
    if not np.isfinite(heights.min() + heights.max()):
        raise ValueError
    heights *= 1e-6
    return heights


def surface(side: int) -> NDArray[np.float64]:
    """Return heights [um] of a rough surface (side, side)."""
    v, u = np.mgrid[0:side, 0:side]
    noise = np.random.default_rng(0).normal(size=(side, side))
    return np.asarray(20.0 * np.sin(u / 30.0) * np.cos(v / 40.0) + 0.1 * noise)


def heights(folder: Path, side: int) -> dict[str, tuple[Read, Read, Read]]:
    """Return readers of maps: asperity's, the library's, and the library's with the same work."""
    values = surface(side)
    levels = np.round((values - values.min()) / np.ptp(values) * 65535).astype(np.uint16)
    paths = {kind: folder / f"{side}.{kind}" for kind in ("tif", "png", "npy", "csv")}
    tifffile.imwrite(paths["tif"], values.astype(np.float32))
    Image.fromarray(levels).save(paths["png"])
    np.save(paths["npy"], values)
    scale = {"pixel_size": 1e-5}

    def library(kind: str) -> Any:
        match kind:
            case "tif":
                return tifffile.imread(paths[kind])
            case "png":
                return np.asarray(Image.open(paths[kind]))
            case "npy":
                return np.load(paths[kind])
            case _:
                return np.loadtxt(paths[kind], delimiter=",")

    kinds = {"tif": {"unit": "um"}, "png": {"height_range": 4e-5}, "npy": {"unit": "um"}}
    if side <= 1000:
        np.savetxt(paths["csv"], values, delimiter=",", fmt="%.6g")
        kinds["csv"] = {"unit": "um"}
    return {
        f"heights, {kind}": (
            lambda kind=kind, options=options: read_heights(paths[kind], **scale, **options),  # type: ignore[arg-type]
            lambda kind=kind: library(kind),
            lambda kind=kind: metres(library(kind)),
        )
        for kind, options in kinds.items()
    }  # type: ignore[return-value]


def rows(folder: Path, count: int) -> dict[str, tuple[Read, Read, Read]]:
    """Return readers of points and poses."""
    rng = np.random.default_rng(1)
    np.savetxt(folder / f"{count}.xyz", rng.uniform(-20, 20, (count, 3)), fmt="%.4f")
    steps = np.cumsum(rng.normal(size=(count, 3)) * 1e-6, axis=0)
    poses = np.column_stack([np.arange(count) * 1e-3, steps, np.tile([1, 0, 0, 0], (count, 1))])
    names = "time,x,y,z,qw,qx,qy,qz"
    path = folder / f"{count}.csv"
    np.savetxt(path, poses, delimiter=",", header=names, comments="", fmt="%.9g")

    def points() -> Any:
        return np.loadtxt(folder / f"{count}.xyz")

    def table() -> Any:
        return np.loadtxt(path, delimiter=",", skiprows=1)

    def checked() -> Any:
        values = table()
        turns = values[:, 4:]
        off = np.abs(np.linalg.norm(turns, axis=1) - 1.0)
        inside = np.abs(np.einsum("ij,ij->i", turns[1:], turns[:-1])).min()
        return np.isfinite(values).all(), (np.diff(values[:, 0]) > 0.0).all(), off.max(), inside

    return {
        "points, xyz": (lambda: read_points(folder / f"{count}.xyz"), points, points),
        "poses, csv": (lambda: read_poses(path), table, checked),
    }


def meshes(folder: Path, subdivisions: int) -> dict[str, tuple[Read, Read, Read]]:
    """Return readers of meshes."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.02)
    out: dict[str, tuple[Read, Read, Read]] = {}
    for kind in ("obj", "ply", "stl", "glb"):
        path = folder / f"{subdivisions}.{kind}"
        ball.export(path)
        library = lambda path=path: trimesh.load(path, process=False)  # noqa: E731
        out[f"meshes, {kind}"] = (lambda path=path: read_contents(path), library, library)  # type: ignore[misc]
    return out


def medians(readers: tuple[Read, ...], times: int) -> list[float]:
    """Return the median time of each reader [s], read by turns."""
    taken: list[list[float]] = [[] for _ in readers]
    for turn in range(times + 1):
        for which, read in enumerate(readers):
            gc.collect()
            start = time.perf_counter()
            read()
            if turn:  # the first turn imports and compiles
                taken[which].append(time.perf_counter() - start)
    return [float(np.median(one)) for one in taken]


def read_large(path: Path) -> None:
    """Read one large picture and print the time and the largest memory."""
    start = time.perf_counter()
    read_heights(path, pixel_size=1e-6, height_range=1e-4)
    seconds = time.perf_counter() - start
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"100 million samples, 8-bit PNG: {seconds:.1f} s, {memory:.2f} GiB")
    raise SystemExit(int(seconds > SECONDS or memory > GIB))


def large(folder: Path) -> int:
    """Write a large picture and read it in a process of its own; return 1 if it takes too much."""
    values = surface(1000)
    share = ((values - values.min()) / np.ptp(values) * 255).astype(np.uint8)
    path = folder / "large.png"
    repeat = LARGE // len(share)
    Image.fromarray(np.tile(share, (repeat, repeat))).save(path, compress_level=1)
    done = subprocess.run([sys.executable, __file__, "--large", path], check=False)
    return done.returncode


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--times", type=int, default=5, metavar="N", help="turns of each reader")
    parser.add_argument("--only", default="", metavar="WORD", help="kinds with this word")
    parser.add_argument("--large", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.large:
        read_large(options.large)
    missed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(
            "| file | samples | asperity [ms] | library | library, same work | ratio | same work |"
        )
        print("|---|---|---|---|---|---|---|")
        sizes: list[tuple[int, Callable[[], dict[str, tuple[Read, Read, Read]]]]] = [
            *((side**2, lambda side=side: heights(folder, side)) for side in (500, 1000, 2000)),
            *((n, lambda n=n: rows(folder, n)) for n in (20_000, 200_000)),
            *((20 * 4**n, lambda n=n: meshes(folder, n)) for n in (4, 6)),
        ]
        for count, make in sizes:
            for kind, readers in make().items():
                if options.only not in kind:
                    continue
                ours, plain, same = medians(readers, options.times)
                shown = " | ".join(f"{1e3 * t:.1f}" for t in (ours, plain, same))
                print(f"| {kind} | {count} | {shown} | {ours / plain:.2f} | {ours / same:.2f} |",
                      flush=True)  # fmt: skip
                missed |= ours > MOST * same
        if not options.only:
            missed |= large(folder)
    return int(missed)


if __name__ == "__main__":
    raise SystemExit(main())
