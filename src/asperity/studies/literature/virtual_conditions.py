"""Conditions of findings on virtual textures: sinusoids under a point, and cones under spheres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from asperity.studies.literature import criteria
from asperity.studies.literature.finding import Verdict
from asperity.studies.literature.laboratory import Laboratory
from asperity.studies.literature.measures import Measure
from asperity.studies.literature.plates import Dots, Sinusoids
from asperity.studies.otaduy_lin_2004.claims import plain

GROOVES = (0.675e-3, 20.7e-3)
"""Narrowest and widest groove of Kornbrot et al. (2007) [m]."""
POINT = 0.2e-3
"""Diameter of the probe that stands for their point [m]; asperity's."""
EXPONENT = (-1.2, -0.4)
"""Range of exponents that are close to their -0.80; asperity's."""
_CONE_TOP = 0.05e-3


def sinusoids_under_a_point(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: over wide sinusoids roughness falls as a power of about -0.8 of the groove's width."""
    grooves = np.geomspace(*GROOVES, lab.plan.spacings)
    curve = lab.curve(measure, Sinusoids(), lab.plan.touch(probe=POINT), grooves)
    if not np.all(curve > 0.0):
        return Verdict(False, {}, "The metric is zero somewhere.")
    slope = float(np.polyfit(np.log(grooves), np.log(curve), 1)[0])
    return Verdict(EXPONENT[0] <= slope <= EXPONENT[1], {"exponent": slope})


def cones_of(dots: Dots) -> Dots:
    """Return a plate of cones with sides of 45 degrees at the places of a plate of dots."""
    return replace(dots, diameter=_CONE_TOP, flank=dots.height)


def cones_inverted_u(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: over cones, the curve of the smallest sphere is an inverted U."""
    smallest = lab.plan.touches("diameter")[:1]
    curves = lab.curves(measure, cones_of(lab.dots), smallest)
    return criteria.inverted_u(lab.plan.places, curves)


def cones_probe_size(lab: Laboratory, measure: Measure) -> Verdict:
    """Judge: over cones, larger spheres peak at larger spacings."""
    curves = lab.curves(measure, cones_of(lab.dots), lab.plan.touches("diameter"))
    verdict = criteria.peaks_move_right(lab.plan.places, curves)
    return Verdict(verdict.holds, plain(verdict.measured))
