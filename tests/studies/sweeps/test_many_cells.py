"""A hundred thousand cheap combinations: their time grows in proportion, their memory stays.

pytest -m slow -s tests/studies/sweeps/test_many_cells.py. That two workers reach what two plain
loops do: benchmarks/bench_sweep.py.
"""

import json
import subprocess
import sys

import pytest
from clusters import environment

pytestmark = pytest.mark.slow

_CHILD = """
import json, resource, sys, time
import asperity
from asperity.studies.sweeps.function_runs import sweep

def cheap(x, y):
    return {"sum": x + y, "product": x * y}

if __name__ == "__main__":
    path, count, workers = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    axes = {"x": range(count // 100), "y": [0.5 * i for i in range(100)]}
    sweep(cheap, {"x": range(2), "y": [0.5]}, path + "-first", workers=0)  # imports
    spent = []
    for turn in ("new", "again"):
        begun = time.perf_counter(), time.process_time()
        data = sweep(cheap, axes, path, workers=workers)
        spent.append((time.perf_counter() - begun[0], time.process_time() - begun[1]))
    assert (data["state"] == 1).all() and float(data["sum"][-1, -1]) == count // 100 - 1 + 49.5
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(json.dumps({"spent": spent, "size": size}))
"""


def measured(folder, count, workers):
    """Return time and time of the processor [s], anew and with all in the store, and MB."""
    script = folder / "cheap.py"
    script.write_text(_CHILD)
    done = subprocess.run(
        [sys.executable, str(script), str(folder / f"{count}-{workers}.zarr"), str(count),
         str(workers)],
        capture_output=True, text=True, env=environment(),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    print(count, workers, found)
    return found


@pytest.mark.parametrize("workers", [0, 2])
def test_ten_times_as_many_take_ten_times_as_long(workers, tmp_path):
    few, many = (measured(tmp_path, count, workers) for count in (10_000, 100_000))
    assert many["size"] < 400.0
    # The processor's time: others on the machine disturb it less. Starting takes some, too.
    (few_new, few_again), (many_new, many_again) = few["spent"], many["spent"]
    assert many_new[1] < 12.0 * few_new[1]
    assert many_again[1] < 12.0 * few_again[1]
