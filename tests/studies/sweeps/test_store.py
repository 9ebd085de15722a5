"""What a killed or damaged store is worth: what counts is whole, and the rest is done again."""

import warnings

import numpy as np
import pytest
import xarray as xr

from asperity import AsperityError
from asperity.studies.otaduy_lin_2004.drags import Condition
from asperity.studies.otaduy_lin_2004.studies import StudySettings
from asperity.studies.sweeps import store as stores
from asperity.studies.sweeps.batch import DONE, FAILED
from asperity.studies.sweeps.run import run_sweep
from asperity.studies.sweeps.store import open_sweep
from asperity.studies.sweeps.study import read_study

SPACING = {"from": 0.5e-3, "to": 3.5e-3, "count": 8, "scale": "log"}
STUDY = {
    "schema": 1,
    "kind": "drag",
    "keep": ["max_acceleration", "band_rms"],
    "vary": {"spacing": SPACING, "normal_force": [0.3, 0.6], "speed": [0.05, 0.1, 0.2]},
}
BLOCK = 12
"""Combinations of a block: 2 x 2 x 3."""


@pytest.fixture(scope="module")
def study():
    return read_study(STUDY)


@pytest.fixture(scope="module")
def whole(study, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "whole.zarr"
    run_sweep(study, path, workers=0)
    return open_sweep(path)


def same(path, whole):
    data = open_sweep(path)
    assert (data["state"] == DONE).all()
    return all(data[name].identical(whole[name]) for name in whole.variables)


def test_the_store_is_a_dataset_with_named_dimensions_and_units(whole, study, tmp_path):
    assert dict(whole.sizes) == {"spacing": 8, "normal_force": 2, "speed": 3}
    assert whole["spacing"].attrs["units"] == "m"
    assert whole["band_rms"].attrs["units"] == "m/s²"
    assert whole["state"].dtype == np.int8
    picked = float(whole["band_rms"].sel(speed=0.1, normal_force=0.6).isel(spacing=3))
    condition = Condition(float(whole.spacing[3]), 3e-3, 0.6, 0.1)
    assert picked == StudySettings().simulator().metric("band_rms", condition)
    assert 'kind = "drag"' in whole.attrs["study"]
    # Without our help, and without a word.
    run_sweep(study, tmp_path / "a.zarr", workers=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xr.open_zarr(tmp_path / "a.zarr", chunks=None) as data:
            assert data["band_rms"].identical(whole["band_rms"])
    session = stores.SweepStore(tmp_path / "a.zarr", study).sessions[0]
    assert session["computed"] == 48
    assert session["revision"] is None or len(session["revision"]) >= 40
    assert "numba" in session["program"]


class Killed(BaseException):
    """Stands for the end of the process."""


@pytest.mark.parametrize("after", range(0, 28, 3))
def test_a_sweep_killed_between_any_two_writes_goes_on(study, whole, after, tmp_path, monkeypatch):
    path = tmp_path / "a.zarr"
    left, real = after, stores.SweepStore.write

    def write(self, block, results):
        """Write array by array, as the real one, and die after some of them."""
        nonlocal left
        arrays = dict(self._arrays)

        class Dying:
            def __init__(self, array):
                self.array = array

            def __setitem__(self, place, values):
                nonlocal left
                if left == 0:
                    raise Killed
                left -= 1
                self.array[place] = values

        self._arrays = {name: Dying(array) for name, array in arrays.items()}
        try:
            real(self, block, results)
        finally:
            self._arrays = arrays

    with monkeypatch.context() as patch:
        patch.setattr(stores.SweepStore, "write", write)
        with pytest.raises(Killed):
            run_sweep(study, path, workers=0)
    before = open_sweep(path)
    # A block counts if all its numbers, its errors and its states are there: seven writes a block.
    assert int((before["state"] == DONE).sum()) == after // 7 * BLOCK
    assert np.isfinite(before["band_rms"].values[before["state"].values == DONE]).all()
    written = {f: f.stat().st_mtime_ns for f in path.glob("state/c/**/*") if f.is_file()}
    done = run_sweep(study, path, workers=0)
    assert done.computed == 48 - after // 7 * BLOCK
    assert same(path, whole)
    assert all(f.stat().st_mtime_ns == stamp for f, stamp in written.items())
    assert run_sweep(study, path, workers=0).computed == 0


def test_an_error_text_of_a_killed_write_does_not_survive(study, whole, tmp_path):
    path = tmp_path / "a.zarr"
    with stores.open_store(path, study, block_size=study.block) as store:
        block = store.blocks[0]
        store._arrays["error"][block.slices] = np.full(block.shape, "of another run", object)
    assert run_sweep(study, path, workers=0).computed == 48
    assert same(path, whole)


@pytest.mark.parametrize("name", ["band_rms", "state"])
@pytest.mark.parametrize("damage", ["cut", "flipped", "gone", "empty"])
def test_damaged_chunks_are_done_again(study, whole, name, damage, tmp_path):
    path = tmp_path / "a.zarr"
    run_sweep(study, path, workers=0)
    chunk = sorted(f for f in (path / name / "c").rglob("*") if f.is_file())[1]
    content = bytearray(chunk.read_bytes())
    if damage == "gone":
        chunk.unlink()
    else:
        content[-6] ^= 0x55
        cut = {"cut": len(content) - 5, "empty": 0, "flipped": len(content)}[damage]
        chunk.write_bytes(content[:cut])
    (path / "band_rms" / "c" / f"0.{'0' * 32}.partial").write_bytes(b"torn")
    done = run_sweep(study, path, workers=0)
    assert done.computed == BLOCK
    assert same(path, whole)
    assert not list(path.rglob("*.partial"))


def flat_study(tmp_path):
    """Return a study of which half the combinations fail: there is nothing on one surface."""
    np.save(tmp_path / "flat.npy", np.zeros(64))
    vary = {"surface": ["flat.npy", "sinusoid"], "speed": [0.05, 0.1, 0.2]}
    return read_study(STUDY | {"vary": vary, "keep": ["band_rms"]}, folder=tmp_path)


def test_failures_are_recorded_and_tried_again_if_asked(tmp_path):
    study, path = flat_study(tmp_path), tmp_path / "a.zarr"
    done = run_sweep(study, path, workers=0)
    assert (done.done, done.failed) == (3, 3)
    data = open_sweep(path)
    assert (data["state"].sel(surface="flat.npy") == FAILED).all()
    assert np.isnan(data["band_rms"].sel(surface="flat.npy")).all()
    assert "constant map" in str(data["error"].sel(surface="flat.npy").values[0])
    assert set(data["error"].sel(surface="sinusoid").values) == {""}
    assert "constant map" in done.first_error
    assert run_sweep(study, path, workers=0).computed == 0
    again = run_sweep(study, path, workers=0, retry_failed=True)
    assert (again.computed, again.failed) == (3, 3)
    assert open_sweep(path).drop_attrs().identical(data.drop_attrs())


def test_a_retry_that_comes_right_takes_the_error_away(study, whole, tmp_path, monkeypatch):
    from asperity.studies.sweeps.drag_runs import DragRuns

    path, plain = tmp_path / "a.zarr", DragRuns.numbers

    def shaky(self, varied, keep, more):
        if varied["speed"] == 0.1:
            raise RuntimeError("a bad\nday")
        return plain(self, varied, keep, more)

    with monkeypatch.context() as patch:
        patch.setattr(DragRuns, "numbers", shaky)
        assert run_sweep(study, path, workers=0).failed == 16
    texts = set(open_sweep(path)["error"].sel(speed=0.1).values.ravel())
    assert texts == {"RuntimeError: a bad day"}
    assert run_sweep(study, path, workers=0, retry_failed=True).computed == 16
    assert same(path, whole)


def test_a_store_is_kept_from_other_studies_versions_and_writers(study, tmp_path, monkeypatch):
    path = tmp_path / "a.zarr"
    run_sweep(study, path, workers=0)
    other = read_study(STUDY | {"fixed": {"diameter": 2e-3}})
    with pytest.raises(AsperityError, match="holds another study, 'sweep'"):
        run_sweep(other, path, workers=0)
    with (
        stores.open_store(path, study, block_size=16),
        pytest.raises(AsperityError, match="another sweep writes to"),
    ):
        run_sweep(study, path, workers=0)
    with monkeypatch.context() as patch:
        patch.setattr(stores, "program", lambda: "asperity 9.9")
        with pytest.raises(AsperityError, match=r"was begun by asperity 0.*--any-version"):
            run_sweep(study, path, workers=0)
        assert run_sweep(study, path, workers=0, any_version=True).computed == 0
    assert run_sweep(other, path, workers=0, overwrite=True).computed == 48
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zarr"]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("")
    with pytest.raises(AsperityError, match="no store of a sweep"):
        run_sweep(study, tmp_path / "mine", workers=0, overwrite=True)
    for wrong in (tmp_path / "mine", tmp_path / "none"):
        with pytest.raises(AsperityError, match=r"no (store of a sweep|such store)"):
            open_sweep(wrong)


def test_labels_and_samples_are_coordinates(tmp_path):
    vary = {
        "hand": {"mass": {"from": 0.02, "to": 0.2, "scale": "log"}},
        "band": [[20.0, 200.0], [50.0, 400.0]],
    }
    design = {"kind": "latin-hypercube", "count": 8}
    study = read_study(STUDY | {"vary": vary, "design": design})
    run_sweep(study, tmp_path / "a.zarr", workers=0)
    data = open_sweep(tmp_path / "a.zarr")
    assert dict(data.sizes) == {"sample": 8, "band": 2}
    assert list(data["band"].values) == ["20, 200", "50, 400"]
    assert data["hand.mass"].dims == ("sample",)
    assert "hand.mass" in data.coords
    assert data["hand.mass"].attrs["units"] == "kg"
    data.drop_vars("error").to_netcdf(tmp_path / "a.nc", engine="h5netcdf")


def test_without_its_packages_one_line_says_what_to_install(study, tmp_path, monkeypatch):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(AsperityError, match=r"sweeps need zarr.*pip install 'asperity\[sweep\]'"):
        run_sweep(study, tmp_path / "a.zarr")
    with pytest.raises(AsperityError, match=r"pip install 'asperity\[sweep\]'"):
        open_sweep(tmp_path)
