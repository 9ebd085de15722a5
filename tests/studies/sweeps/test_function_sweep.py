"""Functions as what is swept; stores that grow; a limit on time."""

import time

import numpy as np
import pytest

import asperity
from asperity import AsperityError
from asperity.studies.sweeps.run import run_sweep
from asperity.studies.sweeps.store import open_sweep

AXES = {("m", "k"): [(1.0, 2.0), (2.0, 8.0)], "seed": range(3), "kind": ["a", "b"]}


def frequency(m, k, seed, kind):
    if kind == "b" and seed == 2:
        raise RuntimeError("a bad day")
    return {"omega": (k / m) ** 0.5, "noise": seed + 0.5}


def test_a_function_over_rows_crossed_with_axes(tmp_path):
    data = asperity.sweep(frequency, AXES, tmp_path / "a.zarr", workers=0)
    assert dict(data.sizes) == {"m_k": 2, "seed": 3, "kind": 2}
    assert list(data["k"].values) == [2.0, 8.0]
    assert data["m"].dims == ("m_k",)
    assert float(data["omega"].sel(seed=1, kind="a").isel(m_k=1)) == 2.0
    assert (data["state"].sel(kind="b", seed=2) == 2).all()
    assert set(data["error"].sel(kind="b", seed=2).values) == {"RuntimeError: a bad day"}


def test_a_function_on_workers_is_the_same(tmp_path):
    offset = 0.25
    here = asperity.sweep(lambda x: x + offset, {"x": [1.0, 2.0]}, tmp_path / "a.zarr", workers=0)
    there = asperity.sweep(lambda x: x + offset, {"x": [1.0, 2.0]}, tmp_path / "b.zarr", workers=1)
    assert here["value"].equals(there["value"])


def test_a_store_is_extended_without_computing_anew(tmp_path):
    log = tmp_path / "calls"

    def square(x, y):
        with open(log, "a") as file:  # the function that is called is a copy
            file.write(f"{x}{y} ")
        return x * x + y

    path = tmp_path / "a.zarr"
    asperity.sweep(square, {"x": [1, 3], "y": [0, 1]}, path, workers=0)
    axes = {"x": [1, 2, 3, 4], "y": [1, 0]}
    with pytest.raises(AsperityError, match="--extend if it only has other values"):
        asperity.sweep(square, axes, path, workers=0)
    log.unlink()
    data = asperity.sweep(square, axes, path, workers=0, extend=True)
    # The first one of all is called to learn the names.
    assert sorted(log.read_text().split()[1:]) == ["20", "21", "40", "41"]
    assert (data["state"] == 1).all()
    np.testing.assert_array_equal(data["value"], [[2, 1], [5, 4], [10, 9], [17, 16]])
    assert "sessions" in data.attrs

    with pytest.raises(AsperityError, match="kind, fixed parameters, function or seed are others"):
        asperity.sweep(lambda x, y: x, {"x": [1], "y": [0]}, path, workers=0, extend=True)


def test_a_study_is_extended_to_what_it_would_have_been(tmp_path):
    def study(speeds):
        return {"schema": 1, "keep": ["band_rms"],
                "vary": {"spacing": [1e-3, 2e-3], "speed": speeds}}  # fmt: skip

    run_sweep(study([0.05, 0.1]), tmp_path / "a.zarr", workers=0)
    grown = run_sweep(study([0.05, 0.07, 0.1]), tmp_path / "a.zarr", workers=0, extend=True)
    assert grown.computed == 2
    run_sweep(study([0.05, 0.07, 0.1]), tmp_path / "b.zarr", workers=0)
    one, other = open_sweep(tmp_path / "a.zarr"), open_sweep(tmp_path / "b.zarr")
    assert all(one[name].identical(other[name]) for name in other.variables)


def test_a_number_is_added_without_computing_anew(tmp_path):
    def study(*keep):
        hands = {"hand": {"mass": [0.05, 0.1, 0.1], "stiffness": [300.0, 300.0, 500.0]}}
        return {"schema": 1, "keep": list(keep), "vary": {"speed": [0.05, 0.1]},
                "zip": {"person": hands}}  # fmt: skip

    path, whole = tmp_path / "a.zarr", tmp_path / "b.zarr"
    run_sweep(study("band_rms"), path, workers=0)
    assert set(open_sweep(path).data_vars) == {"band_rms", "state", "error"}
    with pytest.raises(AsperityError, match="--extend if it only has other values or numbers"):
        run_sweep(study("band_rms", "motion_status"), path, workers=0)
    both = study("band_rms", "motion_status")
    assert run_sweep(both, path, workers=0, extend=True).computed == 0
    run_sweep(both, whole, workers=0)
    one, other = open_sweep(path), open_sweep(whole)
    assert all(one[name].identical(other[name]) for name in other.variables)
    # ... and taken away, and back.
    for keep in (["motion_status"], ["band_rms"]):
        assert run_sweep(study(*keep), path, workers=0, extend=True).computed == 0
    assert open_sweep(path)["band_rms"].equals(other["band_rms"])


def test_a_client_of_ones_own_is_used_and_left_open(tmp_path):
    distributed = pytest.importorskip("distributed")
    offset = 0.25
    axes = {"x": [1.0, 2.0, 3.0]}
    here = asperity.sweep(lambda x: x + offset, axes, tmp_path / "a.zarr", workers=0)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None,
        host="127.0.0.1",
    ) as cluster, distributed.Client(cluster) as client:  # fmt: skip
        there = asperity.sweep(lambda x: x + offset, axes, tmp_path / "b.zarr", client=client)
        assert client.status == "running"
        with pytest.raises(AsperityError, match="give only one of workers, scheduler and client"):
            asperity.sweep(lambda x: x, {"x": [1.0]}, tmp_path / "c.zarr", client=client, workers=1)
    assert here["value"].equals(there["value"])
    assert '"where": "scheduler"' in there.attrs["sessions"]


def test_what_takes_too_long_fails_with_its_reason(tmp_path):
    def endless(x):
        while x > 1:
            time.sleep(0.01)
        return x

    data = asperity.sweep(endless, {"x": [0, 2, 1]}, tmp_path / "a.zarr", workers=0, limit=0.3)
    assert list(data["state"].values) == [1, 2, 1]
    assert str(data["error"].values[1]) == "took longer than the limit of 0.3 s"


@pytest.mark.parametrize(
    ("axes", "message"),
    [({}, "axes is empty"), ({"x": []}, "at least one row"), ({"x": [1, 1]}, "twice"),
     ({"x": [[1]]}, "numbers or texts"), ({"z": [1]}, "raised TypeError")],
)  # fmt: skip
def test_axes_that_are_not_valid(axes, message, tmp_path):
    with pytest.raises(AsperityError, match=message):
        asperity.sweep(lambda x: x, axes, tmp_path / "a.zarr", workers=0)
    assert not list(tmp_path.iterdir())
