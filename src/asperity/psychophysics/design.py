"""The design of an experiment, read from its TOML file and checked."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError, require_between, require_choice
from asperity.psychophysics.interfaces.simulated_participants import SimulatedSettings
from asperity.psychophysics.procedures.questplus import QuestPlusSettings
from asperity.psychophysics.procedures.staircase import StaircaseSettings
from asperity.psychophysics.settings import (
    ADAPTIVE,
    ConstantSettings,
    ForcedChoiceSettings,
    MagnitudeSettings,
    PairsSettings,
    Presentation,
    RankingSettings,
)
from asperity.psychophysics.stimuli import Stimuli, Stimulus, check_scene, read_stimuli
from asperity.scene.document import Table, arguments, at, read_toml, require_keys, require_table

SCHEMA = 1
METHODS = ("magnitude", "forced-choice", "pairs", "ranking")
_TEXTS = ("name", "method", "instructions", "question")
_TABLES = ("stimulus", "stimuli", "levels", "presentation", *METHODS, *ADAPTIVE, "simulated")
SECTIONS = ("schema", "seed", *_TEXTS, *_TABLES)
_QUESTIONS = {
    "magnitude": "How rough did it feel? Give a number above 0.",
    "forced-choice": "Which felt rougher, 1 or 2?",
    "pairs": "Which felt rougher, 1 or 2?",
    "ranking": "Put them in order, the roughest first.",
}


Settings = MagnitudeSettings | ForcedChoiceSettings | PairsSettings | RankingSettings
_MAKES: dict[str, Any] = {
    "magnitude": MagnitudeSettings, "forced-choice": ForcedChoiceSettings,
    "pairs": PairsSettings, "ranking": RankingSettings,
}  # fmt: skip
_ADAPTIVE: dict[str, Any] = {
    "staircase": StaircaseSettings, "quest+": QuestPlusSettings, "constant": ConstantSettings,
}  # fmt: skip


@dataclass(frozen=True)
class ExperimentDesign:
    """An experiment. `read_design` makes it.

    Parameters
    ----------
    name, method, instructions, question : str
    seed : int
    stimuli : Stimuli
    values : tuple of float
        The levels of methods without adaptation; empty where stimuli are named.
    presentation : Presentation
    settings : MagnitudeSettings, ForcedChoiceSettings, PairsSettings or RankingSettings
    adaptive : StaircaseSettings, QuestPlusSettings or ConstantSettings, optional
        Of a forced choice.
    simulated : SimulatedSettings
    document : dict
        The file, as it was read.
    """

    name: str
    method: str
    instructions: str
    question: str
    seed: int
    stimuli: Stimuli
    values: tuple[float, ...]
    presentation: Presentation
    settings: Settings
    adaptive: StaircaseSettings | QuestPlusSettings | ConstantSettings | None
    simulated: SimulatedSettings
    document: dict[str, Any] = field(repr=False)

    @property
    def forced_choice(self) -> ForcedChoiceSettings:
        """Settings of a forced choice; the method must be forced-choice."""
        assert isinstance(self.settings, ForcedChoiceSettings)
        return self.settings

    def all_stimuli(self) -> list[Stimulus]:
        """Return all stimuli; of a forced choice, the standard and the two extremes."""
        if self.method == "forced-choice":
            chosen = self.forced_choice
            ends = (chosen.comparison(chosen.low), chosen.comparison(chosen.high))
            return [self.stimuli.level(value) for value in (chosen.standard, *ends)]
        if self.stimuli.named:
            return self.stimuli.names()
        return [self.stimuli.level(value) for value in self.values]

    def check_scenes(self) -> dict[str, str]:
        """Make the scene of every stimulus; return a digest of each by name."""
        return {s.name: check_scene(self.stimuli, s) for s in self.all_stimuli()}

    @property
    def digest(self) -> str:
        """A digest of the document."""
        text = json.dumps(self.document, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def read_design(path: Path) -> ExperimentDesign:
    """Return the experiment that a TOML file describes.

    Raises
    ------
    AsperityError
        The file is not valid. The message names the key, its value and what is valid.
    """
    if not path.is_file():
        raise AsperityError(f"no such file: {path}; give the TOML file of an experiment")
    document = read_toml(path)
    design: ExperimentDesign = at(
        str(path), lambda: parse_design(document, path.resolve().parent, path.stem)
    )
    return design


def parse_design(
    document: dict[str, Any], folder: Path | None = None, name: str = "experiment"
) -> ExperimentDesign:
    """Return the experiment that a document describes.

    Relative scenes are searched in `folder`; `name` is that of a document without one.
    """
    require_keys(document, "", SECTIONS)
    schema = document.get("schema")
    if schema != SCHEMA or isinstance(schema, bool):
        raise AsperityError(f"schema must be {SCHEMA}, got {schema!r}")
    for key in _TEXTS:
        if key in document and not isinstance(document[key], str):
            raise AsperityError(f"{key} must be a text, got {document[key]!r}")
    for key in _TABLES:
        require_table(document.get(key, {}), key)
    if not document.get("method"):
        raise AsperityError("method is missing")
    method = require_choice("method", document["method"], METHODS)
    seed = document.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**31:
        raise AsperityError(f"seed must be a whole number, 0 or above, got {seed!r}")
    for other in METHODS:
        if other != method and other in document:
            raise AsperityError(f"{other} is given, but the method is {method!r}")
    settings = _made(document.get(method, {}), method, _MAKES[method])
    adaptive = _adaptive(document, method, settings)
    design = ExperimentDesign(
        document.get("name") or name, method, document.get("instructions", ""),
        document.get("question", _QUESTIONS[method]), seed, read_stimuli(document, folder),
        _values(document, method),
        _made(document.get("presentation", {}), "presentation", Presentation),
        settings, adaptive, _made(document.get("simulated", {}), "simulated", SimulatedSettings),
        document,
    )  # fmt: skip
    _check_stimuli(design)
    return design


def _made(table: Table, where: str, makes: Any) -> Any:
    options = arguments(table, where, makes)
    return at(where, lambda: makes(**options))


def _values(document: Table, method: str) -> tuple[float, ...]:
    """Return the values of the levels; empty for a forced choice, which adapts them."""
    given = document.get("levels", {}).get("values")
    if given is None:
        return ()
    if method == "forced-choice":
        raise AsperityError("levels.values is for the other methods; a forced choice has low, high")
    numbers = [v for v in given if isinstance(v, int | float)] if isinstance(given, list) else []
    if len(numbers) < 2 or len(numbers) != len(given) or len(set(numbers)) < len(numbers):
        raise AsperityError(f"levels.values must be a list of different numbers, got {given!r}")
    return tuple(float(value) for value in numbers)


def _adaptive(document: Table, method: str, settings: Any) -> Any:
    given = [name for name in ADAPTIVE if name in document]
    if method != "forced-choice":
        if given:
            raise AsperityError(f"{given[0]} is for the method 'forced-choice', not {method!r}")
        return None
    wanted = settings.adaptive
    for name in given:
        if name != wanted:
            raise AsperityError(f"{name} is given, but forced-choice.adaptive is {wanted!r}")
    made = _made(document.get(wanted, {}), wanted, _ADAPTIVE[wanted])
    starts = {"staircase": "start", "constant": "levels"}.get(wanted)
    for value in getattr(made, starts) if starts else ():
        at(
            f"{wanted}.{starts}",
            partial(require_between, "a level", value, settings.low, settings.high),
        )
    if wanted == "staircase" and settings.scale == "log":
        for step in made.steps:
            if step <= 1.0:
                raise AsperityError(f"staircase.steps must be factors above 1, got {step!r}")
    return made


def _check_stimuli(design: ExperimentDesign) -> None:
    if design.method == "forced-choice":
        if design.stimuli.levels is None:
            raise AsperityError("a forced choice needs [levels]: the key that it varies")
    elif design.stimuli.levels is not None and not design.values:
        raise AsperityError("levels.values is missing: the values of the key")
    count = len(design.all_stimuli())
    least, most = {"pairs": (2, 50), "ranking": (2, 9)}.get(design.method, (1, 1000))
    if not least <= count <= most:
        raise AsperityError(f"{design.method} needs {least} to {most} stimuli, got {count}")
