"""The command reference, docs/cli.md, is what the parser says."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("jinja2")

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def reference():
    path = ROOT / "tools" / "cli_reference.py"
    spec = importlib.util.spec_from_file_location("cli_reference", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_docs_cli_is_up_to_date(reference):
    text = (ROOT / "docs" / "cli.md").read_text("utf-8")
    assert text == reference.page(), "run make reference"


def test_each_command_has_one_entry(reference):
    text = reference.page()
    for name in reference.commands():
        assert text.count(f"\n## asperity {name}\n") == 1
        assert text.count(f"| [`asperity {name}`]") == 1


def test_every_option_has_a_meaning(reference):
    for name, options in reference.commands().items():
        for option in reference.options_of(options):
            assert option.meaning, f"{name} {option.usage}"


@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("study", ("`--spacing-range-mm FLOAT FLOAT`", "`0.5 3.5`", "0.05 to 20 mm")),
        ("study", ("`--hand.mass-kg FLOAT`", "`0.05`", "0.001 to 10 kg")),
        ("bake", ("`--no-picture`", "", "")),
        ("export", ("`--kinds {csv,wav,png} ...`", "`csv wav png`", "")),
        ("run", ("`SCENE`", "", "")),
    ],
)
def test_options_are_shown_as_they_are_typed(command, option, reference):
    shown = [row[:3] for row in reference.options_of(reference.commands()[command])]
    assert option in shown
