"""Hostile input: code 2, one line with the value and what is valid, and not a file more or less."""

import dataclasses
import errno
import os
import signal
import subprocess
import sys
import threading
import typing

import numpy as np
import pytest
import xarray as xr

import asperity
from asperity import AsperityError
from asperity.cli import main
from asperity.cli.main import COMMANDS
from asperity.cli.options import SI_FACTORS, Range, check_ranges, in_si
from asperity.cli.realtime_run import DeviceOptions
from asperity.cli.study import HandOptions, StudyCommand
from asperity.cli.view import ViewCommand
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.sampled import offset_surface
from asperity.geometry.offsets.surface import drop_point
from asperity.studies.otaduy_lin_2004 import studies
from asperity.studies.otaduy_lin_2004.drags import Condition, DragSimulator


def everything(folder):
    return {path: path.lstat().st_mtime_ns for path in folder.rglob("*")}


def refused(capsys, folder, *arguments, out="new/out"):
    """Run a command that must be refused; return its one line."""
    before = everything(folder)
    assert main([*map(str, arguments), "--out", os.path.join(folder, out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1, said.err
    assert said.err.startswith("asperity: error: ")
    assert everything(folder) == before
    return said.err


# --- numbers ------------------------------------------------------------------------------------

POSITIVE = [
    ("--diameters-mm", "0.05 and 50 mm"),
    ("--forces-n", "0.001 and 100 N"),
    ("--speeds-mm-s", "0.1 and 10000 mm/s"),
    ("--amplitude-mm", "0.0001 and 10 mm"),
    ("--element-height-mm", "0.001 and 10 mm"),
    ("--height-range-mm", "0.0001 and 10 mm"),
    ("--hand.mass-kg", "0.001 and 10 kg"),
    ("--hand.stiffness-n-m", "10 and 100000 N/m"),
    ("--hand.damping-n-s-m", "0.01 and 100 N s/m"),
]


@pytest.mark.parametrize("value", ["-1.0", "0.0", "nan", "inf", "1e-12", "1e+300"])
@pytest.mark.parametrize(("option", "valid"), POSITIVE)
def test_numbers_out_of_range(option, valid, value, capsys, tmp_path):
    line = refused(capsys, tmp_path, "study", "diameter", option, value)
    assert f"{option} must lie between {valid}, got {value}" in line


@pytest.mark.parametrize(
    ("option", "values", "words"),
    [
        ("--spacing-range-mm", ["0", "3"], ["--spacing-range-mm", "0.05 and 20", "got 0.0"]),
        ("--spacing-range-mm", ["-1", "3"], ["--spacing-range-mm", "0.05 and 20", "got -1.0"]),
        ("--spacing-range-mm", ["1", "nan"], ["--spacing-range-mm", "0.05 and 20", "got nan"]),
        ("--spacing-range-mm", ["3", "1"], ["must rise", "3 to 1 mm"]),
        ("--spacings", ["0"], ["--spacings", "5 and 1000", "got 0"]),
        ("--spacings", ["100000"], ["--spacings", "5 and 1000", "got 100000"]),
        ("--spacings", ["abc"], ["--spacings must be a whole number", "'abc'"]),
        ("--diameters-mm", [], ["diameter", "at least one"]),
        ("--diameters-mm", ["3", "2"], ["diameter", "rise", "[0.003, 0.002]"]),
        ("--band-hz", ["20", "inf"], ["--band-hz", "0.1 and 10000", "got inf"]),
        ("--band-hz", ["200", "20"], ["band", "rise", "200 to 20 Hz"]),
        ("--band-hz", ["20"], ["--band-hz", "2 values"]),
        ("--seed", ["-1"], ["--seed", "0 and 2147483647", "got -1"]),
        ("--jitter", ["1.5"], ["--jitter", "0 and 1", "got 1.5"]),
        ("--colour", ["red"], ["--colour"]),
    ],
)
def test_other_options(option, values, words, capsys, tmp_path):
    line = refused(capsys, tmp_path, "study", "diameter", option, *values)
    assert all(word in line for word in words)


# A dataclass for each command, and the two of nested options.
OPTIONS = [
    *(typing.get_args(command)[0] for command in typing.get_args(COMMANDS)), HandOptions,
    DeviceOptions,
]  # fmt: skip
UNIT_BY_NAME = {"s": ("seconds", "start"), "Hz": ("rate",)}
"""Options whose name means their unit without ending in it."""


@pytest.mark.parametrize("options", OPTIONS)
def test_every_number_has_its_range(options):
    hints = typing.get_type_hints(options, include_extras=True)
    for field in dataclasses.fields(options):
        hint = hints[field.name]
        kind = str(typing.get_args(hint)[0] if hasattr(hint, "__metadata__") else hint)
        numeric = "float" in kind or "int" in kind
        bounds = [part for part in getattr(hint, "__metadata__", ()) if isinstance(part, Range)]
        # Levels are counted in the file itself; `bake` knows the file's triangles.
        exempt = field.name in ("level", "faces", "size")
        assert bool(bounds) == numeric or exempt, field.name
        for bound in bounds:
            assert bound.unit in SI_FACTORS
            unit_by_name = field.name in UNIT_BY_NAME.get(bound.unit, ())
            assert not bound.unit or unit_by_name or field.name.endswith(bound.suffix), field.name
        values = field.default if isinstance(field.default, tuple) else (field.default,)
        for bound in bounds:
            assert all(value is None or bound.low <= value <= bound.high for value in values)


def test_options_in_si_units_lose_the_unit_in_their_name():
    si = in_si(StudyCommand("force", speeds_mm_s=(42.0, 83.0), band_hz=(20.0, 200.0)))
    assert si.speeds == (42.0 * 1e-3, 83.0 * 1e-3)
    assert si.band == (20.0, 200.0)
    assert si.height_range is None
    assert in_si(HandOptions(mass_kg=0.2)).mass == 0.2


def test_a_nested_option_is_named_as_it_is_typed():
    with pytest.raises(AsperityError, match=r"^--rate-hz must lie between 100 and 20000 Hz"):
        check_ranges(ViewCommand(options=DeviceOptions(rate_hz=5.0)))
    with pytest.raises(AsperityError, match=r"^--hand\.mass-kg must lie"):
        check_ranges(StudyCommand("force", hand=HandOptions(mass_kg=0.0)))


# --- choices ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["study", "diametre"], ["'diametre'", "diameter, force, speed, models, all"]),
        (["study", ""], ["''", "diameter, force, speed, models, all"]),
        (["study", "force", "--surface", "Sinus"], ["'Sinus'", "trapezoid, square, dots"]),
        (["study", "force", "--surface", ""], ["''", "trapezoid, square, dots"]),
        (["study", "force", "--metric", "loud"], ["'loud'", "max_acceleration", "band_rms"]),
    ],
)
def test_unknown_names_list_the_known(arguments, words, capsys, tmp_path):
    line = refused(capsys, tmp_path, *arguments)
    assert all(word in line for word in words)


# --- files of heights ---------------------------------------------------------------------------

NOISE = np.random.default_rng(0).normal(size=300) * 1e-6
THREE_WAVES = 1e-6 * np.sin(2 * np.pi * np.arange(36) / 12)


def huge(path):
    with path.open("wb") as file:
        file.truncate(2**34)


def with_gap(path):
    np.savetxt(path, np.where(np.arange(300) == 7, np.nan, NOISE))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, ["no such file"]),
        (lambda path: path.touch(), ["empty"]),
        (lambda path: path.mkdir(), ["folder", "valid: a file"]),
        (lambda path: path.write_bytes(bytes(range(256))), ["cannot be read as a .txt file"]),
        (lambda path: path.symlink_to(path), ["no such file"]),
        (huge, ["too many", "at most"]),
        (with_gap, ["1 of 300 values", "NaN", "valid: missing='fill'"]),
        (lambda path: path.write_text("1e-4\n"), ["2 samples or more", "(1, 1)"]),
        (lambda path: path.write_text("1e-4\n" * 3), ["constant"]),
        (lambda path: np.savetxt(path, NOISE[:5]), ["12 samples", "got 5"]),
        (lambda path: np.savetxt(path, NOISE * 1e9), ["too steep", "at most 50"]),
        (lambda path: np.savetxt(path, THREE_WAVES), ["of diameter 4 mm", "at most 1.5 mm"]),
    ],
)
def test_files_of_heights(make, words, capsys, tmp_path):
    path = tmp_path / "heights.txt"
    make(path)
    line = refused(capsys, tmp_path, "study", "diameter", "--surface", path)
    assert all(word in line for word in words), line


