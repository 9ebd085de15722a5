"""The paragraph of methods of a paper, made from the design, the sessions and the analysis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from asperity.psychophysics.adjustment_settings import AdjustmentSettings, MatchingSettings
from asperity.psychophysics.analysis.figures import value_axis
from asperity.psychophysics.analysis.psychometric_fit import stretch_of
from asperity.psychophysics.analysis.psychometric_search import HIGHEST_LAPSE
from asperity.psychophysics.procedures.questplus import QuestPlusSettings
from asperity.psychophysics.procedures.staircase import StaircaseSettings
from asperity.psychophysics.settings import (
    ConstantSettings,
    ForcedChoiceSettings,
    MagnitudeSettings,
    PairsSettings,
    RankingSettings,
    YesNoSettings,
)

if TYPE_CHECKING:
    from asperity.psychophysics.analysis.results import SessionResult
    from asperity.psychophysics.analysis.thresholds import AnalysisOptions
    from asperity.psychophysics.design import ExperimentDesign

REFERENCES = {
    "Bradley & Terry, 1952": "Bradley, R. A., & Terry, M. E. (1952). Biometrika, 39, 324-345.",
    "Cousineau, 2005": "Cousineau, D. (2005). Tutor. Quant. Methods Psychol., 1, 42-45.",
    "Gourevitch & Galanter, 1967": "Gourevitch, V., & Galanter, E. (1967). Psychometrika, 32, "
    "25-33.",
    "Hautus, 1995": "Hautus, M. J. (1995). Behav. Res. Methods, 27, 46-51.",
    "Hartung & Knapp, 2001": "Hartung, J., & Knapp, G. (2001). Stat. Med., 20, 3875-3889.",
    "Hedges, 1981": "Hedges, L. V. (1981). J. Educ. Stat., 6, 107-128.",
    "Holm, 1979": "Holm, S. (1979). Scand. J. Stat., 6, 65-70.",
    "Kaernbach, 1991": "Kaernbach, C. (1991). Percept. Psychophys., 49, 227-229.",
    "Levitt, 1971": "Levitt, H. (1971). J. Acoust. Soc. Am., 49, 467-477.",
    "Luce, 1959": "Luce, R. D. (1959). Individual Choice Behavior. Wiley.",
    "Morey, 2008": "Morey, R. D. (2008). Tutor. Quant. Methods Psychol., 4, 61-64.",
    "Paule & Mandel, 1982": "Paule, R. C., & Mandel, J. (1982). J. Res. Natl. Bur. Stand., 87, "
    "377-385.",
    "Plackett, 1975": "Plackett, R. L. (1975). J. R. Stat. Soc. C, 24, 193-202.",
    "Schütt et al., 2016": "Schütt, H. H., Harmeling, S., Macke, J. H., & Wichmann, F. A. (2016). "
    "Vision Res., 122, 105-123.",
    "Stevens, 1957": "Stevens, S. S. (1957). Psychol. Rev., 64, 153-181.",
    "Thurstone, 1927": "Thurstone, L. L. (1927). Psychol. Rev., 34, 273-286.",
    "Venzon & Moolgavkar, 1988": "Venzon, D. J., & Moolgavkar, S. H. (1988). Appl. Stat., 37, "
    "87-94.",
    "Watson, 2017": "Watson, A. B. (2017). J. Vision, 17(3):10.",
    "Williams, 1949": "Williams, E. J. (1949). Aust. J. Sci. Res. A, 2, 149-168.",
    "Williams, 1982": "Williams, D. A. (1982). Appl. Stat., 31, 144-148.",
    "Wichmann & Hill, 2001": "Wichmann, F. A., & Hill, N. J. (2001). Percept. Psychophys., 63, "
    "1293-1313.",
}
_WORDS = {1: "one", 2: "two", 3: "three"}
_NAMES = {"weibull": "Weibull", "logistic": "logistic", "normal": "cumulative normal"}


def methods_text(
    designs: Mapping[str, ExperimentDesign],
    results: Sequence[SessionResult],
    options: AnalysisOptions,
) -> str:
    """Return the methods as Markdown: participants, procedure, analysis, references.

    Parameters
    ----------
    designs : mapping of ExperimentDesign by condition
    results : sequence of SessionResult
        Of all conditions.
    options : AnalysisOptions
    """
    parts = [" ".join(_participants(results, tuple(designs)))]
    texts: dict[str, list[str]] = {}
    for name, design in designs.items():
        texts.setdefault(" ".join(_procedure(design)), []).append(name)
    for text, names in texts.items():
        parts.append(text if len(texts) == 1 else f"*{', '.join(names)}.* {text}")
    first = next(iter(designs.values()))
    people = len({result.participant for result in results})
    parts.append(" ".join(_analysis(first, options, people, len(designs))))
    text = "\n\n".join(parts)
    cited = [entry for key, entry in sorted(REFERENCES.items()) if key in text]
    return f"{text}\n\n## References\n\n" + "\n".join(f"- {entry}" for entry in cited) + "\n"


def _participants(results: Sequence[SessionResult], conditions: tuple[str, ...]) -> Iterator[str]:
    from asperity import __version__

    people = len({result.participant for result in results})
    yield (
        f"{people} participant{'s' if people > 1 else ''} took part in "
        f"{len(results)} session{'s' if len(results) > 1 else ''}"
        + (
            f", each in {len(conditions)} conditions ({', '.join(conditions)})."
            if len(conditions) > 1
            else "."
        )
    )
    broken = sum(not result.complete for result in results)
    if broken:
        yield f"{broken} of the sessions {'were' if broken > 1 else 'was'} not completed."
    if any(result.simulated for result in results):
        yield "**The answers are those of a simulated participant, not of people.**"
    yield f"Stimuli were rendered and answers recorded with asperity {__version__}."


def _procedure(design: ExperimentDesign) -> Iterator[str]:
    settings, shown = design.settings, design.presentation
    count = {
        MagnitudeSettings: 1,
        YesNoSettings: 1,
        RankingSettings: len(design.all_stimuli()),
    }.get(type(settings), getattr(settings, "intervals", 2))
    stimuli = "one stimulus was" if count == 1 else f"{_WORDS.get(count, count)} stimuli were"
    longest = "up to " if shown.self_paced else ""
    pause = f", {shown.pause:g} s apart" if count > 1 else ""
    order = "" if count == 1 else " one after the other"
    if count > 1 and not isinstance(settings, AdjustmentSettings | MatchingSettings):
        order += " in random order"
    yield (
        f"In each trial {stimuli} presented{order} for {longest}{shown.seconds:g} s"
        f"{' each' * (count > 1)}{pause}, and participants were asked: "
        f"“{design.question}”"
    )
    if isinstance(settings, ForcedChoiceSettings):
        yield from _forced_choice(design, settings)
    elif isinstance(settings, YesNoSettings):
        yield (
            f"In {settings.trials_without} trials there was no signal, in {settings.repeats} each "
            f"it had one of the levels {', '.join(f'{level:g}' for level in settings.levels)}."
        )
    elif isinstance(settings, AdjustmentSettings | MatchingSettings):
        yield (
            "They changed the comparison in steps until it equalled the standard (method of "
            f"adjustment), {settings.repeats} times for each standard, from starts far below and "
            "far above in turns."
        )
    elif isinstance(settings, MagnitudeSettings):
        yield (
            f"They gave numbers in proportion to the magnitude, with a free modulus (magnitude "
            f"estimation; Stevens, 1957). Each of {len(design.all_stimuli())} stimuli came once "
            f"in each of {settings.blocks} blocks, in random order."
        )
    elif isinstance(settings, PairsSettings | RankingSettings):
        kind = "pair" if isinstance(settings, PairsSettings) else "set"
        yield (
            f"Each {kind} of the {len(design.all_stimuli())} stimuli was presented "
            f"{settings.repeats} times, in random order."
        )
    practice = getattr(settings, "practice", 0)
    if practice:
        what = "adjustments" if design.kind == "adjust" else "trials"
        shown_right = getattr(settings, "practice_feedback", False)
        yield (
            f"The first {practice} {what} were practice and were not analysed"
            + ("; feedback said whether they were right." if shown_right else ".")
        )
    yield from _session(design)


def _session(design: ExperimentDesign) -> Iterator[str]:
    """Yield what is between trials: catch trials, orders, breaks, answers taken back."""
    if design.catch.every:
        level = design.highest if design.catch.level is None else design.catch.level
        yield (
            f"One catch trial, at a level of {level:g}, came among {design.catch.every} others; "
            "catch trials were not analysed."
        )
    if design.session.balanced and design.kind == "choice" and design.adaptive is not None:
        yield "The interval of the comparison was balanced within and over participants."
    elif design.session.balanced and design.method != "yes-no":
        yield "Orders were those of a Williams design over participants (Williams, 1949)."
    if design.session.break_every:
        what = "adjustments" if design.kind == "adjust" else "trials"
        yield (
            f"There was a break of at least {design.session.break_seconds:g} s after every "
            f"{design.session.break_every} {what}."
        )
    if design.session.take_back:
        yield "The last answer could be taken back until the next trial began."


def _forced_choice(design: ExperimentDesign, settings: ForcedChoiceSettings) -> Iterator[str]:
    factor, label = value_axis(design)
    label, _, unit = label.partition(" [")
    unit = unit.rstrip("]")
    of = {"weber": "as a fraction of the standard", "difference": "as a difference"}
    standard = f"{settings.standard * factor:.4g} {unit}".strip()
    apart = "the comparison" if settings.intervals > 2 else "the other"
    yield (
        f"The {label} of {_WORDS[settings.intervals - 1]} of them was the standard, {standard}, "
        f"that of {apart} "
        f"differed by the level, {of.get(settings.level, 'given as its value')} "
        f"({settings.low:g} to {settings.high:g}, "
        f"{'logarithmic' if settings.scale == 'log' else 'linear'} scale)."
    )
    if settings.feedback:
        yield "Feedback said whether each answer was right."
    adaptive = design.adaptive
    if isinstance(adaptive, StaircaseSettings):
        yield from _staircase(adaptive, settings.scale == "log")
    elif isinstance(adaptive, QuestPlusSettings):
        yield (
            "The level of each trial was the one after which the expected entropy of the "
            "posterior of threshold, width and lapse rate was least (QUEST+; Watson, 2017), on a "
            f"grid of {adaptive.thresholds} thresholds, {len(adaptive.widths)} widths and "
            f"{len(adaptive.lapses)} lapse rates. A session ended after {adaptive.trials} trials"
            + (f" or when the threshold's posterior standard deviation fell below "
               f"{adaptive.until:g}." if adaptive.until else ".")
        )  # fmt: skip
    elif isinstance(adaptive, ConstantSettings):
        yield (
            f"By the method of constant stimuli each of {len(adaptive.levels)} levels "
            f"({', '.join(f'{level:g}' for level in adaptive.levels)}) was presented "
            f"{adaptive.repeats} times, in blocks of random order: {adaptive.most} trials."
        )


def _staircase(rules: StaircaseSettings, logarithmic: bool) -> Iterator[str]:
    tracks = len(rules.start)
    steps = ", ".join(f"{step:g}" for step in rules.steps)
    author = "Kaernbach, 1991" if rules.up_ratio != 1.0 else "Levitt, 1971"
    kind = "weighted" if rules.up_ratio != 1.0 else "transformed"
    right = "one right answer" if rules.down == 1 else f"{rules.down} right answers in a row"
    up = "one step" if rules.up_ratio == 1.0 else f"{rules.up_ratio:g} steps"
    yield (
        f"Levels followed {'a' if tracks == 1 else f'{tracks} interleaved'} {kind} up-down "
        f"staircase{'s' * (tracks > 1)} ({author}): after {right} the level was lowered by one "
        f"step, after a wrong one raised by {up}, which converges to "
        f"{100.0 * rules.target:.1f} % right. Steps were "
        f"{'factors' if logarithmic else 'differences'} of {steps}, the next after each "
        f"reversal; {'the track' if tracks == 1 else 'the tracks'} began at "
        f"{', '.join(f'{level:g}' for level in rules.start)} and ended after {rules.trials} trials"
        f"{' each' * (tracks > 1)}"
        + (f" or {rules.reversals} reversals, whichever came first." if rules.reversals else ".")
    )


def _analysis(
    design: ExperimentDesign, options: AnalysisOptions, people: int, conditions: int
) -> Iterator[str]:
    percent = f"{100.0 * options.confidence:g} %"
    if isinstance(design.settings, ForcedChoiceSettings):
        guess = design.settings.guess
        factor = stretch_of(design.settings.adaptive, guess)["threshold"]
        held = "equal to the lapse rate" if guess is None else f"of {guess:.3g}"
        yield (
            f"A {_NAMES[options.function]} psychometric function with a guess rate {held} and a "
            f"lapse rate between 0 and {HIGHEST_LAPSE:g} (Wichmann & Hill, 2001) was fitted to "
            f"each session by maximum likelihood. The threshold is where it is half-way between "
            f"its asymptotes, the width is from 5 to 95 % of that range (Schütt et al., 2016). "
            f"Intervals ({percent}) are by profile likelihood (Venzon & Moolgavkar, 1988), its "
            f"fall multiplied by a factor found by simulation ({factor:g} for the threshold); "
            f"goodness of fit was judged by the deviance, against {options.samples} samples of a "
            f"parametric bootstrap."
        )
        if options.overdispersed:
            yield (
                "Estimates and intervals were corrected for overdispersion (Williams, 1982), where "
                "Pearson's statistic exceeded its degrees of freedom."
            )
        if people > 1:
            yield (
                "Means over participants are of a random-effects model (Paule & Mandel, 1982) "
                f"with {percent} intervals of Student's t (Hartung & Knapp, 2001)"
                + ("; thresholds were averaged as logarithms." if design.settings.scale == "log"
                   else ".")
            )  # fmt: skip
    elif isinstance(design.settings, MagnitudeSettings):
        yield (
            "Estimates were divided by each participant's geometric mean and multiplied by the "
            "grand one. Exponents are slopes of straight lines in log-log coordinates; intervals "
            f"({percent}) are of Student's t, over participants where there are several and over "
            "the repeats of one otherwise, of the means of stimuli after Cousineau, 2005, and "
            "Morey, 2008."
        )
    elif isinstance(design.settings, YesNoSettings):
        yield (
            "Sensitivity and bias are d' and the criterion c of log-linear rates (Hautus, 1995), "
            f"with {percent} intervals after Gourevitch & Galanter, 1967."
        )
        if len(design.settings.levels) > 1:
            yield (
                "The level of d' = 1 is of d' as a power function of the level, fitted by maximum "
                "likelihood with intervals by profile likelihood (Venzon & Moolgavkar, 1988)."
            )
    elif isinstance(design.settings, AdjustmentSettings | MatchingSettings):
        mean = "geometric mean" if design.matching.scale == "log" else "mean"
        yield (
            f"The point of subjective equality is the {mean} of the settings to a standard, the "
            "just noticeable difference their standard deviation"
            + (" of logarithms" if design.matching.scale == "log" else "")
            + f"; {percent} intervals are of Student's t and of chi-squared."
        )
    elif isinstance(design.settings, PairsSettings | RankingSettings):
        yield (
            "Scale values are of the model of Bradley and Terry (Bradley & Terry, 1952; Plackett, "
            "1975; Luce, 1959) and of case V of Thurstone, 1927, with "
            f"{percent} intervals of {options.samples} bootstrap samples over trials."
        )
    if conditions > 1 and people > 1:
        yield (
            "Conditions were compared by paired t tests over participants; effect sizes are "
            "Cohen's d_z with intervals of the noncentral t distribution, and with the correction "
            "of Hedges, 1981."
            + (" p values were corrected after Holm, 1979." if conditions > 2 else "")
        )
