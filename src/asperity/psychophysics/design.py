"""The design of an experiment, read from its TOML file and checked."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError, require_between, require_choice, require_positive
from asperity.psychophysics.adjustment_settings import AdjustmentSettings, MatchingSettings
from asperity.psychophysics.interfaces.simulated_participants import SimulatedSettings
from asperity.psychophysics.procedures.questplus import QuestPlusSettings
from asperity.psychophysics.procedures.staircase import StaircaseSettings
from asperity.psychophysics.settings import (
    ADAPTIVE,
    CatchSettings,
    ConstantSettings,
    ForcedChoiceSettings,
    MagnitudeSettings,
    OddOneOutSettings,
    PairsSettings,
    Presentation,
    RankingSettings,
    SessionSettings,
    YesNoSettings,
)
from asperity.psychophysics.stimuli import Stimuli, Stimulus, check_scene, read_stimuli
from asperity.psychophysics.texts import DEFAULT, Texts, read_texts
from asperity.scene.document import (
    Table,
    arguments,
    at,
    beside,
    read_toml,
    require_keys,
    require_table,
)

SCHEMA = 1
Settings = (
    MagnitudeSettings | ForcedChoiceSettings | PairsSettings | RankingSettings | YesNoSettings
    | MatchingSettings
)  # fmt: skip
_MAKES: dict[str, Any] = {
    "magnitude": MagnitudeSettings, "forced-choice": ForcedChoiceSettings,
    "odd-one-out": OddOneOutSettings, "yes-no": YesNoSettings, "adjustment": AdjustmentSettings,
    "matching": MatchingSettings, "pairs": PairsSettings, "ranking": RankingSettings,
}  # fmt: skip
METHODS = tuple(_MAKES)
CHOICES = ("forced-choice", "odd-one-out")
"""Methods whose levels are chosen by one of `ADAPTIVE`."""
KINDS = {
    "magnitude": "number", "forced-choice": "choice", "odd-one-out": "choice", "yes-no": "yes-no",
    "adjustment": "adjust", "matching": "adjust", "pairs": "choice", "ranking": "order",
}  # fmt: skip
"""Kind of answer of each method's trials."""
_TEXTS = ("name", "method", "language", "texts")
_BY_LANGUAGE = ("instructions", "question")
_TABLES = (
    "stimulus", "stimuli", "levels", "presentation", "session", "catch", *METHODS, *ADAPTIVE,
    "simulated",
)  # fmt: skip
SECTIONS = ("schema", "seed", *_TEXTS, *_BY_LANGUAGE, *_TABLES)
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
    settings : MagnitudeSettings, ForcedChoiceSettings, ...
        Of the method.
    adaptive : StaircaseSettings, QuestPlusSettings or ConstantSettings, optional
        Of a forced choice.
    simulated : SimulatedSettings
    session : SessionSettings
    catch : CatchSettings
    texts : Texts
        In the participant's language, as are `instructions` and `question`.
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
    session: SessionSettings
    catch: CatchSettings
    texts: Texts = field(repr=False)
    document: dict[str, Any] = field(repr=False)

    @property
    def forced_choice(self) -> ForcedChoiceSettings:
        """Settings of a method of `CHOICES`, which the method must be."""
        assert isinstance(self.settings, ForcedChoiceSettings)
        return self.settings

    @property
    def matching(self) -> MatchingSettings:
        """Settings of an adjustment or a matching, which the method must be."""
        assert isinstance(self.settings, MatchingSettings)
        return self.settings

    @property
    def kind(self) -> str:
        """Kind of answer of its trials."""
        return KINDS[self.method]

    @property
    def choices(self) -> int:
        """Largest number of intervals to choose from."""
        return self.forced_choice.intervals if self.method in CHOICES else 2

    @property
    def highest(self) -> float | None:
        """The highest level, of methods that have levels with a right answer."""
        if isinstance(self.settings, YesNoSettings):
            return self.settings.highest
        return self.settings.high if isinstance(self.settings, ForcedChoiceSettings) else None

    def standards(self) -> list[Stimulus]:
        """Return the standards of an adjustment or a matching."""
        return [self.stimuli.level(v) for v in self.matching.standards] or self.stimuli.names()

    def all_stimuli(self) -> list[Stimulus]:
        """Return all stimuli; where values are found in a session, its ends."""
        settings = self.settings
        if isinstance(settings, ForcedChoiceSettings | YesNoSettings):
            levels = (
                settings.levels if isinstance(settings, YesNoSettings)
                else (settings.low, settings.high)
            )  # fmt: skip
            if self.catch.level is not None:
                levels = (*levels, self.catch.level)
            values = dict.fromkeys((settings.standard, *map(settings.comparison, levels)))
            return [self.stimuli.level(value) for value in values]
        if self.kind == "adjust":
            ends = (self.matching.low, self.matching.high)
            return list(dict.fromkeys([*self.standards(), *map(self.stimuli.level, ends)]))
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


def read_design(path: Path, language: str | None = None) -> ExperimentDesign:
    """Return the experiment that a TOML file describes, in its own language or another.

    Raises
    ------
    AsperityError
        The file is not valid. The message names the key, its value and what is valid.
    """
    if not path.is_file():
        raise AsperityError(f"no such file: {path}; give the TOML file of an experiment")
    document = read_toml(path)
    design: ExperimentDesign = at(
        str(path), lambda: parse_design(document, path.resolve().parent, path.stem, language)
    )
    return design


