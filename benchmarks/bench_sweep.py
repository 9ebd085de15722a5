"""A sweep of 50,000 drags on two processes, beside a plain loop over the same drags in one.

    python benchmarks/bench_sweep.py

The plain loop calls the same function for each combination, in the same order, and writes nothing.
The sweep has a scheduler, two workers of one thread each, and a client that writes the store.
Both are run by turns; of each the best turn counts, since whatever else runs on the machine only
adds. Printed are the rate, and the parallel efficiency `T_loop / (2 T_sweep)`:

- running: from the first batch to the last block in the store, workers loaded (the bar: 0.85);
- the same of two plain loops at once, each over all drags, with nobody between them: what this
  machine has to give, since two of its cores need not be twice one;
- the whole command: processes started, packages loaded, store made, and closed again;
- the processor's time of both, less that of the same with 100 drags, which is the starting: other
  programs disturb it less than the clock.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BAR = 0.85
WHATS = ("loop", "sweep")
PAIRS = int(os.environ.get("PAIRS", "3"))
STUDY = {
    "schema": 1,
    "kind": "drag",
    "vary": {
        "spacing": {"from": 0.5e-3, "to": 3.5e-3, "count": 200, "scale": "log"},
        "diameter": {"from": 2e-3, "to": 4e-3, "count": 10},
        "normal_force": [0.29, 0.4, 0.58, 0.7, 0.87],
        "speed": [0.042, 0.06, 0.083, 0.12, 0.169],
    },
}
FEW = STUDY | {"vary": STUDY["vary"] | {"spacing": [1e-3, 2e-3], "diameter": [2e-3, 3e-3]}}


def loop(study_: dict[str, object]) -> dict[str, float]:
    """Run all combinations one after the other, in this process."""
    from asperity.studies.sweeps.study import read_study, runner

    study = read_study(study_)
    columns = study.design.columns(range(study.size))
    runs = runner(study.kind, study.fixed, study.folder, study.design.seed)
    keys = list(columns)
    begun = 0.0
    for i, row in enumerate(zip(*columns.values(), strict=True)):
        runs.numbers(dict(zip(keys, row, strict=True)), study.keep)
        if i == 0:
            begun = time.perf_counter()  # kernels are loaded
    return {"running": time.perf_counter() - begun, "size": study.size}


def sweep(study_: dict[str, object]) -> dict[str, float]:
    """Run all combinations on two local workers, into a store."""
    from asperity.studies.sweeps.run import run_sweep
    from asperity.studies.sweeps.study import read_study

    with tempfile.TemporaryDirectory() as folder:
        done = run_sweep(read_study(study_), Path(folder) / "a.zarr", workers=2)
    assert done.done == done.computed == done.total
    return {"running": done.seconds, "size": done.total}


def timed(what: str, size: str = "many") -> dict[str, float]:
    """Run `loop` or `sweep` in a fresh process; return its times [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, __file__, what, size], capture_output=True, text=True, check=True
    )
    whole = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = sum(getattr(after, n) - getattr(before, n) for n in ("ru_utime", "ru_stime"))
    return json.loads(done.stdout) | {"whole": whole, "processor": used}


def two_loops() -> dict[str, float]:
    """Run two plain loops at once, each over all drags; return how long the longer one took [s]."""
    command = [sys.executable, __file__, "loop", "many"]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    both_times = [json.loads(one.communicate()[0]) for one in both]
    return {"running": max(one["running"] for one in both_times)}


def main() -> int:
    """Run the benchmark; return 1 if the bar is missed by more than the machine misses it."""
    if len(sys.argv) > 1:
        study = {"many": STUDY, "few": FEW}[sys.argv[2]]
        print(json.dumps({"loop": loop, "sweep": sweep}[sys.argv[1]](study)))
        return 0
    turns: dict[str, list[dict[str, float]]] = {"loop": [], "sweep": [], "two loops": []}
    for _ in range(PAIRS):
        for what, found in turns.items():
            found.append(two_loops() if what == "two loops" else timed(what))
            print(what, {k: round(v, 2) for k, v in found[-1].items()}, flush=True)
    best = {
        what: {key: min(turn[key] for turn in found) for key in found[0]}
        for what, found in turns.items()
    }
    size = best["loop"]["size"]
    running = best["loop"]["running"] / (2.0 * best["sweep"]["running"])
    whole = best["loop"]["whole"] / (2.0 * best["sweep"]["whole"])
    ceiling = best["loop"]["running"] / best["two loops"]["running"]
    used = {what: best[what]["processor"] - timed(what, "few")["processor"] for what in WHATS}
    print(f"load of the machine: {os.getloadavg()[0]:.1f}; best of {PAIRS} turns of each")
    for what in WHATS:
        print(f"{what}: {size / best[what]['running']:.0f} combinations a second, running")
    print(f"parallel efficiency, running: {running:.2f} (bar: {BAR})")
    print(f"two plain loops at once: {ceiling:.2f}, of which the sweep has {running / ceiling:.2f}")
    print(f"the whole commands, started and ended: {whole:.2f}")
    print(
        f"by the processor's time, starting taken off: {used['loop'] / used['sweep']:.2f} "
        f"({used['loop']:.1f} s beside {used['sweep']:.1f} s)"
    )
    return 0 if running >= BAR * min(ceiling, 1.0) else 1


if __name__ == "__main__":
    sys.exit(main())
