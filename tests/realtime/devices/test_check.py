"""The check of a device, by a simulated user who pushes, on simulated time; and what it leaves."""

import numpy as np
import pytest
from clocks import Clock

from asperity.errors import AsperityError
from asperity.realtime.devices.calibration import (
    Calibrated,
    Calibration,
    calibration_file,
    load_calibration,
    save_calibration,
)
from asperity.realtime.devices.protocol import Limits, Reading
from asperity.realtime.servo.device_check import RUN_AWAY_DISTANCE, check_device


class Bench:
    """A device on a bench and the hand that holds it, all on one simulated clock.

    `turn` are its axes: rows lead from right, away, up to x, y, z of the device.
    """

    name = "bench"

    def __init__(self, turn=None, sign=1.0, stiffness=400.0):
        self.limits = Limits(3.3, 0.0, 400.0, 4.0)
        self.clock = Clock()
        self.turn = np.eye(3) if turn is None else np.array(turn, float)
        self.sign, self.stiffness, self.mass = sign, stiffness, 0.1
        self.hand, self.place, self.velocity = np.zeros(3), np.zeros(3), np.zeros(3)  # user's axes
        self.force, self.largest, self.at = np.zeros(3), 0.0, self.clock.now
        self.silent = self.closed = False
        self.error, self.drift = "", 0.0

    def open(self):
        self.closed = False

    def advance(self):
        while self.at < self.clock.now:
            self.at += 1e-3
            pull = self.stiffness * (self.hand - self.place) - 8.0 * self.velocity
            self.velocity += 1e-3 / self.mass * (pull + self.force)
            self.place += 1e-3 * self.velocity
            self.place[0] += 1e-3 * self.drift

    def read(self, out):
        self.advance()
        out.age, out.error = (1.0, "") if self.silent else (0.0, self.error)
        if self.silent:
            return False
        out.pose[:3] = self.turn @ self.place
        out.twist[:3] = self.turn @ self.velocity
        return True

    def write(self, wrench):
        self.advance()
        self.force = self.sign * self.turn.T @ np.array(wrench[:3])
        self.largest = max(self.largest, float(np.linalg.norm(wrench)))

    def close(self):
        self.write(np.zeros(6))
        self.closed = True

    def user(self, request):
        """Do what is asked for, in the user's own axes."""
        for word, way in (("RIGHT", 0), ("AWAY", 1), ("UP", 2)):
            if word in request:
                self.hand = 0.05 * np.eye(3)[way] + 0.004
                break
        else:
            self.hand = (
                np.array([0.01, 0.02, 0.03])
                if "middle of your workspace" in request
                else np.zeros(3)
            )
        self.clock.now += 2.0  # until it is done

    def checked(self, **options):
        asked = {"ask": self.user, **options}
        return check_device(
            self, tell=lambda line: None, clock=self.clock, sleep=self.clock.sleep, **asked
        )


def test_a_good_device_passes():
    bench = Bench()
    outcome = bench.checked()
    assert outcome.calibration.axes == ("+x", "+y", "+z")
    np.testing.assert_allclose(outcome.calibration.home, [0.01, 0.02, 0.03], atol=1e-4)
    assert outcome.calibration.checked_force == 0.5
    assert bench.closed
    assert not bench.force.any()
    assert bench.largest == pytest.approx(0.5, rel=1e-2)
    assert "right-handed, as expected" in " ".join(outcome.notes)


