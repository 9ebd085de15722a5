"""Conditions of findings on the bare finger: over gratings, dots, waves and mixed textures.

The finger is the crude one of `finger.py`, which averages over its contact and has no skin. It is
judged as it is: a finding that it misses stands as missed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from asperity.studies.literature import criteria
from asperity.studies.literature.criteria import maximum_of
from asperity.studies.literature.finding import Verdict
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.laboratory import Laboratory, Touch
from asperity.studies.literature.measures import Measure
from asperity.studies.literature.plates import Grains, Gratings, Plate, Sinusoids
from asperity.studies.otaduy_lin_2004.claims import plain

GROOVES = np.geomspace(0.25e-3, 1.25e-3, 5)
"""Widths of grooves under a finger [m]; asperity's."""
RIDGES = (0.25e-3, 0.5e-3, 1.0e-3)
"""Widths of ridges [m]; asperity's."""
NEGLIGIBLE = 0.2
"""Largest ratio of an effect that is negligible to the one it is compared with."""
DOMINANT = 2.0
"""Least ratio of an effect that is much stronger."""
DWARFS = 4.0
"""Least ratio of a variance that dwarfs another."""
PITCHES = np.geomspace(1.5e-3, 8.5e-3, 8)
"""Spacings of dots, centre to centre, of Depeault et al. (2009) [m]."""
RISING = 0.9
"""Least rank correlation of a monotonic rise."""
ALIKE = 0.7
"""Least rank correlation of ratings that are alike."""
LOW_WAVES = Sinusoids(0.15e-3)
"""Waves 0.3 mm high, the height of Drewing (2016)."""
LOW_PERIODS = (0.5e-3, 10.34e-3)
"""Their shortest and longest period [m]."""
ELEMENTS = (0.3e-3, 0.6e-3, 1.2e-3)
"""Diameters of elements at one pitch [m]; asperity's."""
ELEMENT_PITCH = 2e-3


def finger_touch(lab: Laboratory, **changed: float) -> Touch:
    """Return the touch of a finger at middle levels, with some changed."""
    return lab.plan.touch(probe=Finger(), **changed)


def _log_ratio(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.abs(np.log(np.maximum(one, 1e-300) / np.maximum(other, 1e-300))))


def _rank_correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    ranks = [np.argsort(np.argsort(values)) for values in (one, other)]
    return float(np.corrcoef(ranks[0], ranks[1])[0, 1])


