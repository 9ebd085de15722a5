"""What is averaged over a tick, and that no false tones come through."""

import numpy as np
import pytest
from scipy.signal.windows import chebwin

from asperity.geometry.offsets.analytic import Sinusoid
from asperity.geometry.offsets.surface import Profile
from asperity.simulation.anti_aliasing import BUDGET, SubPoses, Window, sub_poses

DIAMETER, AMPLITUDE, SPEED, STIFFNESS, TICK = 3e-3, 1e-4, 0.169, 400.0, 1e-3


class Rub:
    """The wrench of a disk on a sinusoid at constant height, from a fine table of its offset."""

    def __init__(self, spacing):
        surface: Profile = Sinusoid(amplitude=AMPLITUDE, spacing=spacing)
        tracer = surface.tracer(DIAMETER)
        self.spacing = spacing
        self.count = 40_000
        u = (np.arange(self.count) + 0.5) / self.count * spacing
        heights, slopes = tracer(u)[:2]
        depth = heights - heights.min() + 0.58 / STIFFNESS
        self.table = np.zeros((self.count, 6))
        self.table[:, 0] = -STIFFNESS * depth * slopes
        self.table[:, 2] = STIFFNESS * depth
        self.evaluations = 0

    def __call__(self, u):
        self.evaluations += 1
        return self.table[int(u / self.spacing % 1.0 * self.count) % self.count]


def dragged(rub, mode, ticks):
    """Return the tangential force of so many ticks, after those that fill the window."""
    window = Window(mode)
    count = int(np.ceil(8 * SPEED * TICK / rub.spacing))
    last, out = rub(0.0), []
    for tick in range(ticks + 10):
        begin = SPEED * TICK * tick
        nodes = sub_poses(lambda s, b=begin: rub(b + s * SPEED * TICK), last, count, lever=0.1)
        last = nodes.wrench[-1]
        out.append(window.weigh(nodes)[0])
    return np.array(out[-ticks:])


def false_tones(force, spacing):
    """Return the largest line that is no multiple of speed over spacing, over the largest [dB].

    The force covers whole periods of the texture: no window is needed.
    """
    lines = np.abs(np.fft.rfft(force - force.mean()))
    order = np.fft.rfftfreq(len(force), TICK) * spacing / SPEED
    own = np.abs(order - np.round(order)) < 1e-6
    return 20.0 * np.log10(lines[~own].max() / lines.max())


@pytest.mark.parametrize("um", [500, 620, 810, 1000, 1500, 2300, 3500])
def test_false_tones_stay_under_40_db(um):
    rub = Rub(um * 1e-6)
    # um ticks of 169 um are 169 periods.
    force = dragged(rub, "band", um)
    assert false_tones(force, rub.spacing) < -50.0
    assert rub.evaluations / um < 20


def test_without_it_they_do_not():
    rub = Rub(620e-6)
    force = np.array([rub(SPEED * TICK * tick)[0] for tick in range(620)])
    assert false_tones(force, rub.spacing) > -20.0


def test_the_window_is_dolph_and_chebyshevs():
    expected = chebwin(5 * 256, 60.0)
    weights = Window("band").weights
    np.testing.assert_allclose(weights, expected / expected.sum(), atol=1e-12)
    np.testing.assert_allclose(Window("tick").weights, 1 / 256)


def test_the_band_ends_at_half_the_ticks_rate():
    weights = Window("band").weights
    frequency = np.arange(0, 5000, 5.0)
    turns = np.outer(frequency, np.arange(1280) / 256 * TICK)
    gain = 20 * np.log10(np.abs(np.exp(-2j * np.pi * turns) @ weights) + 1e-12)
    assert (gain[frequency >= 500.0] < -58.0).all()
    assert gain[frequency == 100.0] > -2.0


@pytest.mark.parametrize(("mode", "delay"), [("tick", 0.5), ("band", 2.5)])
def test_a_steady_rise_comes_late_by_half_the_window(mode, delay):
    window, rate = Window(mode), np.array([1.0, -2.0, 3.0, 0.1, 0.2, 0.3])
    for tick in range(12):
        s = np.sort(np.concatenate([[0.0, 1.0], np.random.default_rng(tick).random(tick)]))
        out = window.weigh(SubPoses(s, np.outer(tick + s, rate), False))
    np.testing.assert_allclose(out, (12 - delay) * rate, rtol=1e-9)


def test_what_does_not_change_passes_unchanged_from_the_first_tick():
    still = SubPoses(np.array([0.0, 1.0]), np.full((2, 6), 0.3), False)
    for mode in ("tick", "band"):
        np.testing.assert_allclose(Window(mode).weigh(still), 0.3, rtol=1e-12)


def test_a_leap_is_found_and_the_mean_right():
    place = 0.3123

    def evaluate(s):
        return np.full(6, 1.0 if s > place else 0.0)

    nodes = sub_poses(evaluate, np.zeros(6), 2, lever=1.0)
    mean = Window("tick").weigh(nodes)
    np.testing.assert_allclose(mean, 1.0 - place, atol=2e-4)
    assert not nodes.spent
    coarse = sub_poses(evaluate, np.zeros(6), 2, lever=1.0, halve=False)
    assert len(coarse.s) == 3


def test_a_spent_budget_is_told():
    nodes = sub_poses(lambda s: np.full(6, s), np.zeros(6), BUDGET + 1, lever=1.0)
    assert nodes.spent
    assert len(nodes.s) == BUDGET + 1
    wild = sub_poses(lambda s: np.full(6, np.sin(1e6 * s)), np.zeros(6), 1, lever=1.0)
    assert wild.spent


@pytest.mark.parametrize("leap", [0.0, 0.02])
def test_what_goes_on_smoothly_is_not_halved_and_a_leap_is(leap):
    """A wave of 40 ticks, 6 % up and down, with and without a leap of 2 % in the last tick."""

    def wrench(tick):
        up = 1.0 + 0.06 * np.sin(0.05 * np.pi * tick) + (leap if tick > 9.3 else 0.0)
        return np.array([0.0, 0.0, up, 0.0, 0.0, 0.0])

    asked = []

    def evaluate(s):
        asked.append(s)
        return wrench(9.0 + s)

    past = [wrench(8.0), wrench(7.0)]
    options = {"lever": 0.1, "leap": 1e-3}
    nodes = sub_poses(evaluate, wrench(9.0), 1, before=past, **options)
    assert not nodes.spent
    if not leap:
        assert asked == [1.0]
        asked.clear()
        sub_poses(evaluate, wrench(9.0), 1, **options)
        assert len(asked) > 0
    else:
        assert np.diff(nodes.s).min() < 0.1
        at = nodes.s[np.argmax(np.diff(nodes.wrench[:, 2]))]
        assert at == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize("fit", [0, 3, 7, 20])
def test_without_time_the_last_pose_is_looked_at_all_the_same(fit):
    asked = []

    def evaluate(s):
        asked.append(s)
        return np.full(6, s)

    nodes = sub_poses(
        evaluate, np.zeros(6), 8, lever=0.1, halve=False, in_time=lambda: len(asked) < fit
    )
    assert asked[-1] == nodes.s[-1] == 1.0
    assert len(asked) == min(fit, 7) + 1
    assert nodes.spent == (fit < 7)
    # What is left out is a straight line.
    np.testing.assert_allclose(Window("tick").weigh(nodes), 0.5)
