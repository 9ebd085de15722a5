"""From signals to a model: cuts where the process changes, groups, friction, and held-out runs."""

import numpy as np
import pytest
from scipy import signal
from texture_models import model_of, resonance

from asperity.errors import AsperityError
from asperity.runs.tool_motion import one_signal
from asperity.vibrotactile.distances import match
from asperity.vibrotactile.fit import KINDS, FitSettings, fit, judge, long_vibration
from asperity.vibrotactile.segments import cuts
from asperity.vibrotactile.signals import Exploration, explored
from asperity.vibrotactile.summary import in_words, summary_of

RATE = 1000.0


def noise(count, frequency, size, seed):
    white = np.random.default_rng(seed).standard_normal(count + 300)
    made = signal.lfilter([1.0], resonance(frequency, RATE, 0.9), white)[300:]
    return size * made / made.std()


def exploration(speed, force, seconds=2.0, seed=0, mu=0.2):
    """Return a texture whose vibration has the frequency 40 + 2000 v and the size 3 F."""
    n = int(seconds * RATE)
    return Exploration(
        f"{speed} {force}", RATE, noise(n, 40 + 2000 * speed, 3 * force, seed),
        np.full(n, speed), np.full(n, force), np.full(n, mu * force), np.ones(n, bool),
    )  # fmt: skip


def grid(speeds, forces, first):
    pairs = [(v, f) for v in speeds for f in forces]
    return [exploration(v, f, seed=first + i) for i, (v, f) in enumerate(pairs)]


def test_cuts_fall_where_the_process_changes():
    parts = [noise(700, 50, 1.0, 0), noise(500, 200, 1.0, 1), noise(800, 200, 3.0, 2)]
    found = cuts(np.concatenate(parts), order=8, block=20, shortest=150)
    assert found[0] == 0
    assert found[-1] == 2000
    assert len(found) == 4
    assert found[1:3] == pytest.approx([700, 1200], abs=40)
    assert cuts(noise(2000, 50, 1.0, 5), order=8, block=20, shortest=150) == [0, 2000]
    limited = cuts(noise(2000, 50, 1.0, 5), order=8, block=20, shortest=150, longest=500)
    assert max(np.diff(limited)) <= 520


def test_a_known_texture_is_found_between_what_was_recorded():
    fitted = fit(grid((0.03, 0.06, 0.12), (0.3, 0.7, 1.2), 10), name="known")
    model = fitted.model
    assert fitted.recorded == 9
    assert model.friction == pytest.approx(0.2, rel=1e-6)
    frequency = np.linspace(20, 480, 2000)
    for speed, force in ((0.045, 0.5), (0.09, 0.9)):
        density = model.filter_at(speed, force).density(frequency, RATE)
        assert frequency[np.argmax(density)] == pytest.approx(40 + 2000 * speed, rel=0.12)
    held = judge(model, grid((0.045, 0.09), (0.5, 0.9), 100))
    fits = [one.match.fit for one in held]
    assert min(fits) > 0.92
    assert np.median(fits) > 0.97
    assert np.median([one.match.itakura_saito for one in held]) < 0.15
    for one in held:
        assert one.match.level == pytest.approx(1.0, abs=0.25)
        assert one.match.fit > one.noise.fit
    told = summary_of(model, fitted, held)
    assert told["median"]["match"]["fit"] == pytest.approx(np.median(fits))
    assert "against held out" in in_words(told)


@pytest.mark.parametrize("kind", KINDS)
def test_at_rest_and_in_the_air_there_is_silence(kind):
    model = fit(grid((0.03, 0.1), (0.3, 1.0), 0), FitSettings(kind=kind)).model
    for place in ((0.0, 0.5), (0.05, 0.0), (0.0, 0.0)):
        assert model.filter_at(*place).variance == pytest.approx(0.0, abs=1e-12)
    if kind == "harmonic":  # it fades by itself, and has no models but those recorded
        assert len(model.speeds) == 4
        return
    # Every place up to the largest force and speed lies in a triangle.
    rng = np.random.default_rng(0)
    for speed, force in rng.uniform(0.0, (0.1, 1.0), (50, 2)):
        corners, shares = model.weights(speed, force)
        assert shares @ model.speeds[corners] == pytest.approx(speed, abs=1e-9)
        assert shares @ model.forces[corners] == pytest.approx(force, abs=1e-9)


