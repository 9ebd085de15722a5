"""The page's part on the fit: the choice, how it does where it did not look, and how sure it is."""

from __future__ import annotations

from typing import Any

from asperity.studies.literature.page_text import figure, names, wrapped
from asperity.studies.literature.table import MARKS

_UNITS = {"mass": "kg", "stiffness": "N/m", "damping": "N s/m"}


def fit_section(fit: dict[str, Any], images: str) -> str:
    """Return the section, from the fit as `fit.json` holds it."""
    parts = [
        "## One metric and one hand",
        wrapped(_search(fit) + "\n\n" + _choice(fit)),
        figure(f"{images}findings_fit.png", "Profiles of the hand; share of designs a finding"),
        "### Where the choice did not look",
        _held_out(fit),
        wrapped(_other(fit)),
        "### How sure it is",
        _uncertainty(fit),
        wrapped(_rest(fit)),
    ]
    return "\n\n".join(part.strip() for part in parts)


def _search(fit: dict[str, Any]) -> str:
    ranges = ", ".join(
        f"{name} {low:g} to {high:g} {_UNITS[name]}" for name, (low, high) in fit["ranges"].items()
    )
    return f"""
`asperity findings --fit` drags {fit["hands"]} hands of a Sobol design ({ranges}) through the
conditions and reads {fit["metrics"]} metrics off each: max u'', max |u''|, threshold-weighted
power, and the RMS, L4 norm and peak of acceleration and force, in bands and without. It counts
{fit["counted"]} findings; {names(fit["held_out_findings"])} are held out, and so are the
measured papers. The sinusoids' amplitude stays at 0.1 mm. What follows is the fit that asperity is
shipped with; all of it is after the fact."""


def _choice(fit: dict[str, Any]) -> str:
    best, most, refs = fit["chosen"], fit["most"], fit["references"]
    missed = [
        name
        for name, yes in fit["holds"].items()
        if not yes and name not in fit["held_out_findings"]
    ]
    paper, band = refs["max_acceleration"]["counted"], refs["band_rms"]["counted"]
    return f"""
**Most at once** is {most["got"]} of {fit["counted"]}, by {most["pairs"]} of
{fit["hands"] * fit["metrics"]} pairs of hand and metric: {_told(most)}. The first version of this
search took that pair; it did worse than what was there before wherever it had not looked, so a
steadier rule took its place, and the held-out conditions below were drawn afterwards.

**The choice** is the metric that gets most on average over all hands
({fit["mean_of_metric"]:.1f}), and the hand whose neighbourhood in the design does best with it:
{_told(best)}, **{fit["got"]} of {fit["counted"]}**. It misses {names(missed) or "nothing"}. With
the default hand, max u'' gets {paper} and the RMS of u'' in 20-200 Hz {band}.
{fit["pairs_as_good"]} pairs are as good as the choice: the findings do not determine a hand."""


def _told(pair: dict[str, Any]) -> str:
    return (
        f"{pair['name']} with a hand of {pair['mass']:.2g} kg, {pair['stiffness']:.3g} N/m and "
        f"{pair['damping']:.2g} N s/m"
    )


def _held_out(fit: dict[str, Any]) -> str:
    held, boot, other = fit["held_out_findings"], fit["bootstrap"], fit["held_out_conditions"]
    lines = [
        "| held out | choice | most at once | max u'' | RMS of u'', 20-200 Hz |",
        "|---|---|---|---|---|",
    ]
    for name, row in held.items():
        lines.append(_row(f"finding `{name}`", [MARKS[holds] for holds in row]))
    if any(any(row.values()) for row in other.values()):
        sets = fit["held_out_sets"]
        cells = [f"{sum(row.values())} of {sets * len(row)}" for row in other.values()]
        lines.append(_row(f"all findings but the papers, {sets} other conditions", cells))
    left = [boot["left_out"], boot["left_out_lucky"], *boot["left_out_of"].values()]
    lines.append(_row("findings that a bootstrap left out", [f"{part:.0%}" for part in left]))
    return "\n".join(lines)


def _row(head: str, cells: Any) -> str:
    return "| " + " | ".join([head, *cells]) + " |"