def force_over_gratings(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: a larger force gives more, at every groove."""
    touches = [finger_touch(lab, force=force) for force in lab.plan.forces]
    return criteria.rises_everywhere(GROOVES, lab.curves(measure, Gratings(), touches, GROOVES))


def speed_over_gratings(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: the effect of speed is at most a fifth of the effect of the grooves."""
    speeds = lab.plan.speeds
    touches = [finger_touch(lab, speed=speed) for speed in (speeds[0], speeds[-1])]
    slow, fast = lab.curves(measure, Gratings(), touches, GROOVES)
    effect = float(np.mean(_log_ratio(slow, fast)))
    of_grooves = float(np.mean([np.max(_log_ratio(c, c[:1])) for c in (slow, fast)]))
    return Verdict(
        effect <= NEGLIGIBLE * of_grooves, plain({"speed": effect, "grooves": of_grooves})
    )


def wider_ridges(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: between narrow grooves wider ridges give less; between wide ones they matter less."""
    ends = [GROOVES[0], GROOVES[-1]]
    touch = finger_touch(lab)
    rows = np.array([lab.curve(measure, Gratings(ridge=r), touch, ends) for r in RIDGES])
    narrow, wide = (float(_log_ratio(rows[-1], rows[0])[i]) for i in (0, 1))
    return Verdict(
        bool(rows[-1, 0] < rows[0, 0]) and narrow > wide,
        plain({"narrow": rows[:, 0], "wide": rows[:, 1]}),
    )


def groove_dominates(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge, for finger and probe: grooves explain more of the variance than ridges do."""
    grooves, shares = np.geomspace(0.25e-3, 4e-3, 5), []
    for touch in (finger_touch(lab), lab.plan.touches("diameter")[0]):
        rows = [lab.curve(measure, Gratings(ridge=r), touch, grooves) for r in (*RIDGES, 2e-3)]
        logs = np.log(np.maximum(rows, 1e-300))
        shares.append([np.var(logs.mean(axis=0)), np.var(logs.mean(axis=1))])
    found = np.array(shares)
    return Verdict(
        bool(np.all(found[:, 0] > found[:, 1])),
        plain({"finger_groove_ridge": found[0], "probe_groove_ridge": found[1]}),
    )


def groove_over_rate(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: doubling the groove has twice the effect, or more, of doubling the speed."""
    low = lab.plan.speeds[0]
    touches = [finger_touch(lab, speed=speed) for speed in (low, 2.0 * low)]
    slow, fast = lab.curves(measure, Gratings(), touches, [0.5e-3, 1e-3])
    groove = float(np.mean([_log_ratio(c[:1], c[1:])[0] for c in (slow, fast)]))
    rate = float(np.mean(_log_ratio(slow, fast)))
    return Verdict(groove >= DOMINANT * rate and groove > 0.0, {"groove": groove, "rate": rate})


def rises_over_dots(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: a finger over dots 1.5 to 8.5 mm apart: roughness rises with spacing."""
    gaps = PITCHES - lab.dots.diameter
    curve = lab.curve(measure, lab.dots, finger_touch(lab), gaps)
    rank = _rank_correlation(gaps, curve)
    return Verdict(rank >= RISING, plain({"rank_correlation": rank, "value": curve}))


def jitter_hardly_matters(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: regular and jittered dots differ by at most a fifth of the effect of spacing."""
    gaps = PITCHES - lab.dots.diameter
    plates = (lab.dots, replace(lab.dots, jitter=0.0))
    jittered, regular = (lab.curve(measure, p, finger_touch(lab), gaps) for p in plates)
    effect = float(np.mean(_log_ratio(jittered, regular)))
    spread = float(np.ptp(np.log(np.maximum(jittered, 1e-300))))
    return Verdict(effect <= NEGLIGIBLE * spread, {"jitter": effect, "spacing": spread})


def low_relief(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: over waves 0.3 mm high a finger's curve peaks inside; both ends are a fifth lower."""
    periods = np.geomspace(*LOW_PERIODS, lab.plan.spacings)
    curve = lab.curve(measure, LOW_WAVES, finger_touch(lab), periods)
    top = maximum_of(periods, curve)
    ends = np.array([curve[0], curve[-1]]) / max(top.value, 1e-300)
    return Verdict(
        top.inside and bool(np.all(ends <= criteria.LEVEL)),
        plain({"peak_mm": top.spacing * 1e3, "ends": ends}),
    )


def smaller_elements(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: at one pitch, larger elements give less to a finger."""
    values = np.array([
        lab.curve(
            measure, replace(lab.dots, diameter=size), finger_touch(lab), [ELEMENT_PITCH - size]
        )[0]
        for size in ELEMENTS
    ])  # fmt: skip
    return Verdict(bool(np.all(np.diff(values) < 0.0)), plain({"value": values}))


def _mixed(lab: Laboratory, measure: Measure, touch: Touch) -> NDArray[np.float64]:
    """Return the metric over twelve textures: dots, gratings and grains."""
    sets: tuple[tuple[Plate, list[float]], ...] = (
        (lab.dots, [0.5e-3, 1e-3, 2e-3, 3.5e-3]),
        (Gratings(), [0.25e-3, 0.5e-3, 1e-3, 2e-3]),
        (Grains(), [115e-6, 201e-6, 269e-6, 425e-6]),
    )
    return np.concatenate([lab.curve(measure, plate, touch, at) for plate, at in sets])


def finger_as_probe(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: over twelve textures finger and probe rank alike."""
    finger, probe = (_mixed(lab, measure, t) for t in (finger_touch(lab), lab.plan.touch()))
    rank = _rank_correlation(finger, probe)
    return Verdict(rank >= ALIKE, {"rank_correlation": rank})


def textures_dwarf_speed(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: log roughness varies four times as much over textures as over speeds, or more."""
    rows = [_mixed(lab, measure, finger_touch(lab, speed=v)) for v in lab.plan.speeds]
    logs = np.log(np.maximum(rows, 1e-300))
    textures, speeds = float(np.var(logs.mean(axis=0))), float(np.mean(np.var(logs, axis=0)))
    return Verdict(textures >= DWARFS * speeds, {"textures": textures, "speeds": speeds})


def rigid_on_smoothest(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: over the densest dots a probe gives more than a finger."""
    touches = lab.plan.touches("diameter")[0], finger_touch(lab)
    probe, finger = lab.curves(measure, lab.dots, touches, lab.plan.places[:1])[:, 0]
    return Verdict(bool(probe > finger), plain({"probe": probe, "finger": finger}))