def parse_design(
    document: dict[str, Any], folder: Path | None = None, name: str = "experiment",
    language: str | None = None,
) -> ExperimentDesign:  # fmt: skip
    """Return the experiment that a document describes.

    Relative scenes and texts are searched in `folder`; `name` is that of a document without one;
    `language` takes the place of the document's.
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
    texts = _texts(document, folder, language)
    choices = getattr(settings, "intervals", 2)
    question = _in_language(document, "question", texts)
    design = ExperimentDesign(
        document.get("name") or name, method, _in_language(document, "instructions", texts) or "",
        texts(f"question_{method}", choices=texts.choices(choices)) if question is None
        else question, seed, read_stimuli(document, folder),
        _values(document, method),
        _made(document.get("presentation", {}), "presentation", Presentation),
        settings, adaptive, _made(document.get("simulated", {}), "simulated", SimulatedSettings),
        _made(document.get("session", {}), "session", SessionSettings),
        _made(document.get("catch", {}), "catch", CatchSettings), texts, document,
    )  # fmt: skip
    _check_stimuli(design)
    _check_catch(design)
    return design


def _texts(document: Table, folder: Path | None, language: str | None) -> Texts:
    """Return the texts of a document, which may be those of stored sessions without its folder."""
    given = document.get("texts")
    path = None if given is None or folder is None else beside(folder, given)
    return read_texts(language or document.get("language", DEFAULT), path)


def _in_language(document: Table, key: str, texts: Texts) -> str | None:
    """Return a text of the document, which may be a table of languages; None if there is none."""
    given = document.get(key)
    if given is None or isinstance(given, str):
        return given
    require_table(given, key)
    for name, text in given.items():
        if not isinstance(text, str):
            raise AsperityError(f"{key}.{name} must be a text, got {text!r}")
    if texts.language not in given:
        raise AsperityError(
            f"{key} has no text in the language {texts.language!r}; it has {', '.join(given)}"
        )
    return str(given[texts.language])


def _made(table: Table, where: str, makes: Any) -> Any:
    options = arguments(table, where, makes)
    return at(where, lambda: makes(**options))


def _values(document: Table, method: str) -> tuple[float, ...]:
    """Return the values of the levels; empty for a forced choice, which adapts them."""
    given = document.get("levels", {}).get("values")
    if given is None:
        return ()
    if method == "yes-no":
        raise AsperityError("levels.values is for other methods; yes-no has yes-no.levels")
    if method in (*CHOICES, "adjustment", "matching"):
        what = "a forced choice" if method == "forced-choice" else method
        raise AsperityError(f"levels.values is for the other methods; {what} has low, high")
    numbers = [v for v in given if isinstance(v, int | float)] if isinstance(given, list) else []
    if len(numbers) < 2 or len(numbers) != len(given) or len(set(numbers)) < len(numbers):
        raise AsperityError(f"levels.values must be a list of different numbers, got {given!r}")
    return tuple(float(value) for value in numbers)


def _adaptive(document: Table, method: str, settings: Any) -> Any:
    given = [name for name in ADAPTIVE if name in document]
    if method not in CHOICES:
        if given:
            raise AsperityError(f"{given[0]} is for the method 'forced-choice', not {method!r}")
        return None
    wanted = settings.adaptive
    for name in given:
        if name != wanted:
            raise AsperityError(f"{name} is given, but {method}.adaptive is {wanted!r}")
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
    method, settings = design.method, design.settings
    if method in (*CHOICES, "yes-no", "adjustment", "matching"):
        if design.stimuli.levels is None:
            what = "a forced choice" if method == "forced-choice" else method
            raise AsperityError(f"{what} needs [levels]: the key that it varies")
    elif design.stimuli.levels is not None and not design.values:
        raise AsperityError("levels.values is missing: the values of the key")
    if isinstance(settings, MatchingSettings) and bool(settings.standards) == bool(
        design.stimuli.named
    ):
        raise AsperityError(
            "matching needs matching.standards, values of the levels' key, or tables "
            "[stimuli.NAME], one of them"
        )
    count = len(design.all_stimuli())
    least, most = {"pairs": (2, 50), "ranking": (2, 9)}.get(method, (1, 1000))
    if not least <= count <= most:
        raise AsperityError(f"{method} needs {least} to {most} stimuli, got {count}")
    if method == "yes-no" and design.simulated.rates != "parameter":
        raise AsperityError(
            "simulated.rates must be 'parameter' for the method yes-no, got "
            f"{design.simulated.rates!r}"
        )


def _check_catch(design: ExperimentDesign) -> None:
    """Raise unless catch trials have a right answer."""
    settings, level = design.settings, design.catch.level
    if not design.catch.every and level is None:
        return
    if not isinstance(settings, ForcedChoiceSettings | YesNoSettings):
        raise AsperityError(
            f"catch trials need a right answer, which the method {design.method!r} has not"
        )
    if level is None:
        return
    if getattr(settings, "scale", "linear") == "log":
        at("catch", partial(require_positive, "level", level))
    if settings.comparison(level) == settings.standard:
        raise AsperityError(f"catch.level: at {level:g} there is no signal, but the standard")
