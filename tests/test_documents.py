"""The documents: short, true to the code, and runnable word for word."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import asperity
from asperity.cli.main import _parse

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [path for path in PAGES if "_build" not in path.parts]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SHELL = ("sh", "shell", "text")
PLACEHOLDER = re.compile(r"\b[A-Z]{3,}\b")
"""SCENE, FILE and the like stand for a value."""


def blocks(text, *languages):
    """Return the fenced blocks of some languages, in order."""
    found = re.findall(r"^```(\w+)\n(.*?)^```", text, re.S | re.M)
    return [block for language, block in found if language in languages]


def commands(text):
    """Return the lines of shell blocks that run asperity, comments removed."""
    lines = "\n".join(blocks(text, *SHELL)).replace("\\\n", " ").splitlines()
    found = [shlex.join(shlex.split(line, comments=True)) for line in lines if "'" not in line]
    return [line for line in found if line.startswith("asperity ")]


def inline_commands(text):
    """Return what stands between backticks outside of blocks and is a whole command."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    found = re.findall(r"`(asperity [a-z][^`]*)`", text)
    return [" ".join(line.split()) for line in found]


def numbers(text):
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d*)?(?:e-?\d+)?", text)]


def words(text):
    return re.sub(r"-?\d[\d.e-]*", "#", text).split()


def run_python(block, folder):
    environment = os.environ | {"PYTHONPATH": str(Path(asperity.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-c", block],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(("name", "most"), [("README.md", 8192), ("ARCHITECTURE.md", 10240)])
def test_what_a_stranger_reads_first_is_short(name, most):
    assert len((ROOT / name).read_bytes()) < most


def test_the_package_has_few_entries():
    """Packages and modules; what only type checkers read is not counted."""
    entries = [p.name for p in (ROOT / "src" / "asperity").iterdir() if p.name != "__pycache__"]
    entries = [name for name in entries if name != "py.typed" and not name.endswith(".pyi")]
    assert len(entries) <= 21, sorted(entries)


def test_python_blocks_of_the_readme_print_what_it_shows(tmp_path):
    text = (ROOT / "README.md").read_text("utf-8")
    pairs = re.findall(r"```python\n(.*?)```[^`]*?```text\n(.*?)```", text, re.S)
    assert pairs
    assert len(pairs) == len(blocks(text, "python"))
    for block, shown in pairs:
        printed = run_python(block, tmp_path)
        assert words(printed) == words(shown)
        np.testing.assert_allclose(numbers(printed), numbers(shown), rtol=0.02, atol=2e-3)


def test_the_python_block_of_the_readme_is_an_example():
    (block,) = blocks((ROOT / "README.md").read_text("utf-8"), "python")
    assert block.strip() in (ROOT / "examples" / "02_probe_on_plate.py").read_text("utf-8")
    assert len([line for line in block.splitlines() if line.strip()]) <= 15


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_of_the_documents_are_understood(path):
    text = path.read_text("utf-8")
    for line in commands(text) + inline_commands(text):
        if len(line.split()) < 3 and not line.startswith("asperity doctor"):
            continue  # a command's name, not a call of it
        if PLACEHOLDER.search(line.replace("TEST", "")) or "..." in line or line.endswith("--help"):
            continue
        assert not isinstance(_parse(shlex.split(line)[1:]), int), line


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_what_python_blocks_of_the_documents_import_exists(path):
    imports = re.findall(
        r"^\s*from (asperity[\w.]*) import ([\w ,]+)$", path.read_text("utf-8"), re.M
    )
    for module, names in imports:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            loaded = import_module(module)
            for name in (part.split(" as ")[0].strip() for part in names.split(",")):
                assert hasattr(loaded, name) or find_spec(f"{module}.{name}"), f"{module}.{name}"


def test_links_of_the_documents_lead_somewhere():
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        if "_build" in path.parts:
            continue
        text = re.sub(r"^```.*?^```", "", path.read_text("utf-8"), flags=re.S | re.M)
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
            if "://" not in target:
                assert (path.parent / target).exists(), f"{path.name}: {target}"


@pytest.mark.parametrize("name", ["ARCHITECTURE.md", "CONTRIBUTING.md"])
def test_paths_and_modules_named_for_developers_exist(name):
    text = (ROOT / name).read_text("utf-8")
    package = ROOT / "src" / "asperity"
    code = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M))
    for part in code:
        if re.fullmatch(r"[\w./-]+\.(py|toml|md|txt)|\.ci/\w+|[\w/-]+/", part):
            places = (ROOT, package, ROOT / "docs", ROOT / "tests")
            assert any((place / part).exists() for place in places), f"{name}: {part}"
        elif re.fullmatch(r"asperity(\.[a-z_0-9]+)+", part):
            assert find_spec(part), f"{name}: {part}"


def test_names_that_tell_where_to_add_things_stand_in_the_files_beside_them():
    text = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    section = text.partition("## To add ...")[2].partition("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("| a")]
    assert len(rows) >= 8
    for row in rows:
        parts = re.findall(r"`([^`]+)`", row)
        paths = [root / part for part in parts for root in (ROOT, ROOT / "src" / "asperity")]
        there = "\n".join(path.read_text("utf-8") for path in paths if path.is_file())
        for name in parts:
            if re.fullmatch(r"_?[A-Z]\w+", name):
                assert re.search(rf"(?<!\w){name}\b", there), f"{name} in: {row}"


@pytest.mark.slow
def test_shell_blocks_of_the_readme_run_in_order_twice_in_one_fresh_folder(tmp_path):
    """`make` finds its environment made; its tests are only collected."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    if listed.returncode:
        pytest.skip("not a clone")
    fresh = tmp_path / "asperity"
    for name in listed.stdout.splitlines():
        if (ROOT / name).exists():
            (fresh / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, fresh / name)
    (fresh / ".venv").symlink_to(sys.prefix)
    made = " ".join(f"-o .venv/installed-{extra}" for extra in ("run", "dev", "view"))
    script = f'set -e\nmake() {{ command make {made} "$@"; }}\n'
    script += 2 * "".join(blocks((ROOT / "README.md").read_text("utf-8"), "sh"))
    environment = os.environ | {"PYTEST_ADDOPTS": "--collect-only -q", "MPLBACKEND": "agg"}
    done = subprocess.run(
        ["sh", "-c", script], cwd=fresh, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    for left in ("report.html", "run/summary.json", "nib/summary.json", "hand-export"):
        assert (fresh / "out" / left).exists(), left
