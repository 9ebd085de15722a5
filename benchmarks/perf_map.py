"""Where compiled time goes: names for Linux `perf` of what Numba has compiled.

    perf record -e cpu-clock -F 8000 python benchmarks/perf_map.py probe-plate
    perf report --no-children

`perf` knows machine code made while a program runs by a file `/tmp/perf-PID.map`, which Numba does
not write. Here a scene is loaded, its kernels are taken from the cache (run it twice: the first
time compiles), the file is written, and the scene's own motion is rubbed for some seconds. That
counting references took a third of a tick was seen like this, and in no other way.
"""

from __future__ import annotations

import argparse
import gc
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from numba.core.codegen import CPUCodeLibrary

_loaded: list[tuple[bytes, Any]] = []


def keep_what_is_loaded() -> None:
    """Have every library that comes from the cache be kept with its object code."""
    unserialise = CPUCodeLibrary._unserialize.__func__

    def keeping(cls: Any, codegen: Any, state: Any) -> Any:
        library = unserialise(cls, codegen, state)
        _, kind, data = state
        if kind == "object":
            _loaded.append((data[0], library))
        return library

    CPUCodeLibrary._unserialize = classmethod(keeping)


def write_map() -> int:
    """Write the file that `perf` looks for; return how many functions it names."""
    count = 0
    with Path(f"/tmp/perf-{os.getpid()}.map").open("w") as file:
        for code, library in _loaded:
            symbols = _symbols(code)
            # Kernels that others hold too may lie elsewhere; a way in from Python is in one only.
            symbols.sort(key=lambda symbol: "cpython" not in symbol[2])
            engine = library._codegen._engine._ee
            starts = (engine.get_function_address(name) - at for at, _, name in symbols)
            base = next((start for start in starts if start > 0), None)
            if base is not None:
                file.writelines(f"{base + at:x} {size:x} {name}\n" for at, size, name in symbols)
                count += len(symbols)
    return count


def _symbols(code: bytes) -> list[tuple[int, int, str]]:
    with tempfile.NamedTemporaryFile(suffix=".o") as file:
        file.write(code)
        file.flush()
        listing = subprocess.run(
            ["nm", "-S", "--defined-only", file.name], capture_output=True, text=True, check=True
        ).stdout
    rows = [line.split() for line in listing.splitlines()]
    return [(int(r[0], 16), int(r[1], 16), r[3]) for r in rows if len(r) == 4 and r[2] in "tTwW"]


def main() -> int:
    """Rub a scene for some seconds under `perf`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="probe-plate")
    parser.add_argument("--seconds", type=float, default=8.0)
    options = parser.parse_args()
    keep_what_is_loaded()
    from asperity.scene.builtin import load_scene
    from asperity.simulation.simulation import Simulation

    simulation = Simulation(load_scene(options.scene))
    poses = simulation.rollout().handle_pose
    engine = simulation.stage.engine
    named = write_map()
    if named == 0:
        print("nothing came from the cache: it is compiled now; run this again", file=sys.stderr)
        return 1
    print(f"{named} functions named; rubbing {options.scene} for {options.seconds:g} s")
    gc.disable()  # it would take a share of the samples
    end = time.perf_counter() + options.seconds
    while time.perf_counter() < end:
        for pose in poses:
            engine.wrench(pose, 1e-3)
    return 0


if __name__ == "__main__":
    sys.exit(main())
