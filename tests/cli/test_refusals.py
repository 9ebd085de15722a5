"""Bad input: exit code 2, one line that names the value and what is valid, nothing left behind."""

import numpy as np
import pytest

from asperity.cli import main


def refuse(arguments, capsys, tmp_path):
    """Run a command that must refuse; return its one line."""
    before = sorted(tmp_path.rglob("*"))
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    lines = [line for line in said.splitlines() if line.startswith("asperity: error:")]
    assert len(lines) == 1
    assert "Traceback" not in said
    assert said.rstrip().endswith(lines[0])
    assert sorted(tmp_path.rglob("*")) == before
    return lines[0]


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (["--diameters-mm", "-2"], ["--diameters-mm", "-2.0", "between 0.05 and 50"]),
        (["--diameters-mm", "0"], ["--diameters-mm", "got 0.0", "between 0.05 and 50"]),
        (["--diameters-mm", "nan"], ["--diameters-mm", "got nan", "between 0.05 and 50"]),
        (
            ["--spacing-range-mm", "0", "3"],
            ["--spacing-range-mm", "got 0.0", "between 0.05 and 20"],
        ),
        (["--spacing-range-mm", "-1", "3"], ["--spacing-range-mm", "-1.0", "between 0.05 and 20"]),
        (["--spacing-range-mm", "3", "1"], ["spacing_range", "3 to 1 mm", "rise"]),
        (["--spacings", "2"], ["--spacings", "got 2", "between 5 and 1000"]),
        (["--spacings", "many"], ["many", "a whole number"]),
        (["--forces-n", "0"], ["--forces-n", "got 0.0", "between 0.001 and 100"]),
        (["--speeds-mm-s", "-5"], ["--speeds-mm-s", "-5.0", "between 0.1 and 10000"]),
        (["--hand.mass-kg", "0"], ["--hand.mass-kg", "got 0.0", "between 0.001 and 10"]),
        (["--hand.mass-kg", "-1"], ["--hand.mass-kg", "-1.0", "between 0.001 and 10"]),
        (
            ["--hand.damping-n-s-m", "0"],
            ["--hand.damping-n-s-m", "got 0.0", "between 0.01 and 100"],
        ),
        (["--amplitude-mm", "-0.1"], ["--amplitude-mm", "-0.1", "between 0.0001 and 10"]),
        (["--band-hz", "200", "20"], ["band", "200 to 20 Hz", "rise"]),
        (["--surface", "sinusoids"], ["surface", "sinusoids", "sinusoid", "dots"]),
        (["--metric", "loudness"], ["metric", "loudness", "band_rms"]),
        (["--surface", "dots", "--jitter", "2"], ["jitter", "2.0", "between 0 and 1"]),
        (["--surface", "self-affine", "--hurst", "1.5"], ["hurst", "1.5"]),
    ],
)
def test_bad_options_of_a_study(options, names, capsys, tmp_path):
    line = refuse(["study", "force", *options], capsys, tmp_path)
    for name in names:
        assert name in line


def test_unknown_study_lists_them(capsys, tmp_path):
    line = refuse(["study", "diametre"], capsys, tmp_path)
    assert "'diametre'" in line
    assert "diameter, force, speed, models, all" in line


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda path: None, ["no such file", "heights.npy"]),
        (lambda path: path.write_bytes(b""), ["empty"]),
        (lambda path: path.write_bytes(b"\x93NUMPY nonsense"), ["cannot be read"]),
        (lambda path: path.mkdir(), ["folder"]),
        (lambda path: np.save(path, np.full((20, 20), np.nan)), ["400", "NaN"]),
        (lambda path: np.save(path, np.zeros(1)), ["2 samples"]),
        (lambda path: np.save(path, np.ones((30, 30))), ["constant"]),
    ],
)
def test_bad_files_of_heights(make, names, capsys, tmp_path):
    path = tmp_path / "heights.npy"
    make(path)
    line = refuse(["study", "force", "--surface", str(path)], capsys, tmp_path)
    for name in names:
        assert name.lower() in line.lower()