def test_a_map_that_is_flat_along_the_path(capsys, tmp_path):
    heights = np.zeros((100, 300))
    heights[:5] = NOISE
    np.save(tmp_path / "flat.npy", heights)
    line = refused(capsys, tmp_path, "study", "force", "--surface", tmp_path / "flat.npy")
    assert "flat for a probe of 3 mm at spacing 0.5 mm" in line
    assert "relief" in line


def test_a_hand_that_rests_all_the_time():
    simulator = DragSimulator(hand=Hand(0.05, 10.0, 3.0))
    with pytest.raises(AsperityError, match=r"stays in a notch under 100 N at spacing 0\.5 mm"):
        simulator.motion(Condition(0.5e-3, 3e-3, 100.0, 0.083))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: offset_surface([0.0, np.nan], 1e-3, 1e-3),
            ["1 NaN", "of 2"],
        ),
        (
            lambda: offset_surface([0.0], 1e-3, 1e-3),
            ["2 samples", "(1,)"],
        ),
        (
            lambda: offset_surface(NOISE, 1e-3, 1.0),
            ["1000 mm", "at most 300 mm"],
        ),
        (
            lambda: offset_surface(NOISE, 1e-3, 0.1, border=3),
            ["3", "wrap, mirror"],
        ),
        (
            lambda: Sinusoid("high", 1e-3),
            ["amplitude", "'high'", "above 0"],
        ),
        (
            lambda: Sinusoid(1e-4, None),
            ["spacing", "None", "above 0"],
        ),
        (
            lambda: Grating(1e-4, [1e-3]),
            ["spacing", "[0.001]", "above 0"],
        ),
        (lambda: Hand(10**400), ["mass", "above 0"]),
        (lambda: Hand(mass=0.0), ["mass", "0.0", "above 0"]),
        (
            lambda: drop_point(-1.0, height=1e-4),
            ["diameter", "-1.0", "above 0"],
        ),
        (lambda: asperity.read_heights("~no one/a.txt"), ["~no one", "no such file"]),
    ],
)
def test_the_python_interface(call, words):
    with pytest.raises(AsperityError) as caught:
        call()
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in words)


