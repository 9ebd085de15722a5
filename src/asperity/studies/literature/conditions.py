"""The simulated conditions of the findings: from a laboratory and a metric to a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.offsets.surface import drop_point
from asperity.studies.literature import criteria
from asperity.studies.literature.criteria import maximum_of
from asperity.studies.literature.finding import Judge, Verdict
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.laboratory import Laboratory
from asperity.studies.literature.measures import Measure
from asperity.studies.literature.plates import Grains, Gratings, Paper
from asperity.studies.otaduy_lin_2004.claims import plain

GRAINS = (("P40", 425e-6), ("P60", 269e-6), ("P80", 201e-6), ("P120", 115e-6))
"""Grits and their grain sizes [m]; P40 and P120 from the notes of the data, others recalled."""
RELIEFS = (0.3, 1.0)
"""Assumed reliefs of the measured papers, peak to peak in grains; the files lack their scale."""
_STROKE = (0.5 * np.pi * np.sin((np.arange(4) + 0.5) * np.pi / 8.0)).tolist()
"""Speeds in a stroke over their mean, at equal intervals of time."""
FA1 = (5.0, 50.0)
FA2 = (50.0, 500.0)
"""Bands of fast-adapting afferents [Hz]; recalled, and authors differ on them."""
LOW_FORCE = Measure(signal="force", band=FA1)
RIVALS = {
    "force, FA2 band": Measure(signal="force", band=FA2),
    "force, all frequencies": Measure(signal="force"),
    "largest force": Measure(signal="force", power=np.inf),
    "velocity": Measure(signal="velocity"),
    "position": Measure(signal="position"),
}
"""Alternatives to the FA1 band of the force in Unger et al. (2013), as far as Eq. 7 has them."""

Rule = Callable[[NDArray[np.float64], NDArray[np.float64]], Verdict]


def over(factor: str, rule: Rule, *, dots: bool = False) -> Judge:
    """Return the judge that applies a rule to the curves of one of the seed's three factors."""

    def judge(lab: Laboratory, measure: Measure) -> Verdict:
        plate = lab.dots if dots else lab.sinusoids
        return rule(lab.plan.places, lab.curves(measure, plate, lab.plan.touches(factor)))

    return judge


def at_drop_points(
    rule: Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]], Verdict],
    *,
    heights: bool = False,
) -> Judge:
    """Return the judge of a rule on peaks and drop points, over probes and dot heights."""

    def judge(lab: Laboratory, measure: Measure) -> Verdict:
        places, drops, inside = [], [], []
        for height in lab.plan.heights if heights else (lab.dots.height,):
            plate = replace(lab.dots, height=height)
            for touch in lab.plan.touches("diameter"):
                found = maximum_of(lab.plan.places, lab.curve(measure, plate, touch))
                assert isinstance(touch.probe, float)
                places.append(found.spacing)
                drops.append(drop_point(touch.probe, height=height))
                inside.append(found.inside)
        return rule(np.array(places), np.array(drops), np.array(inside))

    return judge


def probe_alone(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge the shape of the probe's curve over dots."""
    smallest = lab.plan.touches("diameter")[:1]
    return criteria.inverted_u(lab.plan.places, lab.curves(measure, lab.dots, smallest))


def finger_and_probe(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge a finger and the smallest probe over the same dots."""
    touches = lab.plan.touch(probe=Finger()), lab.plan.touches("diameter")[0]
    return criteria.linear_against_quadratic(
        lab.plan.places, *lab.curves(measure, lab.dots, touches)
    )


def gratings(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge the curve over the width of grooves."""
    places = lab.plan.groove_places
    curve = lab.curve(measure, Gratings(), lab.plan.touch(), places)
    return criteria.rises_then_levels(places, curve)


def grains(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge generated roughness of equal slopes and four grain sizes, with three probes."""
    return criteria.ordered(grains_curves(lab, measure))


def grains_curves(lab: Laboratory, measure: Measure) -> NDArray[np.float64]:
    """Return the curves over the sizes of `GRAINS`, one for each probe."""
    sizes = [size for _, size in GRAINS]
    return lab.curves(measure, Grains(), lab.plan.touches("diameter"), sizes)


def papers(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge the two measured sandpapers, at the smallest and largest plausible relief."""
    rows, same = [], []
    for touch in lab.plan.touches("diameter"):
        values = {}
        for grit, grain in (GRAINS[0], GRAINS[-1]):
            path = lab.data / f"sandpaper_{grit}_height16.png" if lab.data else None
            if path is None or not path.is_file():
                return Verdict(None, {}, "The measured sandpapers are not available.")
            reliefs = [*(part * grain for part in RELIEFS), RELIEFS[0] * GRAINS[-1][1]]
            values[grit] = lab.curve(measure, Paper(path), touch, reliefs)
        coarse, fine = values.values()
        rows += [[coarse[i], fine[i]] for i in range(len(RELIEFS))]
        same.append(coarse[-1] / max(fine[-1], 1e-300))
    verdict = criteria.ordered(np.array(rows))
    verdict.measured["coarse_over_fine_at_same_relief"] = plain(same)
    return verdict


def passive_and_active(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge the effect of speed on a steady plate (passive) and on strokes to and fro (active)."""
    places = lab.plan.places[:: max(lab.plan.spacings // 6, 1)]
    steady, strokes = [], []
    for speed in (lab.plan.speeds[0], lab.plan.speeds[-1]):
        touch = lab.plan.touch(speed=speed)
        steady.append(lab.curve(measure, lab.sinusoids, touch, places))
        parts = [replace(touch, speed=speed * part) for part in _STROKE]
        strokes.append(measure.together(lab.curves(measure, lab.sinusoids, parts, places)))
    return criteria.stronger(
        criteria.size_of_effect(np.array(steady)), criteria.size_of_effect(np.array(strokes))
    )


def low_band_against_rivals(others: Sequence[Judge]) -> Judge:
    """Return the judge of whether power of force in the FA1 band gets more findings than rivals."""

    def judge(lab: Laboratory, measure: Measure) -> Verdict:
        def count(one: Measure) -> int:
            return sum(bool(other(lab, one).holds) for other in others)

        low = count(LOW_FORCE)
        rivals = {name: count(rival) for name, rival in RIVALS.items()}
        holds = low > max(rivals.values())
        return Verdict(holds, {"of": len(others), "force, FA1 band": low, **rivals})

    return judge
