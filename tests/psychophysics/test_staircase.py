"""Staircases: their rules, step by step, and where they go."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.psychometric import Psychometric
from asperity.psychophysics.procedures.staircase import Staircase, StaircaseSettings


def test_two_down_one_up_by_hand():
    track = Staircase(10.0, (4.0, 2.0, 1.0), down=2, reversals=4)
    levels = []
    for right in (True, True, True, True, False, True, True, False, True, False):
        levels.append(track.intensity)
        track.answer(right)
    # Down 4 after two right, again; wrong: the first reversal, so up 2; down again: 1; up 1 ...
    assert levels == [10, 10, 6, 6, 2, 4, 4, 3, 4, 4]
    assert track.reversal_intensities == [2, 4, 3]
    assert track.intensity == 5.0
    assert not track.is_over
    track.answer(True)
    track.answer(True)
    assert track.reversal_intensities == [2, 4, 3, 5]
    assert track.is_over


def test_weighted_steps_and_bounds():
    track = Staircase(3.0, (1.0,), down=1, up_ratio=3.0, low=2.0, high=5.0)
    for right, then in ((True, 2.0), (True, 2.0), (False, 5.0), (False, 5.0), (True, 4.0)):
        track.answer(right)
        assert track.intensity == then


@pytest.mark.parametrize(
    ("down", "ratio", "target"),
    [(1, 1.0, 0.5), (2, 1.0, 0.7071), (3, 1.0, 0.7937), (1, 3.0, 0.75), (2, 0.5488, 0.5953)],
)
def test_it_hovers_where_the_rule_says(down, ratio, target):
    settings = StaircaseSettings((0.0,), (0.02,), down=down, up_ratio=ratio)
    assert settings.target == pytest.approx(target, abs=1e-4)
    truth = Psychometric(0.0, 1.5, 0.0, 0.0, "logistic")
    rng = np.random.default_rng(1)
    track = Staircase(0.3, (0.02,), down, ratio, reversals=10**6, trials=10**6)
    seen = []
    for trial in range(6000):
        seen.append(track.intensity)
        track.answer(rng.random() < truth(track.intensity))
        del trial
    assert float(truth(np.mean(seen[500:]))) == pytest.approx(target, abs=0.03)


def test_mean_of_reversals_takes_peaks_and_valleys_equally():
    track = Staircase(0.0, (1.0,), down=1)
    track.reversal_intensities = [9.0, 9.0, 9.0, 9.0, 2.0, 4.0, 2.0]
    assert track.threshold() == 3.0
    track.reversal_intensities = []
    assert np.isnan(track.threshold())


def test_refuses():
    with pytest.raises(AsperityError, match="start and steps"):
        StaircaseSettings((), (1.0,))
    with pytest.raises(AsperityError, match=r"down must lie between 1 and 8, got 0"):
        StaircaseSettings((1.0,), (1.0,), down=0)
