"""The findings: what people were found to feel, by whom, and how it is simulated.

Criteria were written from the sources before the outcomes were known, except where `before` is
false: the seed paper's three effects had already been simulated with the studies' metrics.
"""

from __future__ import annotations

from asperity.studies.literature import conditions, criteria, sources
from asperity.studies.literature.finding import Finding, Sureness

_SINUSOIDS = "sinusoids of 0.1 mm amplitude, wavelength 0.5 to 3.5 mm"
_DOTS = "jittered dots 0.4 mm high and 0.5 mm wide, gaps of 0.5 to 3.5 mm, three paths"
_THREE = "probes of 2, 3 and 4 mm"
_MIDDLE = "3 mm, 0.58 N, 83 mm/s"

_SEED: tuple[Finding, ...] = (
    Finding(
        id="diameter.higher",
        title="A smaller probe: rougher at its peak",
        people="The peak of roughness over spacing is higher for smaller probes.",
        sources=(sources.DIAMETER_AND_FORCE, sources.SEED),
        where="seed section 3.1, colour plate 1",
        sureness=Sureness.SEED,
        condition=f"{_THREE} at 0.58 N and 83 mm/s over {_SINUSOIDS}",
        criterion="every curve peaks inside the range, and each larger probe's peak is lower",
        judge=conditions.over("diameter", criteria.peaks_fall_with),
        before=False,
    ),
    Finding(
        id="diameter.smaller_spacing",
        title="A smaller probe: peak at a smaller spacing",
        people="The peak lies at a smaller spacing for smaller probes.",
        sources=(sources.DIAMETER_AND_FORCE, sources.SEED),
        where="seed section 3.1, colour plate 1",
        sureness=Sureness.SEED,
        condition=f"{_THREE} at 0.58 N and 83 mm/s over {_SINUSOIDS}",
        criterion="every curve peaks inside, and each larger probe's peak lies over 2 % further",
        judge=conditions.over("diameter", criteria.peaks_move_right),
        before=False,
    ),
    Finding(
        id="force.rougher",
        title="A larger force: rougher",
        people="Roughness is higher for larger normal force.",
        sources=(sources.DIAMETER_AND_FORCE, sources.SEED),
        where="seed section 3.1, colour plate 2",
        sureness=Sureness.SEED,
        condition=f"0.29, 0.58 and 0.87 N with 3 mm at 83 mm/s over {_SINUSOIDS}",
        criterion="each larger force gives more at every spacing",
        judge=conditions.over("force", criteria.rises_everywhere),
        before=False,
        caveat="Eq. 6 has the force as a factor: it could hardly fail.",
    ),
    Finding(
        id="force.place",
        title="A larger force: the peak stays",
        people="The influence of force on the peak's place is negligible.",
        sources=(sources.DIAMETER_AND_FORCE, sources.SEED),
        where="seed section 3.1, colour plate 2",
        sureness=Sureness.SEED,
        condition=f"0.29, 0.58 and 0.87 N with 3 mm at 83 mm/s over {_SINUSOIDS}",
        criterion="every curve peaks inside, and the peaks' places differ by under 10 %",
        judge=conditions.over("force", criteria.peaks_stay),
        before=False,
    ),
    Finding(
        id="speed.large",
        title="Faster: rougher at large spacing",
        people="With higher speed, plates feel rougher at large spacing.",
        sources=(sources.SPEED, sources.SEED),
        where="seed section 3.1, colour plate 3",
        sureness=Sureness.SEED,
        condition=f"42, 83 and 169 mm/s with 3 mm and 0.58 N over {_SINUSOIDS}",
        criterion="each higher speed gives more at 2.5 mm",
        judge=conditions.over("speed", criteria.rises_at_large),
        before=False,
    ),
    Finding(
        id="speed.small",
        title="Faster: smoother at small spacing",
        people="With higher speed, plates feel smoother at small spacing.",
        sources=(sources.SPEED, sources.SEED),
        where="seed section 3.1, colour plate 3",
        sureness=Sureness.SEED,
        condition=f"42, 83 and 169 mm/s with 3 mm and 0.58 N over {_SINUSOIDS}",
        criterion="each higher speed gives less at 0.5 mm",
        judge=conditions.over("speed", criteria.falls_at_small),
        before=False,
        caveat="The seed paper's own simulation misses it.",
    ),
    Finding(
        id="speed.peak",
        title="Faster: peak at a larger spacing",
        people="The peak of roughness occurs at larger spacing for higher speed.",
        sources=(sources.SPEED, sources.SEED),
        where="seed section 3.1, colour plate 3",
        sureness=Sureness.SEED,
        condition=f"42, 83 and 169 mm/s with 3 mm and 0.58 N over {_SINUSOIDS}",
        criterion="every curve peaks inside, and each higher speed's peak lies over 2 % further",
        judge=conditions.over("speed", criteria.peaks_move_right),
        before=False,
    ),
)

