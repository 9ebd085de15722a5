"""The normal degree of freedom, against an independent integrator with events."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from asperity.dynamics.dragged_hand.hand import Hand, drag
from asperity.dynamics.dragged_hand.normal_motion import NormalProbe, drag_lifting
from asperity.errors import AsperityError
from asperity.geometry.offsets.analytic import Sinusoid
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import slope_table

AMPLITUDE, WAVE = 0.1e-3, 2e-3


def path(samples=512):
    u = np.arange(samples) * WAVE / samples
    q = 2 * np.pi / WAVE
    return AMPLITUDE * np.cos(q * u), -AMPLITUDE * q * np.sin(q * u)


def reference(hand, probe, force, speed, times):
    """Return states (u, u', z, z') at times, by solve_ivp, one event after the other."""
    q = 2 * np.pi / WAVE

    def rates(t, s, touches):
        h, slope = AMPLITUDE * np.cos(q * s[0]), -AMPLITUDE * q * np.sin(q * s[0])
        contact = probe.contact_stiffness * (h - s[2]) if touches else 0.0
        pull = hand.stiffness * (speed * t - s[0]) + hand.damping * (speed - s[1])
        press = -force - probe.stiffness * s[2] - probe.damping * s[3] + contact
        return [s[1], (pull - contact * slope) / hand.mass, s[3], press / probe.mass]

    def gap(t, s, touches):
        return s[2] - AMPLITUDE * np.cos(q * s[0])

    gap.terminal = True
    state = np.array([0.0, speed, AMPLITUDE - force / probe.contact_stiffness, 0.0])
    touches, start, found = True, 0.0, np.empty((times.size, 4))
    while start < times[-1]:
        gap.direction = 1.0 if touches else -1.0
        run = solve_ivp(
            rates, (start, times[-1]), state, args=(touches,), events=gap, rtol=1e-10, atol=1e-13,
            dense_output=True, max_step=1e-4,
        )  # fmt: skip
        inside = (times >= start) & (times <= run.t[-1])
        found[inside] = run.sol(times[inside]).T
        start, state, touches = run.t[-1], run.y[:, -1], not touches
    return found


@pytest.mark.parametrize(
    ("speed", "force", "flies"), [(0.05, 0.8, False), (0.2, 0.3, True), (0.35, 0.58, True)]
)
def test_hand_and_probe_move_as_solve_ivp_has_them(speed, force, flies):
    hand, probe, rate = Hand(), NormalProbe(), 5000.0
    seconds = 0.15
    run = drag_lifting(
        *path(), WAVE, hand, probe, normal_force=force, speed=speed, length=seconds * speed,
        settle=0.0, rate=rate,
    )  # fmt: skip
    times = np.arange(run.height.size) / rate
    want = reference(hand, probe, force, speed, times)
    for mine, theirs in (
        (run.motion.lag, want[:, 0] - speed * times), (run.motion.speed, want[:, 1]),
        (run.height, want[:, 2]),
    ):  # fmt: skip
        assert np.max(np.abs(mine - theirs)) <= 1e-3 * np.ptp(theirs)
    assert (run.share_in_flight > 0.0) == flies


def test_a_light_probe_on_a_stiff_surface_is_the_papers_model():
    surface, diameter, force, speed = Sinusoid(AMPLITUDE, WAVE), 3e-3, 0.58, 0.083
    trace = surface.tracer(diameter)(np.arange(1024) * surface.period / 1024)
    light = NormalProbe(mass=1e-4, stiffness=0.0, damping=0.3, contact_stiffness=2e5)
    run = drag_lifting(
        trace.height, trace.slope, surface.period, Hand(), light, normal_force=force, speed=speed,
        length=8 * surface.period,
    )  # fmt: skip
    paper = drag(slope_table(surface, diameter).scaled(force), Hand(), speed)
    assert run.share_in_flight == 0.0
    assert run.motion.largest == pytest.approx(paper.largest, rel=0.03)
    assert np.std(run.motion.lag) == pytest.approx(np.std(paper.lag), rel=0.01)


def test_the_mean_force_of_contact_is_the_normal_force():
    run = drag_lifting(
        *path(), WAVE, Hand(), NormalProbe(stiffness=0.0), normal_force=0.4, speed=0.1,
        length=40 * WAVE,
    )  # fmt: skip
    assert np.mean(run.contact_force) == pytest.approx(0.4, rel=0.02)
    assert np.all(run.contact_force >= 0.0)


def test_bad_input_is_refused():
    heights, slopes = path(64)
    with pytest.raises(AsperityError, match=r"at least 8 samples"):
        drag_lifting(heights[:4], slopes[:4], WAVE, Hand(), NormalProbe(), normal_force=1.0,
                     speed=0.1, length=0.01)  # fmt: skip
    with pytest.raises(AsperityError, match=r"mass.*0"):
        NormalProbe(mass=0.0)