# --- runs that are to be heard ------------------------------------------------------------------


def a_run(path, **changes):
    wave = np.sin(2 * np.pi * np.arange(256) / 256)
    data = {
        "acceleration": (("level", "spacing", "phase"), wave[None, None]),
        "max_acceleration": (("level", "spacing"), [[1.0]]),
        "record_length": (("level", "spacing"), [[0.02]]),
        "force": ("level", [0.5], {"units": "N"}),
    }
    attrs = {"schema": 1, "study": "force", "factor": "force"} | changes
    xr.Dataset(data, {"spacing": [1e-3]}, attrs).to_netcdf(path, engine="h5netcdf")


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--seconds", "0", ["0.05 and 60", "got 0.0"]),
        ("--seconds", "1e9", ["0.05 and 60", "got 1000000000.0"]),
        ("--seconds", "nan", ["0.05 and 60", "got nan"]),
        ("--rate", "0", ["1000 and 192000", "got 0"]),
        ("--spacing-mm", "-1", ["0.001 and 1000", "got -1.0"]),
        ("--level", "7", ["between 0 and 0", "got 7"]),
        ("--level", "x", ["--level", "'x'"]),
    ],
)
def test_options_of_sound(option, value, words, capsys, tmp_path):
    a_run(tmp_path / "run.nc")
    line = refused(capsys, tmp_path, "sound", tmp_path / "run.nc", option, value)
    assert all(word in line for word in words)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, ["no such file"]),
        (lambda path: path.touch(), ["empty"]),
        (lambda path: path.mkdir(), ["folder"]),
        (lambda path: path.write_bytes(bytes(range(256))), ["cannot be read as a dataset"]),
        (lambda path: a_run(path, schema=99), ["not written by asperity", "99"]),
    ],
)
def test_files_of_sound(make, words, capsys, tmp_path):
    make(tmp_path / "run.nc")
    line = refused(capsys, tmp_path, "sound", tmp_path / "run.nc")
    assert "run.nc" in line
    assert all(word in line for word in words)