_OTHERS: tuple[Finding, ...] = (
    Finding(
        id="probe.inverted_u",
        title="Through a small probe: an inverted U",
        people="Through a rigid probe, roughness over spacing is best fit by a quadratic in "
        "log-log: it rises, peaks and falls.",
        sources=(sources.FINGER_AND_PROBE, sources.SEED),
        where="seed section 3.1",
        sureness=Sureness.SEED,
        condition=f"2 mm at 0.58 N and 83 mm/s over {_DOTS}",
        criterion="a quadratic fits with R^2 of at least 0.9 and peaks inside the range",
        judge=conditions.probe_alone,
        caveat="The criterion lets through a curve that levels and does not fall: max u'' passes "
        "so. The source's abstract, which was read, has the peak for the small probe only.",
    ),
    Finding(
        id="finger.line",
        title="Finger: a line; probe: a quadratic",
        people="Over the same plates, a line in log-log fits roughness by finger best, a "
        "quadratic roughness through a probe.",
        sources=(sources.FINGER_AND_PROBE, sources.SEED, sources.LOW_RELIEF),
        where="seed section 3.1",
        sureness=Sureness.SEED,
        condition=f"a finger that averages over 8 mm, and a probe of 2 mm, over {_DOTS}",
        criterion="finger: a rising line fits with R^2 of at least 0.9; probe: a quadratic does, "
        "peaks inside, and no line does",
        judge=conditions.finger_and_probe,
        caveat="Weak: the finger has no skin, and roughness by finger is coded in space more "
        "than in vibration. Nor is the finding settled: the source's abstract has rising "
        "functions for finger and probes alike, Drewing (2016) an inverted U with the bare finger "
        "for low relief, and over gratings both flatten.",
    ),
    Finding(
        id="drop.follows",
        title="The peak follows the drop point",
        people="The peak depends on probe and dots through the spacing at which the probe can "
        "just fall between two dots.",
        sources=(sources.DROP_POINT, sources.SEED),
        where="seed section 3.2",
        sureness=Sureness.SEED,
        condition=f"{_THREE}, dots 0.2 and 0.4 mm high, at 0.58 N and 83 mm/s",
        criterion="all six curves peak inside; log peak on log drop point has a slope of 0.5 to "
        "1.5 and an R^2 of at least 0.8",
        judge=conditions.at_drop_points(criteria.follows, heights=True),
        caveat="Drop point: 2 sqrt(h (D - h)), from the geometry; the source's own formula was "
        "not seen.",
    ),
    Finding(
        id="drop.near",
        title="The peak lies near the drop point",
        people="The peak occurs approximately at the drop point.",
        sources=(sources.DROP_POINT, sources.SEED),
        where="seed section 3.2",
        sureness=Sureness.SEED,
        condition=f"{_THREE} at 0.58 N and 83 mm/s over {_DOTS}",
        criterion="every curve peaks inside, within a quarter of its drop point",
        judge=conditions.at_drop_points(criteria.near),
    ),
    Finding(
        id="static.too_low",
        title="Geometry alone places the peak too low",
        people="A static geometric model predicts the spacings of greatest roughness with "
        "consistent underestimation.",
        sources=(sources.STATIC_MODEL,),
        where="abstract",
        sureness=Sureness.READ,
        condition=f"{_THREE} at 0.58 N and 83 mm/s over {_DOTS}; static model: the drop point",
        criterion="every curve peaks inside, over 2 % above its drop point",
        judge=conditions.at_drop_points(criteria.above),
        caveat="A curve that levels has its top anywhere beyond the drop point: max u'' passes so. "
        "The source's cones, probes and speeds are unknown.",
    ),
    Finding(
        id="static.speed",
        title="Over dots, speed shifts the peak up",
        people="The probe's velocity explains the underestimation and reduces it substantially.",
        sources=(sources.STATIC_MODEL,),
        where="abstract",
        sureness=Sureness.READ,
        condition=f"42, 83 and 169 mm/s with 3 mm and 0.58 N over {_DOTS}",
        criterion="every curve peaks inside, and each higher speed's peak lies over 2 % further",
        judge=conditions.over("speed", criteria.peaks_move_right, dots=True),
        caveat="The source's dynamics are those of a probe that falls; here it never leaves the "
        "surface, and only the hand has dynamics.",
    ),
    Finding(
        id="gratings.level",
        title="Over gratings: rising, then level",
        people="Over linear gratings, roughness rises with groove width over a narrow band of "
        "widths, then flattens, for finger and probe.",
        sources=(sources.GRATINGS,),
        where="abstract",
        sureness=Sureness.READ,
        condition=f"{_MIDDLE} over ridges 0.4 mm high and 0.5 mm wide, grooves of 0.25 to 6 mm",
        criterion="the curve rises by half or more, and at its end keeps four fifths of its top",
        judge=conditions.gratings,
        caveat="The widths that the source used are unknown.",
    ),
    Finding(
        id="grit.generated",
        title="Coarser grains: rougher (generated)",
        people="Coarser sandpaper is rated rougher.",
        sources=(sources.GRIT,),
        where="",
        sureness=Sureness.RECALLED,
        condition=f"{_THREE} at 0.58 N and 83 mm/s over self-affine roughness of rms slope 0.3, "
        "roll-off at the grain's size: P40, P60, P80, P120",
        criterion="each finer grit gives less, with every probe",
        judge=conditions.grains,
        caveat="Substitutes: the same surface at four sizes. The source had fingers.",
    ),
    Finding(
        id="grit.measured",
        title="Coarser grit: rougher (measured papers)",
        people="Coarser sandpaper is rated rougher.",
        sources=(sources.GRIT,),
        where="",
        sureness=Sureness.RECALLED,
        condition=f"{_THREE} at 0.58 N and 83 mm/s over GelSight maps of P40 and P120",
        criterion="P40 gives more than P120 at a relief of 0.3 and of 1 grain, with every probe",
        judge=conditions.papers,
        caveat="The files lost their vertical scale. A relief in grains puts much of the answer "
        "in by hand; the ratio at the same relief stands beside it, and is no part of the "
        "criterion. The source had fingers.",
    ),
    Finding(
        id="passive.speed",
        title="Speed matters more in passive touch",
        people="Speed has a stronger effect in passive than in active interaction.",
        sources=(sources.SPEED, sources.SEED),
        where="seed section 3.1",
        sureness=Sureness.SEED,
        condition=f"42 and 169 mm/s with 3 mm and 0.58 N over {_SINUSOIDS}; passive: the plate "
        "at steady speed; active: strokes of the same mean speed, sinusoidal in time",
        criterion="the mean |log ratio| over spacings is larger in passive touch by 5 % or more",
        judge=conditions.passive_and_active,
        caveat="Eq. 7 does not know which of plate and hand is moved: at steady speed the two are "
        "the same. Only the uneven speed of a stroke differs here; that one knows how fast one "
        "moves, the likelier reason, is nowhere in the model.",
    ),
)

JUDGED_BY_METRIC = _SEED + _OTHERS
"""Every finding whose outcome depends on the metric."""

LOW_BAND = Finding(
    id="power.low_band",
    title="Power of the force in the low band is the correlate",
    people="Power of the force signal, particularly at the low frequencies of FA1 receptors, is "
    "the physical correlate of perceived roughness, among kinematic and dynamic variables.",
    sources=(sources.BAND_POWER,),
    where="abstract",
    sureness=Sureness.READ,
    condition="all the conditions above but the sandpapers, by six metrics: RMS of the force in "
    "5-50 Hz; in 50-500 Hz; over all frequencies; largest force; RMS of velocity; of position",
    criterion="RMS of the force in 5-50 Hz gets more of them than each other metric does",
    judge=conditions.low_band_against_rivals(
        [finding.judge for finding in JUDGED_BY_METRIC if not finding.id.startswith("grit")]
    ),
    caveat="A proxy: the source's ratings are not at hand, so the other findings stand for them. "
    "Its force was along the normal, asperity's is along the surface. The bands are recalled.",
    any_metric=True,
)

FINDINGS = (*JUDGED_BY_METRIC, LOW_BAND)
"""All of them, in the order of the table."""
