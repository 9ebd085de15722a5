"""Metrics on records: the studies' own, signals that follow from the lag, and norms."""

import numpy as np
import pytest

from asperity.dynamics.dragged_hand.hand import Hand, drag
from asperity.errors import AsperityError
from asperity.geometry.offsets.analytic import Sinusoid
from asperity.runs.vibration_metrics import evaluate
from asperity.studies.literature.measures import (
    COLUMNS,
    POOLING,
    SKIN_MEASURES,
    STILL,
    DragRecord,
    Measure,
    evaluate_all,
    record_of,
)
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import texture_force
from asperity.studies.skin.channels import CHANNELS, channel_level
from asperity.studies.skin.transmission import transmissibility

HAND, SPEED = Hand(), 0.083


@pytest.fixture(scope="module")
def force():
    return texture_force(Sinusoid(1e-4, 1.4e-3), 3e-3, 0.58)


@pytest.fixture(scope="module")
def motion(force):
    return drag(force, HAND, SPEED)


@pytest.fixture(scope="module")
def record(motion):
    return record_of(motion, HAND)


@pytest.mark.parametrize("name", COLUMNS)
def test_the_studies_metrics_are_the_same(motion, record, name):
    assert COLUMNS[name]([record]) == pytest.approx(evaluate(name, motion), rel=1e-4)


def test_the_force_follows_from_the_lag(force, motion, record):
    met = force(np.mod(motion.place, force.period))
    assert Measure(signal="force")([record]) == pytest.approx(np.std(met), rel=1e-2)


def test_velocity_and_position_are_those_of_the_motion(motion, record):
    assert Measure(signal="velocity")([record]) == pytest.approx(np.std(motion.speed), rel=1e-3)
    assert Measure(signal="position")([record]) == pytest.approx(np.std(motion.lag), rel=1e-3)


def test_a_norm_is_that_of_the_wave(record):
    band = (20.0, 200.0)
    norms = evaluate_all(
        [record], [Measure(band=band, power=p) for p in (2.0, 2.0 + 1e-9, 4.0, np.inf)]
    )
    assert norms[1] == pytest.approx(norms[0], rel=1e-6)
    assert norms[0] < norms[2] < norms[3]


def test_strokes_come_together_as_one_longer_stroke(record):
    for power in (2.0, 4.0):
        one = Measure(power=power)
        assert one([record, record]) == pytest.approx(one([record]))
        assert one([record, STILL]) == pytest.approx(one([record]) * 0.5 ** (1.0 / power))
    assert Measure(power=np.inf)([record, STILL]) == Measure(power=np.inf)([record])
    assert COLUMNS["max_acceleration"]([record, STILL]) == record.largest


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"kind": "loudness"}, "unknown kind"),
        ({"signal": "jerk"}, "unknown signal"),
        ({"band": (200.0, 20.0)}, "band must rise"),
        ({"power": 1.0}, "power of a norm must be 2 or above"),
    ],
)
def test_bad_metrics_are_refused(options, reason):
    with pytest.raises(AsperityError, match=reason):
        Measure(**options)


def test_channels_are_filters_of_the_lag_that_can_be_switched_on_and_off():
    lines, hand = np.array([50.0, 200.0]), Hand()
    record = DragRecord(lines, np.array([3e-6, 1e-6j]), 1.0, -1.0, hand, False)
    by_name = {measure.name: measure([record]) for measure in SKIN_MEASURES}
    plain = {c: channel_level(c, lines, np.array([3e-6, 1e-6])) for c in CHANNELS}
    for channel, level in plain.items():
        assert by_name[f"{channel.upper()} channel"] == pytest.approx(level)
    moved = np.abs(transmissibility(lines)) * np.array([3e-6, 1e-6])
    through = channel_level("fa2", lines, moved)
    assert by_name["FA2 channel, through tissue"] == pytest.approx(through)
    assert through != pytest.approx(plain["fa2"])
    assert by_name["channels pooled"] == pytest.approx(POOLING.intensity(plain))