def test_a_probe_wider_than_the_map(capsys, tmp_path):
    u = np.arange(60) / 12.0
    np.save(tmp_path / "narrow.npy", np.tile(1e-5 * np.sin(2 * np.pi * u), (20, 1)))
    options = ["--surface", str(tmp_path / "narrow.npy"), "--diameters-mm", "2", "40"]
    line = refuse(["study", "diameter", *options], capsys, tmp_path)
    assert "40 mm" in line
    assert "at most" in line


@pytest.mark.parametrize("kind", ["file", "below a file", "full"])
def test_folders_that_cannot_be_written(kind, capsys, tmp_path):
    (tmp_path / "plain").write_text("1")
    out = {"file": "plain", "below a file": "plain/out", "full": "."}[kind]
    arguments = ["study", "force", "--spacings", "5", "--out", str(tmp_path / out)]
    assert main(arguments) == 2
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.startswith("asperity: error:")
    assert str(tmp_path) in line
    assert [path.name for path in tmp_path.iterdir()] == ["plain"]
    assert (tmp_path / "plain").read_text() == "1"


@pytest.mark.parametrize(
    ("content", "names"),
    [
        (None, ["no such file"]),
        (b"", ["empty"]),
        (b"not a dataset", ["cannot be read as a dataset"]),
    ],
)
def test_bad_input_of_sound(content, names, capsys, tmp_path):
    path = tmp_path / "run.nc"
    if content is not None:
        path.write_bytes(content)
    line = refuse(["sound", str(path)], capsys, tmp_path)
    assert "run.nc" in line
    for name in names:
        assert name in line


@pytest.mark.parametrize("arguments", [[], ["studdy"], ["sweep"], ["study", "force", "--colour"]])
def test_words_that_make_no_command(arguments, capsys):
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("asperity: error:")
    assert len(said.splitlines()) == 1


def test_interruption_leaves_nothing(capsys, tmp_path, monkeypatch):
    import asperity.studies.otaduy_lin_2004.studies as studies

    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(studies, "run_study", interrupted)
    assert main(["study", "force", "--out", str(tmp_path / "out")]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_demo_needs_its_data_folder(capsys, tmp_path):
    line = refuse(["demo", "--data", str(tmp_path / "nowhere")], capsys, tmp_path)
    assert "nowhere" in line


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (["--hands", "3"], ["--hands", "power of 2", "got 3"]),
        (["--spacings", "4"], ["--spacings", "got 4", "between 8 and 200"]),
        (["--data", "nowhere"], ["no such folder of measured surfaces", "nowhere"]),
        (["--docs", "nowhere"], ["nowhere", "no images/"]),
    ],
)
def test_bad_options_of_findings(options, names, capsys, tmp_path):
    line = refuse(["findings", *options], capsys, tmp_path)
    for name in names:
        assert name in line


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("run probe-plate --seconds abc", "--seconds must be a number, got 'abc'"),
        ("run probe-plate --rate-hz abc", "--rate-hz must be a number, got 'abc'"),
        ("run probe-plate --seed 1.5", "--seed must be a whole number, got '1.5'"),
        ("study force --spacings x", "--spacings must be a whole number, got 'x'"),
        ("run probe-plate --secnods 3", "unknown: --secnods, 3 (did you mean --seconds?)"),
        ("view --zzzzz", "unknown: --zzzzz"),
        ("rnu", "no command 'rnu' (did you mean 'run'?); one of: demo, study, run,"),
        ("export a --kinds csv xyz", "invalid choice 'xyz' for argument '--kinds'. Expected one"),
        ("run probe-plate --coupling", "Missing value for argument '--coupling'"),
        ("sweep", "Missing from asperity sweep: STUDY.toml Fixed parameters, varied parameters"),
    ],
)
def test_the_parser_says_in_a_line_what_would_be_valid(arguments, told, capsys):
    assert main(arguments.split()) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"asperity: error: {told}")
    assert said.count("\n") == 1
    assert len(said) < 300
