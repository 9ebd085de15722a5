"""The findings: what people were found to feel, by whom, and how it is simulated.

`findings.toml` holds their sources and texts, and this module how each is judged.

Criteria were written from the sources before the outcomes were known, except where `before` is
false: the seed paper's three effects had already been simulated with the studies' metrics.
"""

from __future__ import annotations

from dataclasses import replace

from asperity._core.data import table_beside
from asperity.studies.literature import conditions, criteria, finger_conditions, virtual_conditions
from asperity.studies.literature.conditions import at_drop_points, over
from asperity.studies.literature.finding import Finding, Judge, Source, Sureness

_JUDGES: dict[str, Judge] = {
    "diameter.higher": over("diameter", criteria.peaks_fall_with),
    "diameter.smaller_spacing": over("diameter", criteria.peaks_move_right),
    "force.rougher": over("force", criteria.rises_everywhere),
    "force.place": over("force", criteria.peaks_stay),
    "speed.large": over("speed", criteria.rises_at_large),
    "speed.small": over("speed", criteria.falls_at_small),
    "speed.peak": over("speed", criteria.peaks_move_right),
    "probe.inverted_u": conditions.probe_alone,
    "finger.line": conditions.finger_and_probe,
    "drop.follows": at_drop_points(criteria.follows, heights=True),
    "drop.near": at_drop_points(criteria.near),
    "static.too_low": at_drop_points(criteria.above),
    "static.speed": over("speed", criteria.peaks_move_right, dots=True),
    "gratings.level": conditions.gratings,
    "grit.generated": conditions.grains,
    "grit.measured": conditions.papers,
    "passive.speed": conditions.passive_and_active,
}
_LOW_BAND = conditions.low_band_against_rivals(
    [judge for name, judge in _JUDGES.items() if not name.startswith("grit")]
)
_LATER: dict[str, Judge] = {
    "gratings.groove": finger_conditions.groove_dominates,
    "cones.inverted_u": virtual_conditions.cones_inverted_u,
    "cones.probe_size": virtual_conditions.cones_probe_size,
    "sinusoids.descend": virtual_conditions.sinusoids_under_a_point,
    "probe.smoothest": finger_conditions.rigid_on_smoothest,
    "textures.alike": finger_conditions.finger_as_probe,
    "finger.force": finger_conditions.force_over_gratings,
    "finger.speed": finger_conditions.speed_over_gratings,
    "finger.ridges": finger_conditions.wider_ridges,
    "finger.groove_over_rate": finger_conditions.groove_over_rate,
    "finger.dots": finger_conditions.rises_over_dots,
    "finger.jitter": finger_conditions.jitter_hardly_matters,
    "finger.low_relief": finger_conditions.low_relief,
    "finger.small_elements": finger_conditions.smaller_elements,
    "finger.textures": finger_conditions.textures_dwarf_speed,
}


def _read_findings() -> tuple[Finding, ...]:
    document = table_beside(__file__, "findings.toml")
    sources = {key: Source(**entry) for key, entry in document["sources"].items()}
    judges = _JUDGES | _LATER | {"power.low_band": _LOW_BAND}
    return tuple(
        Finding(**entry | {
            "id": name,
            "sources": tuple(sources[key] for key in entry["sources"]),
            "sureness": Sureness[entry["sureness"].upper()],
            "condition": entry["condition"].format(**document["terms"]),
            "judge": judges[name],
        })
        for name, entry in document["findings"].items()
    )  # fmt: skip


FINDINGS = _read_findings()
"""All of them, in the order of the table."""
JUDGED_BY_METRIC = tuple(finding for finding in FINDINGS if not finding.any_metric)
"""Every finding whose outcome depends on the metric."""
SEARCHED = tuple(finding for finding in JUDGED_BY_METRIC if not finding.later)
"""Those that the search for one hand and metric saw."""
_CRUDE = "a finger that averages over 8 mm"


def of_fingers(finger: str) -> tuple[Finding, ...]:
    """Return the findings in whose condition a bare finger touches, for a model of the finger.

    Their texts are of a finger that averages over its contact ("averaging"). For another model
    they tell so, and that more force gives more counts: other models can fail it.
    """
    found = tuple(finding for finding in FINDINGS if "finger" in finding.condition)
    if finger == "averaging":
        return found
    return tuple(
        replace(
            finding,
            condition=finding.condition.replace(_CRUDE, "a finger"),
            caveat="The criterion was written for a finger that averages over its contact.",
            by_construction=finding.by_construction and finding.id != "finger.force",
        )
        for finding in found
    )