def test_what_cannot_be_fitted_is_said_in_one_line():
    with pytest.raises(AsperityError, match="no stretch"):
        fit([])
    still = exploration(0.0, 0.5)
    with pytest.raises(AsperityError, match="no stretch"):
        fit([still])
    silent = exploration(0.05, 0.5)
    object.__setattr__(silent, "vibration", np.zeros(2000))
    with pytest.raises(AsperityError, match="zero throughout"):
        fit([silent])
    with pytest.raises(AsperityError, match="criterion"):
        FitSettings(criterion="best")


def test_a_stretch_of_changing_speed_is_left_out():
    one = exploration(0.05, 0.5, seconds=4.0)
    changing = exploration(0.1, 1.0, seconds=4.0, seed=1)
    changing.speed[:] = np.tile(np.linspace(0.005, 0.2, 100), 40)
    fitted = fit([one, changing, exploration(0.1, 0.2, seed=3), exploration(0.02, 1.0, seed=4)])
    assert fitted.dropped >= 4
    assert fitted.recorded == 3


def test_three_axes_become_one_of_the_same_energy():
    values = np.random.default_rng(0).standard_normal((1000, 3)) * (1.0, 2.0, 0.5)
    values -= values.mean(axis=0)
    one = one_signal(values)
    parts = np.sum(np.abs(np.fft.rfft(values, axis=0)) ** 2, axis=1)
    assert np.abs(np.fft.rfft(one)) ** 2 == pytest.approx(parts, rel=1e-9, abs=1e-9)


def test_a_run_becomes_vibration_speed_force_and_drag():
    n, dt = 4000, 1e-3
    time = np.arange(n) * dt
    pose = np.zeros((n, 7))
    pose[:, 0], pose[:, 3] = 0.05 * time, 1.0
    wrench = np.zeros((n, 6))
    wrench[:, 0] = -0.2
    wrench[:, 2] = 1.0 + 0.1 * np.sin(2 * np.pi * 120 * time)
    run = explored(time, pose, wrench, np.ones(n, int), mass=0.1)
    inside = slice(500, 3500)
    assert run.speed[inside] == pytest.approx(0.05, rel=1e-3)
    assert run.force[inside] == pytest.approx(1.0, rel=1e-3)
    assert run.drag[inside] == pytest.approx(0.2, rel=1e-3)
    assert run.vibration[inside].std() == pytest.approx(1.0 / np.sqrt(2), rel=0.01)
    with pytest.raises(AsperityError, match="equal steps"):
        explored(time**2, pose, wrench, np.ones(n, int), mass=0.1)
    with pytest.raises(AsperityError, match="ticks a second"):
        explored(time * 50, pose, wrench, np.ones(n, int), mass=0.1)


@pytest.mark.parametrize("rate", [1e3, 2.5e3, 3e3, 1e4])
def test_the_rate_is_that_of_the_ticks_to_the_bit(rate):
    """A model of the same rate shall go with it: differences of times are off in the last place."""
    n = round(1.5 * rate)
    time = np.arange(n) / rate
    pose, wrench = np.zeros((n, 7)), np.zeros((n, 6))
    pose[:, 0], pose[:, 3], wrench[:, 2] = 0.05 * time, 1.0, 0.5
    assert explored(time, pose, wrench, np.ones(n, int), mass=0.1).rate == rate


def test_distances_of_equal_louder_and_other_vibration():
    a, same = noise(8000, 100, 1.0, 0), noise(8000, 100, 1.0, 1)
    other = noise(8000, 300, 1.0, 2)
    near, louder, far = match(a, same, RATE), match(a, 2.0 * same, RATE), match(a, other, RATE)
    assert near.fit > 0.98
    assert near.itakura_saito < 0.1
    assert louder.fit == pytest.approx(near.fit)
    assert louder.itakura_saito == pytest.approx(near.itakura_saito)
    assert louder.level == pytest.approx(2.0 * near.level)
    assert far.fit < 0.7
    assert far.itakura_saito > 10 * near.itakura_saito


def test_a_long_vibration_is_settled():
    made = long_vibration(model_of(), np.full(100, 0.05), np.full(100, 0.5), seconds=2.0)
    assert made.size == 2000
    assert np.std(made[:500]) == pytest.approx(np.std(made[1500:]), rel=0.4)
