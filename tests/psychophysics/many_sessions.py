"""Simulated sessions of a forced choice, many at once: the rules of the procedures on arrays."""

import numpy as np

from asperity.psychophysics.analysis.psychometric import Psychometric, hits_by_level
from asperity.psychophysics.procedures.procedures import quest_plus
from asperity.psychophysics.procedures.questplus import QuestPlusSettings
from asperity.psychophysics.procedures.staircase import StaircaseSettings


def truth_of(design):
    """Return the psychometric function of a design's simulated participant."""
    own, settings = design.simulated, design.forced_choice
    threshold = settings.intensity(own.threshold)
    return Psychometric(threshold, own.width, own.lapse, settings.guess, own.function)


def many_sessions(design, sessions, seed):
    """Return intensities and hits (sessions, trials) of a design's simulated participant."""
    adaptive, rng = design.adaptive, np.random.default_rng(seed)
    if isinstance(adaptive, StaircaseSettings):
        tracks = [_staircases(design, start, sessions, rng) for start in adaptive.start]
        return tuple(np.concatenate(part, axis=1) for part in zip(*tracks, strict=True))
    if isinstance(adaptive, QuestPlusSettings):
        return _quests(design, sessions, rng)
    levels = [presented(design, design.forced_choice.intensity(v)) for v in adaptive.levels]
    x = np.tile(np.repeat(levels, adaptive.repeats), (sessions, 1))
    return x, rng.random(x.shape) < truth_of(design)(x)


def presented(design, intensity):
    """Return the intensity that is presented where one is wanted: levels have nine digits."""
    settings = design.forced_choice
    return settings.intensity(settings.level_of(float(intensity)))


def _staircases(design, start, sessions, rng):
    """Return one track of each session; tracks know nothing of each other."""
    rules, settings, truth = design.adaptive, design.forced_choice, truth_of(design)
    steps = np.array([settings.intensity(step) for step in rules.steps])
    low, high = settings.intensity(settings.low), settings.intensity(settings.high)
    now = np.full(sessions, settings.intensity(start))
    row, heading, turns = (np.zeros(sessions, int) for _ in range(3))
    xs, all_hits, known = [], [], {}
    for _ in range(rules.trials):
        for value in np.unique(now):
            known.setdefault(value, presented(design, value))
        x = np.array([known[value] for value in now])
        hit = rng.random(sessions) < truth(x)
        xs.append(x)
        all_hits.append(hit)
        row = np.where(hit, row + 1, 0)
        way = np.where(hit, -(row == rules.down).astype(int), 1)
        row[way == -1] = 0
        turns += (way != 0) & (heading != 0) & (way != heading)
        heading = np.where(way != 0, way, heading)
        step = steps[np.minimum(turns, len(steps) - 1)]
        size = np.where(way > 0, step * rules.up_ratio, step * way)
        now = np.round(np.clip(now + size, low, high), 12)
    return np.stack(xs, axis=1), np.stack(all_hits, axis=1)


def _quests(design, sessions, rng):
    quest, truth = quest_plus(design), truth_of(design)
    wrong, right = quest._likelihood
    p = np.tile(quest.posterior.ravel(), (sessions, 1))
    levels = np.array([presented(design, value) for value in quest.intensities])
    xs, all_hits = [], []
    for _ in range(design.adaptive.trials):
        expected = p @ quest._entropy_rate.T
        for likelihood in (wrong, right):
            answer = np.clip(p @ likelihood.T, 1e-300, 1.0)
            expected += answer * np.log(answer)
        at = np.argmin(expected, axis=1)
        hit = rng.random(sessions) < truth(levels[at])
        p = p * np.where(hit[:, None], right[at], wrong[at])
        p /= p.sum(axis=1, keepdims=True)
        xs.append(levels[at])
        all_hits.append(hit)
    return np.stack(xs, axis=1), np.stack(all_hits, axis=1)


def by_level(x, hits):
    """Return levels, counts and hits (sessions, levels); levels with a count of 0 fill the rows."""
    rows = [hits_by_level(*session) for session in zip(x, hits, strict=True)]
    most = max(len(row[0]) for row in rows)

    def filled(part, end):
        """Return rows of one length; `end` fills them, or their last value."""
        fills = [row[part][-1] if end is None else end for row in rows]
        return np.stack([
            np.pad(row[part], (0, most - len(row[0])), constant_values=fill)
            for row, fill in zip(rows, fills, strict=True)
        ])  # fmt: skip

    return filled(0, None), filled(1, 0.0), filled(2, 0.0)
