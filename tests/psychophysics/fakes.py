"""Sessions without scenes: a presenter that presents nothing, and documents of experiments."""

from __future__ import annotations

import copy

from asperity.psychophysics.design import parse_design
from asperity.psychophysics.interfaces.protocol import Reply
from asperity.psychophysics.session.trials import PresentedInterval

CHOICE = {
    "schema": 1, "name": "height", "method": "forced-choice", "seed": 3,
    "stimulus": {"scene": "probe-plate-grating"},
    "levels": {"key": "bodies.plate.texture.height", "label": "height", "unit": "m"},
    "presentation": {"seconds": 0.05, "pause": 0.0},
    "forced-choice": {"standard": 2e-4, "low": 0.01, "high": 1.0},
    "staircase": {"start": [0.8], "steps": [2.0, 1.41, 1.19], "trials": 60},
    "simulated": {"threshold": 0.2, "width": 0.6, "lapse": 0.02},
}  # fmt: skip
MAGNITUDE = {
    "schema": 1, "name": "height", "method": "magnitude", "seed": 3,
    "stimulus": {"scene": "probe-plate-grating"},
    "levels": {
        "key": "bodies.plate.texture.height", "unit": "m", "values": [5e-5, 1e-4, 2e-4, 4e-4, 8e-4],
    },
    "presentation": {"seconds": 0.05, "pause": 0.0},
    "magnitude": {"blocks": 3, "practice": 2},
    "simulated": {"exponent": 0.8, "noise": 0.05},
}  # fmt: skip
PAIRS = {
    "schema": 1, "name": "plates", "method": "pairs", "seed": 3,
    "stimulus": {"scene": "probe-plate"},
    "stimuli": {name: {"value": value} for name, value in
                zip("abcd", (1.0, 1.5, 2.0, 3.0), strict=True)},
    "pairs": {"repeats": 10},
    "simulated": {"noise": 0.15, "exponent": 1.0},
}  # fmt: skip
YES_NO = {
    "schema": 1, "name": "relief", "method": "yes-no", "seed": 3,
    "stimulus": {"scene": "probe-plate-grating"},
    "levels": {"key": "bodies.plate.texture.height", "label": "height", "unit": "m"},
    "presentation": {"seconds": 0.05, "pause": 0.0},
    "yes-no": {"standard": 0.0, "level": "value", "levels": [5e-5, 1e-4], "repeats": 30},
    "simulated": {"threshold": 5e-5, "criterion": 0.8, "lapse": 0.0},
}  # fmt: skip
ADJUSTMENT = {
    "schema": 1, "name": "equal", "method": "adjustment", "seed": 3,
    "stimulus": {"scene": "probe-plate-grating"},
    "levels": {"key": "bodies.plate.texture.height", "label": "height", "unit": "m"},
    "presentation": {"seconds": 0.05, "pause": 0.0},
    "adjustment": {"standard": 1.5e-4, "low": 5e-5, "high": 5e-4, "step": 1.05},
    "simulated": {"bias": 1.15, "noise": 0.05},
}  # fmt: skip
MATCHING = {
    **{key: value for key, value in ADJUSTMENT.items() if key != "adjustment"},
    "method": "matching",
    "matching": {"low": 5e-5, "high": 8e-4, "step": 1.05, "standards": [1e-4, 2e-4, 4e-4]},
}  # fmt: skip


def document(base, **sections):
    """Return a copy of a document with keys of its sections set; None takes one out."""
    out = copy.deepcopy(base)
    for name, value in sections.items():
        name = name.replace("_", "-")
        name = "quest+" if name == "quest" else name
        if value is None:
            out.pop(name, None)
        elif isinstance(value, dict):
            out[name] = {**out.get(name, {}), **value}
        else:
            out[name] = value
    return out


def design(base, **sections):
    return parse_design(document(base, **sections))


class Nothing:
    """A presenter that presents nothing, and remembers what it was to."""

    def __init__(self):
        self.presented = []

    def check(self, stimulus):
        pass

    def prepare(self, wanted, seconds):
        pass

    def present(self, stimulus, recording, seconds, begun, done):
        begun()
        recording.write_bytes(b"")
        self.presented.append(recording.name)
        return PresentedInterval(recording.name, 0, seconds, {"band_rms": 1.0})

    def drop(self):
        pass


class Person:
    """Answers with what a function says; knows which answers were taken."""

    kind = "test"

    def __init__(self, answer):
        self._answer = answer
        self.asked, self.taken, self.refused = [], [], []
        self._pending = None

    def welcome(self, design, progress):
        pass

    def ready(self, trial, progress):
        self._take()

    def begun(self, interval):
        pass

    def done(self):
        return False

    def ended(self, interval):
        pass

    def ask(self, trial, felt):
        answer = self._answer(trial)
        self.asked.append((trial.number, answer))
        self._pending = (trial.number, answer)
        return Reply(answer, 0.5)

    def refuse(self, why):
        self.refused.append(why)

    def feedback(self, right):
        pass

    def over(self, told):
        self._take()

    def _take(self):
        """The session goes on: by now the answer has to be on the disk."""
        if self._pending:
            self.taken.append(self._pending)
            self._pending = None
