"""Drags by condition, remembered: tables of slopes for all hands, records for one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand, drag
from asperity.errors import AsperityError
from asperity.geometry.offsets.piecewise import PiecewiseCubic
from asperity.studies.literature.finding import Finding, Verdict
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.measures import STILL, DragRecord, Measure, evaluate_all, record_of
from asperity.studies.literature.plates import Dots, Paper, Plate, Sinusoids
from asperity.studies.otaduy_lin_2004.drags import LEAST_SLOPE
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import slope_table

_TOLERANCE = 1e-4
_MAP_TOLERANCE = 1e-2
"""Of the largest slope: a search over hands needs no more."""


@dataclass(frozen=True)
class Touch:
    """With what, how hard and how fast."""

    probe: float | Finger
    """Diameter of the probe [m], or a finger."""
    force: float
    """[N]"""
    speed: float
    """[m/s]"""


@dataclass(frozen=True)
class Plan:
    """What the conditions vary, over what, and how finely. The numbers are asperity's."""

    spacings: int = 20
    """Of each curve."""
    diameters: tuple[float, ...] = (2e-3, 3e-3, 4e-3)
    """Of probes [m]; the first is the small probe, the middle one serves the other factors."""
    forces: tuple[float, ...] = (0.29, 0.58, 0.87)
    """[N]"""
    speeds: tuple[float, ...] = (0.042, 0.083, 0.169)
    """[m/s]"""
    heights: tuple[float, ...] = (0.2e-3, 0.4e-3)
    """Of dots, for the drop point [m]."""
    range: tuple[float, float] = (0.5e-3, 3.5e-3)
    """Of dots and sinusoids [m]; the range of the studies."""
    grooves: tuple[float, float] = (0.25e-3, 6e-3)
    """Of gratings [m]."""

    def touch(self, **changed: float | Finger) -> Touch:
        """Return the middle touch, changed."""
        middle = Touch(
            *(values[len(values) // 2] for values in (self.diameters, self.forces, self.speeds))
        )
        return replace(middle, **changed)  # type: ignore[arg-type]

    def touches(self, factor: str) -> tuple[Touch, ...]:
        """Return the touches over the levels of a factor: diameter, force or speed."""
        if factor == "diameter":
            return tuple(self.touch(probe=value) for value in self.diameters)
        if factor == "force":
            return tuple(self.touch(force=value) for value in self.forces)
        return tuple(self.touch(speed=value) for value in self.speeds)

    @property
    def places(self) -> NDArray[np.float64]:
        """The spacings [m]."""
        return np.geomspace(*self.range, self.spacings)

    @property
    def groove_places(self) -> NDArray[np.float64]:
        """The widths of grooves [m]."""
        return np.geomspace(*self.grooves, self.spacings)


Tables = dict[tuple[Plate, float, float | Finger], tuple[PiecewiseCubic, ...]]


@dataclass
class Laboratory:
    """One hand, its drags, and the tables that it shares with other hands."""

    hand: Hand = field(default_factory=Hand)
    plan: Plan = field(default_factory=Plan)
    data: Path | None = None
    """Folder of measured surfaces, if there is one."""
    dots: Dots = field(default_factory=Dots)
    """The plates that stand for those of the experiments; others in a held-out run."""
    sinusoids: Sinusoids = field(default_factory=Sinusoids)
    """And those of the seed paper's simulations."""
    tables: Tables = field(default_factory=dict, repr=False)
    measures: tuple[Measure, ...] = ()
    """Metrics that are wanted of every condition: they are then taken all at once."""
    _curves: dict[tuple[Plate, Touch, tuple[float, ...]], NDArray[np.float64]] = field(
        default_factory=dict, repr=False
    )
    _records: dict[tuple[Plate, float, Touch], tuple[DragRecord, ...]] = field(
        default_factory=dict, repr=False
    )

    def curve(
        self,
        measure: Measure,
        plate: Plate,
        touch: Touch,
        spacings: Sequence[float] | NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the metric over spacings [m]."""
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
        """Return the drags over a plate, one a path."""
        key = (plate, spacing, touch)
        if key not in self._records:
            tables = self._slopes(plate, spacing, touch.probe)
            self._records[key] = tuple(self._drag(table, touch) for table in tables)
        return self._records[key]

    def _drag(self, slopes: PiecewiseCubic, touch: Touch) -> DragRecord:
        if not np.max(np.abs(slopes.coefficients)) > LEAST_SLOPE:
            return STILL
        force = slopes.scaled(touch.force)
        return record_of(drag(force, self.hand, touch.speed), self.hand)

    def _slopes(
        self, plate: Plate, spacing: float, probe: float | Finger
    ) -> tuple[PiecewiseCubic, ...]:
        key = (plate, spacing, probe)
        if key not in self.tables:
            tables = []
            for surface in plate.surfaces(spacing):
                if isinstance(probe, Finger):
                    tables.append(probe.slope_table(surface))  # type: ignore[arg-type]
                else:
                    tolerance = _MAP_TOLERANCE if isinstance(plate, Paper) else _TOLERANCE
                    tables.append(slope_table(surface, probe, tolerance=tolerance))
            self.tables[key] = tuple(tables)
        return self.tables[key]


def judged(finding: Finding, lab: Laboratory, measure: Measure) -> Verdict:
    """Return the verdict; a hand that cannot be dragged somewhere gives none, and the reason."""
    try:
        return finding.judge(lab, measure)
    except AsperityError as error:
        return Verdict(None, {}, f"Could not be simulated: {error}.")
