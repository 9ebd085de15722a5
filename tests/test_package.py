"""What a newcomer meets first: names, start-up, README, version."""

import runpy
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import asperity

ROOT = Path(__file__).resolve().parents[1]
SHORTER = {"06_tell_textures_apart.py": ("--strokes", "1")}
"""Options of examples; what this one finds with more is in `mujoco/test_exploration.py`."""


@pytest.mark.parametrize("name", asperity.__all__)
def test_public_names_load_and_are_documented(name):
    thing = getattr(asperity, name)
    if callable(thing):
        assert thing.__doc__, name


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'offset_surfaces'"):
        _ = asperity.offset_surfaces


def test_version_is_told_once():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["version"] == asperity.__version__
    assert f"version: {asperity.__version__}" in (ROOT / "CITATION.cff").read_text()


def test_importing_and_help_load_nothing_heavy():
    code = (
        "import sys, asperity, asperity.cli; asperity.cli.main(['--help']);"
        "print(sorted({'numpy', 'numba', 'scipy', 'matplotlib', 'xarray'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("[]")


def test_first_force_loads_no_plotting_or_signal_library():
    code = (
        "import sys\n"
        "from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import texture_force\n"
        "from asperity.dynamics.dragged_hand.hand import Hand, drag\n"
        "from asperity.geometry.offsets.analytic import Sinusoid\n"
        "drag(texture_force(Sinusoid(1e-4, 1e-3), 3e-3, 0.5), Hand(), 0.08)\n"
        "print(sorted({'matplotlib', 'xarray', 'scipy.signal', 'pandas'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "path", sorted((ROOT / "examples").glob("[0-9]*.py")), ids=lambda p: p.name
)
def test_examples_run(path, tmp_path, monkeypatch):
    """In one process, which loads all but once; `test_documents` runs one in its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(path), *SHORTER.get(path.name, ())])
    runpy.run_path(str(path), run_name="__main__")


def test_every_module_says_what_it_is():
    for path in sorted((ROOT / "src" / "asperity").rglob("*.py")):
        name = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
        if not name.endswith("__main__"):
            assert import_module(name.removesuffix(".__init__")).__doc__, name
