"""A laboratory: drags of one hand under the conditions of the findings, each simulated once.

It differs from `otaduy_lin_2004.drags.DragSimulator`, with which it shares `drag_over`: plates have
several paths, a probe may be a finger, slope tables are coarser and shared between hands, and drags
are kept as the Fourier records from which a hundred metrics are computed at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.dragged_hand.normal_motion import NormalProbe, drag_lifting
from asperity.errors import AsperityError
from asperity.geometry.offsets.piecewise import PiecewiseCubic
from asperity.studies.literature.finding import Finding, Verdict
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.measures import STILL, DragRecord, Measure, evaluate_all, record_of
from asperity.studies.literature.plates import Dots, Paper, Plate, Sinusoids
from asperity.studies.literature.pressed import pressed_roughness
from asperity.studies.otaduy_lin_2004.drags import drag_over
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import slope_table
from asperity.studies.skin.fingertip import Fingertip
from asperity.studies.skin.pressed_finger import PressedFinger

_TOLERANCE = 1e-4
_MAP_TOLERANCE = 1e-2
"""Relative tolerances of slope tables, of shapes and of height maps; enough for the search."""

_PATH_PIXEL = 0.02e-3
"""Distance of samples of the path of a probe that may lift off [m]."""
_LEAST_SAMPLES = 64
_LEAST_LENGTH = 40e-3
"""Least length of a record of a probe that may lift off [m]."""


@dataclass(frozen=True)
class Touch:
    """How a surface is touched: probe, force and speed."""

    probe: float | Finger
    """Diameter of the probe [m], or a finger."""
    force: float
    """[N]"""
    speed: float
    """[m/s]"""


@dataclass(frozen=True)
class Plan:
    """Levels of the conditions, and the range and number of spacings. The values are asperity's."""

    spacings: int = 20
    """Number of spacings of each curve."""
    diameters: tuple[float, ...] = (2e-3, 3e-3, 4e-3)
    """Diameters of probes [m]; the first is the small one, the middle serves other factors."""
    forces: tuple[float, ...] = (0.29, 0.58, 0.87)
    """[N]"""
    speeds: tuple[float, ...] = (0.042, 0.083, 0.169)
    """[m/s]"""
    heights: tuple[float, ...] = (0.2e-3, 0.4e-3)
    """Heights of dots, for the drop point [m]."""
    range: tuple[float, float] = (0.5e-3, 3.5e-3)
    """Spacings of dots and sinusoids [m]; the range of the studies."""
    grooves: tuple[float, float] = (0.25e-3, 6e-3)
    """Widths of the grooves of gratings [m]."""

    def touch(self, **changed: float | Finger) -> Touch:
        """Return the touch of middle levels, with some changed."""
        middle = Touch(
            *(values[len(values) // 2] for values in (self.diameters, self.forces, self.speeds))
        )
        return replace(middle, **changed)  # type: ignore[arg-type]

    def touches(self, factor: str) -> tuple[Touch, ...]:
        """Return a touch for each level of a factor: diameter, force or speed."""
        name, values = {
            "diameter": ("probe", self.diameters),
            "force": ("force", self.forces),
            "speed": ("speed", self.speeds),
        }[factor]
        return tuple(self.touch(**{name: value}) for value in values)

    @property
    def places(self) -> NDArray[np.float64]:
        """The spacings [m]."""
        return np.geomspace(*self.range, self.spacings)

    @property
    def groove_places(self) -> NDArray[np.float64]:
        """The widths of grooves [m]."""
        return np.geomspace(*self.grooves, self.spacings)


_Tool = float | Finger | tuple[Fingertip, float]
"""A probe's diameter [m], a finger, or a soft one with its normal force [N]."""
Tables = dict[tuple[Plate, float, _Tool], tuple[PiecewiseCubic, ...]]


@dataclass
class Laboratory:
    """One hand, its drags, and the slope tables that it shares with other hands."""

    hand: Hand = field(default_factory=Hand)
    plan: Plan = field(default_factory=Plan)
    data: Path | None = None
    """Folder of measured surfaces; None if there is none."""
    dots: Dots = field(default_factory=Dots)
    """The dots that represent those of the experiments; held-out runs use others."""
    sinusoids: Plate = field(default_factory=Sinusoids)
    """The sinusoids of the seed paper's simulations, or the plates that take their place."""
    skin: PressedFinger | None = None
    """A finger that is judged by the pressure on its skin, whatever the metric; None: the crude
    finger of `finger.py`, judged by vibration as a probe is."""
    fingertip: Fingertip | None = None
    """A soft finger in the place of the crude one, judged by vibration as a probe is."""
    normal: NormalProbe | None = None
    """A probe that also moves along the normal and may lift off; None: constant normal force."""
    tables: Tables = field(default_factory=dict, repr=False)
    measures: tuple[Measure, ...] = ()
    """Metrics needed of every condition: they are computed together."""
    _curves: dict[tuple[Plate, Touch, tuple[float, ...]], NDArray[np.float64]] = field(
        default_factory=dict, repr=False
    )
    _records: dict[tuple[Plate, float, Touch], tuple[DragRecord, ...]] = field(
        default_factory=dict, repr=False
    )

    def curves(
        self,
        measure: Measure,
        plate: Plate,
        touches: Sequence[Touch],
        spacings: Sequence[float] | NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the metric for each touch over spacings [m], by default those of the plan."""
        return np.array([self.curve(measure, plate, touch, spacings) for touch in touches])

    def curve(
        self,
        measure: Measure,
        plate: Plate,
        touch: Touch,
        spacings: Sequence[float] | NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the metric over spacings [m], by default those of the plan."""
        spacings = self.plan.places if spacings is None else spacings
        if self.skin is not None and isinstance(touch.probe, Finger):
            return np.array(
                [pressed_roughness(plate, float(s), touch.force, self.skin) for s in spacings]
            )
        if measure not in self._index:
            return np.array([measure(self.records(plate, float(s), touch)) for s in spacings])
        key = (plate, touch, tuple(float(s) for s in spacings))
        if key not in self._curves:
            self._curves[key] = np.array(
                [evaluate_all(self.records(plate, s, touch), self.measures) for s in key[2]]
            ).T
        return self._curves[key][self._index[measure]]

    @cached_property
    def _index(self) -> dict[Measure, int]:
        return {measure: i for i, measure in enumerate(self.measures)}

    def records(self, plate: Plate, spacing: float, touch: Touch) -> tuple[DragRecord, ...]:
        """Return the drags over a plate, one for each path."""
        key = (plate, spacing, touch)
        if (
            key not in self._records
            and self.normal is not None
            and not isinstance(touch.probe, Finger)
        ):
            self._records[key] = self._lifting(plate, spacing, touch, self.normal)
        if key not in self._records:
            motions = [
                drag_over(slopes.scaled(touch.force), touch.force, self.hand, touch.speed)
                for slopes in self._slopes(plate, spacing, touch)
            ]
            self._records[key] = tuple(
                STILL if motion is None else record_of(motion, self.hand) for motion in motions
            )
        return self._records[key]

    def _lifting(
        self, plate: Plate, spacing: float, touch: Touch, probe: NormalProbe
    ) -> tuple[DragRecord, ...]:
        """Return the drags of a probe that may lift off, a period or more of each path."""
        assert isinstance(touch.probe, float)
        records = []
        for heights, slopes, period in _traced(plate, spacing, touch.probe):
            run = drag_lifting(
                heights, slopes, period, self.hand, probe, normal_force=touch.force,
                speed=touch.speed, length=max(period, _LEAST_LENGTH),
            )  # fmt: skip
            records.append(record_of(run.motion, self.hand))
        return tuple(records)

    def _slopes(self, plate: Plate, spacing: float, touch: Touch) -> tuple[PiecewiseCubic, ...]:
        probe: _Tool = touch.probe
        if isinstance(probe, Finger) and self.fingertip is not None:
            probe = self.fingertip, touch.force
        key = (plate, spacing, probe)
        if key not in self.tables:
            tables = []
            for surface in plate.surfaces(spacing):
                if isinstance(probe, tuple):
                    tables.append(probe[0].slope_table(surface, probe[1]))
                elif isinstance(probe, Finger):
                    tables.append(probe.slope_table(surface))
                else:
                    tolerance = _MAP_TOLERANCE if isinstance(plate, Paper) else _TOLERANCE
                    tables.append(slope_table(surface, probe, tolerance=tolerance))
            self.tables[key] = tuple(tables)
        return self.tables[key]


@lru_cache(maxsize=1024)
def _traced(
    plate: Plate, spacing: float, probe: float
) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64], float], ...]:
    """Return heights [m] and slopes of one period of each path of a probe, and the period [m]."""
    traced = []
    for surface in plate.surfaces(spacing):
        samples = max(math.ceil(surface.period / _PATH_PIXEL), _LEAST_SAMPLES)
        path = surface.tracer(probe)(np.arange(samples) * surface.period / samples)
        traced.append((path.height, path.slope, surface.period))
    return tuple(traced)


def judge_or_explain(finding: Finding, lab: Laboratory, measure: Measure) -> Verdict:
    """Return the verdict; if the hand cannot be dragged, a verdict without result, and why."""
    try:
        return finding.judge(lab, measure)
    except AsperityError as error:
        return Verdict(None, {}, f"Could not be simulated: {error}.")