# --- folders for the results --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("plain", ["plain is a file", "--out"]),
        ("plain/a/b", ["plain is a file", "--out"]),
        ("/proc/none/a", ["/proc/none", "cannot write"]),
        ("full", ["full is not empty", "--overwrite"]),
        ("x" * 300, ["xxx", "cannot write", "too long"]),
    ],
)
@pytest.mark.parametrize("command", ["study", "sound"])
def test_folders_that_cannot_be_written(command, out, words, capsys, tmp_path):
    if out.startswith("/proc") and not os.path.isdir("/proc"):
        pytest.skip("needs /proc")
    (tmp_path / "plain").touch()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / ".mine").touch()
    a_run(tmp_path / "run.nc")
    what = ["study", "force"] if command == "study" else ["sound", tmp_path / "run.nc"]
    line = refused(capsys, tmp_path, *what, out=out)
    assert all(word in line for word in words), line


def test_a_disk_that_fills_up(capsys, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(studies, "run_study", full)
    line = refused(capsys, tmp_path, "study", "force")
    assert str(tmp_path) in line
    assert os.strerror(errno.ENOSPC) in line


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signals_leave_nothing(name, capsys, tmp_path, monkeypatch):
    number = getattr(signal, name, None)
    if number is None:
        pytest.skip(f"this system has no {name}")
    # Under nohup, or behind `&`, some are ignored, and then our commands ignore them too.
    usual = signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL
    outside = signal.signal(number, usual)

    def stopped(*_, **__):
        signal.raise_signal(number)

    monkeypatch.setattr(studies, "run_study", stopped)
    try:
        assert main(["study", "force", "--out", str(tmp_path / "new" / "out")]) == 130
        assert signal.getsignal(number) == usual
    finally:
        signal.signal(number, outside)
    assert capsys.readouterr().err == "asperity: interrupted; nothing unfinished was kept\n"
    assert everything(tmp_path) == {}


def test_commands_run_in_other_threads_too(capsys):
    codes = []
    thread = threading.Thread(target=lambda: codes.append(main(["--version"])))
    thread.start()
    thread.join()
    assert codes == [0]


# --- surroundings -------------------------------------------------------------------------------


def python(*arguments, stdout=subprocess.PIPE, **variables):
    environment = os.environ | variables
    return subprocess.run(
        [sys.executable, *arguments], env=environment, stdout=stdout, stderr=subprocess.PIPE
    )


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_went_away(unbuffered):
    read, write = os.pipe()
    os.close(read)
    done = python("-m", "asperity", "--help", stdout=write, PYTHONUNBUFFERED=unbuffered)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_terminal_with_few_characters():
    done = python("-m", "asperity", "--help", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, b"")
    done = python("-m", "asperity", "study", "--spacings", "√", PYTHONIOENCODING="ascii")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def test_without_a_writable_cache_nothing_is_cached(tmp_path):
    code = "import asperity._core.kernels as c; print(c.kernel(lambda: 1)._cache.cache_path)"
    (tmp_path / "file").touch()
    done = python("-c", code, NUMBA_CACHE_DIR=str(tmp_path / "file" / "below"))
    # The in-tree cache that Numba falls back to is not keyed by the sources: never that.
    assert done.stdout.strip() == b"None"
    assert b"cannot write to" in done.stderr
    assert b"NUMBA_CACHE_DIR" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("place", [["--log-level", "info"], ["--log-level=info"]])
def test_the_log_level_stands_anywhere(place, capsys):
    assert main(["doctor", *place]) == 0
    assert main([*place, "doctor"]) == 0
    assert main(["doctor", "--log-level"]) == 2
    assert "--log-level" in capsys.readouterr().err


@pytest.mark.parametrize("again", [["--tool", "none.obj"], ["--tool=none.obj"]])
def test_an_option_that_is_given_twice_is_said_to_be(again, capsys, tmp_path):
    """The parser takes the last one, in silence."""
    given = ["--tool", "sphere:3mm", "--target", "box:9mm"]
    assert main(["run", *given, *again, "--out", str(tmp_path / "out")]) == 2
    twice, refused_for = capsys.readouterr().err.splitlines()
    assert twice == "asperity: --tool is given more than once; the last one counts"
    assert "none.obj" in refused_for