def _other(fit: dict[str, Any]) -> str:
    boot, other = fit["bootstrap"], fit["held_out_conditions"]
    sets, chosen = fit["held_out_sets"], other["chosen"]
    always = [name for name, times in chosen.items() if times == sets]
    sometimes = [f"`{name}` {times}" for name, times in chosen.items() if 0 < times < sets]
    never = [name for name, times in chosen.items() if times == 0]
    return f"""
Other conditions: {sets} sets of probes, forces, speeds, dots and amplitudes, drawn at random around
those of the findings (`other_conditions`). In all of them the choice gets {names(always)}; in some
{", ".join(sometimes) or "nothing more"}; in none {names(never) or "of them nothing"}.

The bootstrap draws the counted findings with replacement, chooses again from the whole table, and
scores that choice on the findings that were not drawn, {boot["rounds"]} times. On those drawn it
gets {boot["drawn"]:.0%}; a hand and a metric taken blindly get
{boot["left_out_of_a_random_design"]:.0%}.

{_sentence(fit)}"""


def _sentence(fit: dict[str, Any]) -> str:
    """Say whether the search gained anything where it did not look."""
    sums = {name: sum(row.values()) for name, row in fit["held_out_conditions"].items()}
    boot = fit["bootstrap"]
    gained = (
        sums["chosen"] > sums["band_rms"] and boot["left_out"] > boot["left_out_of"]["band_rms"]
    )
    if gained:
        return "Where it did not look, the choice does better than what was there before."
    return (
        "**Where it did not look, the choice does no better than the RMS of u'' in 20-200 Hz with "
        "the default hand.** What carries over is the step from the largest acceleration to a "
        "band, not the fine choice of hand, band, signal or norm."
    )


def _uncertainty(fit: dict[str, Any]) -> str:
    best, boot = fit["chosen"], fit["bootstrap"]
    band = best["metric"]["band"] or (None, None)
    rows = [(f"{name} [{unit}]", best[name], boot[name]) for name, unit in _UNITS.items()]
    rows.append(("low edge of the band [Hz]", band[0], boot["low_edge"]))
    rows.append(("high edge of the band [Hz]", band[1], boot["high_edge"]))
    good = fit["hands_as_good"]
    lines = [
        "| | choice | hands as good | bootstrap: 5 %, median, 95 % |",
        "|---|---|---|---|",
    ]
    for name, value, spread in rows:
        told = "none" if value is None else f"{value:.3g}"
        span = good.get(name.split(" ")[0])
        cells = [told, f"{span[0]:.2g} to {span[1]:.2g}" if span else "", _spread(spread)]
        lines.append(_row(name, cells))
    return "\n".join(lines)


def _rest(fit: dict[str, Any]) -> str:
    boot, counted = fit["bootstrap"], fit["counted"]
    best = "; ".join(f"{m['name']} {m['best']} ({m['mean']:.1f})" for m in fit["best_metrics"])
    with_one = "; ".join(
        f"`{name}` {fit['best_with'][name]}" for name, yes in fit["holds"].items() if not yes
    )
    return f"""
{fit["hands_as_good"]["hands"]} of {fit["hands"]} hands get as many findings with the chosen metric,
and they span the second column: **the findings say next to nothing of the hand.** The bootstrap's
intervals for it are narrow only because the rule breaks ties in the same way every time; the
figure's profiles, flat from end to end, are the better witness.

What the bootstrap chose: signal {_shares(boot["signal"])}; norm (p) {_shares(boot["norm"])};
metric {_shares(boot["metric"])}.

Metrics by what their best hand gets of {counted} (in brackets: their mean over hands): {best}.

Most findings, of {counted}, that any hand and metric gets together with one that the choice misses
(0: no design gets it): {with_one or "it misses none"}."""


def _spread(spread: dict[str, float] | None) -> str:
    if spread is None:
        return "none"
    return f"{spread['low']:.3g}, {spread['median']:.3g}, {spread['high']:.3g}"


def _shares(shares: dict[str, float]) -> str:
    return ", ".join(f"{name} {share:.0%}" for name, share in shares.items()) or "none"