def test_other_axes_are_found_and_the_calibration_undoes_them():
    # x of the device leads towards the user, y to the right.
    bench = Bench(turn=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    calibration = bench.checked().calibration
    assert calibration.axes == ("+y", "-x", "+z")
    device, reading = Calibrated(bench, calibration), Reading.empty()
    bench.place = np.array([0.03, 0.02, 0.05])
    bench.velocity, bench.at = np.array([1.0, 2.0, 3.0]), bench.clock.now
    device.read(reading)
    np.testing.assert_allclose(reading.pose[:3], [0.02, 0.0, 0.02], atol=1e-4)
    np.testing.assert_allclose(reading.twist[:3], [1, 2, 3], atol=1e-12)
    device.write(np.array([0.1, 0.2, 0.3, 0, 0, 0]))
    np.testing.assert_allclose(bench.force, [0.1, 0.2, 0.3])


def test_mirrored_axes_are_refused():
    with pytest.raises(AsperityError, match="left-handed"):
        Bench(turn=np.diag([-1.0, 1, 1])).checked()


def test_a_push_along_no_axis_is_refused():
    c = np.sqrt(0.5)
    with pytest.raises(AsperityError, match=r"to the RIGHT it moved .* mostly along one axis"):
        Bench(turn=[[c, -c, 0], [c, c, 0], [0, 0, 1]]).checked()


def test_an_axis_that_answers_twice_is_refused():
    bench = Bench()

    def careless(request):
        bench.user(request.replace("AWAY from you", "RIGHT"))

    with pytest.raises(AsperityError, match="one axis twice"):
        bench.checked(ask=careless)


def test_forces_of_the_wrong_sign_are_found():
    bench = Bench(sign=-1.0)
    with pytest.raises(AsperityError, match=r"mm the other way: its forces have the wrong sign"):
        bench.checked()
    assert bench.closed
    assert not bench.force.any()


def test_an_end_effector_that_runs_away_has_its_force_cut_at_once():
    bench = Bench(stiffness=0.0)  # nobody holds it
    with pytest.raises(AsperityError, match=r"ran away \(.* mm, .* mm/s\); the force was cut"):
        bench.checked(ask=None)
    assert not bench.force.any()
    assert bench.closed
    assert np.linalg.norm(bench.place) < RUN_AWAY_DISTANCE + 2e-3  # within some ticks


@pytest.mark.parametrize("fault", ["silent", "error"])
def test_a_device_that_falls_silent_under_force_has_it_cut(fault):
    bench = Bench()
    write = bench.write

    def failing(wrench):
        write(wrench)
        if np.linalg.norm(wrench) > 0.3:
            setattr(bench, fault, True if fault == "silent" else "cable out")

    bench.write = failing
    with pytest.raises(AsperityError, match=r"silent under force: (.* without a pose|cable out)"):
        bench.checked()
    assert not bench.force.any()


def test_a_device_that_says_nothing_fails_before_any_force():
    bench = Bench()
    bench.silent = True
    with pytest.raises(AsperityError, match="sent 0 new poses"):
        bench.checked()
    assert bench.largest == 0.0


def test_an_interruption_leaves_no_force():
    bench = Bench()
    count = 0

    def sleep(seconds):
        nonlocal count
        count += 1
        bench.clock.sleep(seconds)
        if bench.force.any() and np.linalg.norm(bench.force) > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check_device(bench, ask=bench.user, tell=str, clock=bench.clock, sleep=sleep)
    assert not bench.force.any()
    assert bench.closed


def test_motors_that_are_not_felt_are_not_said_to_work():
    outcome = Bench(stiffness=1e4).checked()
    assert outcome.calibration.checked_force == 0.0
    assert "too little" in outcome.notes[-1]


def test_a_stall_cuts_the_force_and_begins_anew():
    bench, cuts = Bench(), []
    read = bench.read

    def stalling(out):
        new = read(out)
        if np.linalg.norm(bench.force) > 0.3 and len(cuts) < 3:
            cuts.append(bench.force.copy())
            out.age = 0.08
            return False
        return new

    bench.read = stalling
    outcome = bench.checked()
    assert outcome.calibration.checked_force == 0.5
    assert "3 times no pose came for 50 ms" in outcome.notes[-1]


@pytest.fixture(autouse=True)
def _config(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


def test_a_calibration_is_saved_and_loaded(tmp_path):
    assert load_calibration("haply") is None
    kept = Calibration(("+y", "-x", "+z"), (0.01, -0.12, 0.15), 0.5)
    path = save_calibration("haply", kept)
    assert path == tmp_path / "asperity" / "devices" / "haply.toml" == calibration_file("haply")
    assert load_calibration("haply") == kept


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("nonsense", "Expected"),
        ("schema = 2", "schema must be 1"),
        ('schema = 1\naxes = ["+x", "+y", "-z"]\nhome = [0, 0, 0]', "mirrored"),
        ('schema = 1\naxes = ["+x", "+x", "+z"]\nhome = [0, 0, 0]', "twice"),
        ('schema = 1\naxes = ["+x", "+y"]\nhome = [0, 0, 0]', "three of"),
        ("schema = 1\naxes = 3\nhome = [0, 0, 0]", "three of"),
        ('schema = 1\naxes = ["+x", "+y", "+z"]\nhome = [nan, 0, 0]', "home must be"),
        ('schema = 1\naxes = ["+x", "+y", "+z"]', "home must be"),
        ('schema = 1\naxis = ["+x"]', "did you mean axes"),
    ],
)
def test_a_broken_calibration_is_refused_by_its_file(text, expected):
    path = calibration_file("haply")
    path.parent.mkdir(parents=True)
    path.write_text(text)
    with pytest.raises(AsperityError, match=expected) as caught:
        load_calibration("haply")
    assert str(path) in str(caught.value)
    assert "asperity devices check haply" in str(caught.value)


def test_nan_is_not_turned_into_a_force():
    bench = Bench(turn=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    seen = []
    bench.write = seen.append
    Calibrated(bench, Calibration(("+y", "-x", "+z"))).write(np.full(6, np.nan))
    Calibrated(bench, Calibration(("+y", "-x", "+z"))).write(None)
    assert np.isnan(seen).all()  # which the device itself refuses, and says so


def test_orientation_turns_with_the_axes():
    class Turned(Bench):
        def read(self, out):
            super().read(out)
            out.pose[3:] = [np.cos(0.3), np.sin(0.3), 0, 0]  # about its x, which leads to us
            out.twist[3:] = [2.0, 0, 0]
            return True

    bench, reading = Turned(turn=[[0, -1, 0], [1, 0, 0], [0, 0, 1]]), Reading.empty()
    Calibrated(bench, Calibration(("+y", "-x", "+z"))).read(reading)
    np.testing.assert_allclose(reading.pose[3:], [np.cos(0.3), 0, -np.sin(0.3), 0])
    np.testing.assert_allclose(reading.twist[3:], [0, -2.0, 0])
