"""Combinations of kind "drag": each is one drag of the hand of Eq. 7 over one surface."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from asperity._core.data import table_beside
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError, require_between, require_choice
from asperity.runs.vibration_metrics import DEFAULT_BAND, METRICS
from asperity.scene.document import arguments, beside, require_keys
from asperity.studies.otaduy_lin_2004.drags import MODELS, Condition, DragSimulator
from asperity.studies.otaduy_lin_2004.stimuli import SURFACES, StimulusOptions
from asperity.studies.sweeps.study import Runner, nest, seed_of

_RANGES = table_beside(__file__, "parameters.toml")["drag"]["ranges"]
"""Valid ranges, as of the options of `asperity study`; values outside have the wrong unit."""
_RANDOM = ("dots", "self-affine")
"""Surfaces that have a seed."""
_INNER = ("normal_force", "speed", "hand.", "band")
"""Prefixes of parameters that leave the slope table as it is, so that neighbours share it."""
_WHOLE = ("repeat", "stimulus.seed")
_BATCH = (16, 1024)
"""Least and largest number of combinations in a block; each takes about a millisecond."""
_UNITS = {"band": "Hz", "repeat": "1", "stimulus.seed": "1"}
_LABELS = {
    "model": "force model", "spacing": "texture spacing", "diameter": "probe diameter",
    "band": "band of the metric",
}  # fmt: skip


@dataclass(frozen=True)
class DragCombination:
    """The parameters of one drag, in SI units.

    The defaults are the middle levels of `StudySettings`.
    """

    surface: str = "sinusoid"
    """One of `SURFACES`, or a file of heights."""
    model: str = "otaduy-lin"
    """A key of `MODELS`."""
    spacing: float = 1.5e-3
    diameter: float = 3e-3
    normal_force: float = 0.58
    speed: float = 0.083
    band: tuple[float, float] = DEFAULT_BAND
    """Band of the metric `band_rms` [Hz]."""
    repeat: int = 0
    """Changes the seeds and nothing else."""
    stimulus: StimulusOptions = field(default_factory=StimulusOptions)
    hand: Hand = field(default_factory=Hand)


_PARTS: dict[str, Any] = {"stimulus": StimulusOptions, "hand": Hand}
_KEYS = (
    *(f.name for f in fields(DragCombination) if f.name not in _PARTS),
    *(f"{part}.{f.name}" for part, of in _PARTS.items() for f in fields(of)),
)


def drag_of(values: Mapping[str, Any]) -> DragCombination:
    """Return the drag described by checked values with dotted keys."""
    parts = {name: value for name, value in nest(values).items() if name not in _PARTS}
    for part, makes in _PARTS.items():
        parts[part] = makes(
            **{k.partition(".")[2]: v for k, v in values.items() if k.startswith(f"{part}.")}
        )
    return DragCombination(**parts)


def _checked(values: Mapping[str, Any], where: str, folder: Path) -> dict[str, Any]:
    """Return values with dotted keys in the types of their parameters; refuse invalid ones."""
    require_keys(values, where, _KEYS)
    out: dict[str, Any] = {}
    for key, value in values.items():
        part, dot, name = key.partition(".")
        makes, place, name = (
            (_PARTS[part], f"{where}.{part}", name) if dot else (DragCombination, where, key)
        )
        out[key] = arguments({name: value}, place, makes)[name]
        if key in _RANGES and out[key] is not None:
            low, high, unit = _RANGES[key]
            require_between(f"{where}.{key}", out[key], low, high, unit)
    if "model" in out:
        require_choice(f"{where}.model", out["model"], MODELS)
    if "stimulus.missing" in out:
        require_choice(f"{where}.stimulus.missing", out["stimulus.missing"], ("refuse", "fill"))
    if "band" in out:
        band = out["band"]
        if len(band) != 2 or not 0.0 < band[0] < band[1]:
            raise AsperityError(f"{where}.band must rise from above 0 Hz, got {list(band)}")
    for key in ("repeat", "stimulus.seed"):
        if out.get(key, 0) < 0:
            raise AsperityError(f"{where}.{key} must be 0 or above, got {out[key]}")
    if "surface" in out and out["surface"] not in SURFACES:
        path = beside(folder, out["surface"])
        if not Path(out["surface"]).suffix and not path.exists():
            require_choice(f"{where}.surface", out["surface"], [*SURFACES, "a file of heights"])
        if not path.is_file():
            raise AsperityError(f"{where}.surface: no such file: {path}")
    return out


def _files_of(columns: Mapping[str, Iterable[Any]], folder: Path) -> dict[str, Path]:
    """Return the files that parameters, key -> values, name: name -> path."""
    names = [name for name in columns.get("surface", ()) if name not in SURFACES]
    return {name: beside(folder, name) for name in names}


def _unit_and_label(key: str) -> tuple[str, str]:
    """Return the unit of a parameter ("1": none, "": a text), and its axis label."""
    unit = _UNITS.get(key, "") if key not in _RANGES else _RANGES[key][2] or "1"
    label = key.replace("stimulus.", "").replace(".", " ").replace("_", " ")
    return unit, _LABELS.get(key, label)


_NUMBERS: dict[str, tuple[str, str]] = {
    **{name: (metric.unit, metric.label) for name, metric in METRICS.items()},
    "motion_status": ("1", "0 periodic, 1 subharmonic, 2 does not repeat"),
}
"""What can be kept of a drag: name -> (unit, label)."""
_DEFAULT_KEEP = tuple(_NUMBERS)


@dataclass
class DragRuns(Runner):
    """Runs combinations of a study of drags; surfaces and slope tables are shared between them."""

    KEYS, INNER, WHOLE, BATCH = _KEYS, _INNER, _WHOLE, _BATCH
    NUMBERS, DEFAULT_KEEP = _NUMBERS, _DEFAULT_KEEP
    checked = staticmethod(_checked)
    files_of = staticmethod(_files_of)
    unit_and_label = staticmethod(_unit_and_label)

    _simulators: dict[tuple[Any, ...], DragSimulator] = field(default_factory=dict, init=False)

    def numbers(
        self, varied: Mapping[str, Any], keep: Sequence[str], more: Sequence[str] = ()
    ) -> list[float]:
        """Run one combination and return its numbers `keep`, then `more`."""
        values = {**self.fixed, **varied}
        drag = drag_of(values)
        options = drag.stimulus
        if "stimulus.seed" not in values:
            options = replace(options, seed=self._seed(drag))
        surface = drag.surface
        if surface not in SURFACES:
            surface = str(beside(self.folder, surface))
        key = (surface, options, drag.model)
        if key not in self._simulators:
            self._simulators[key] = DragSimulator(
                surface, options, drag.hand, drag.model, drag.band
            )
        simulator = self._simulators[key].with_hand(drag.hand, drag.band)
        condition = Condition(drag.spacing, drag.diameter, drag.normal_force, drag.speed)

        def number(name: str) -> float:
            if name == "motion_status":
                return float(simulator.motion(condition).status)
            return simulator.metric(name, condition)

        found = [number(name) for name in keep]
        for name in more:
            try:
                found.append(number(name))
            except AsperityError:  # only what is to be kept makes a combination fail
                found.append(math.nan)
        return found

    def _seed(self, drag: DragCombination) -> int:
        """Return the seed derived from the parameters of the surface, or of the noise.

        Combinations with equal surface parameters have the same surface, whatever the hand is.
        """
        parameters = asdict(drag)
        if drag.model == "siira-pai":
            return seed_of(parameters, self.seed)
        if drag.surface not in _RANDOM:
            return 0
        names = ("surface", "spacing", "stimulus", "repeat")
        return seed_of({name: parameters[name] for name in names}, self.seed)
