"""The service's JSON: what is said well is read, and whatever else there is gets one clear line."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity.realtime.devices.haply.messages import (
    device_ids,
    first_part,
    force_message,
    read_state,
)

FRAME = {
    "inverse3": [
        {
            "device_id": "049D",
            "state": {
                "cursor_position": {"x": 0.01, "y": -0.12, "z": 0.15},
                "cursor_velocity": {"x": 0.1, "y": 0.2, "z": 0.3},
            },
        }
    ],
    "wireless_verse_grip": [
        {"state": {"orientation": {"w": 0.0, "x": 1.0, "y": 0.0, "z": 0.0},
                   "buttons": {"a": True, "b": False, "c": True}}}
    ],
    "verse_grip": [
        {"state": {"orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}, "button": True}}
    ],
}  # fmt: skip


def changed(path, value):
    frame = json.loads(json.dumps(FRAME))
    at = frame
    for key in path[:-1]:
        at = at[key]
    if value is None:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return json.dumps(frame)


def test_a_frame_is_read():
    state = read_state(json.dumps(FRAME), None, "auto")
    assert state.device_id == "049D"
    assert state.position == (0.01, -0.12, 0.15)
    assert state.velocity == (0.1, 0.2, 0.3)
    assert state.orientation == (0.0, 1.0, 0.0, 0.0)  # the wireless grip before the wired
    assert state.buttons == 0b101


@pytest.mark.parametrize(
    ("grip", "orientation", "buttons"),
    [("wired", (1.0, 0.0, 0.0, 0.0), 1), ("none", None, 0), ("wireless", (0.0, 1.0, 0.0, 0.0), 5)],
)
def test_the_grip_can_be_chosen(grip, orientation, buttons):
    state = read_state(json.dumps(FRAME), "049D", grip)
    assert (state.orientation, state.buttons) == (orientation, buttons)


def test_without_a_grip_there_is_no_orientation():
    frame = {"inverse3": FRAME["inverse3"]}
    assert read_state(json.dumps(frame), None, "auto").orientation is None


def test_buttons_in_their_other_spelling():
    text = changed(
        ("wireless_verse_grip", 0, "state", "buttons"), {"button_2": True, "button_1": False}
    )
    assert read_state(text, None, "auto").buttons == 0b10


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        (("inverse3",), None, "without a list"),
        (("inverse3",), [], "plugged in"),
        (("inverse3", 0, "device_id"), "AAAA", "no Inverse3 '049D'"),
        (("inverse3", 0, "state"), None, "state"),
        (("inverse3", 0, "state"), 3, "lacks"),
        (("inverse3", 0, "state", "cursor_position"), None, "cursor_position"),
        (("inverse3", 0, "state", "cursor_position", "x"), None, "'x'"),
        (("inverse3", 0, "state", "cursor_position", "x"), float("nan"), "out of range"),
        (("inverse3", 0, "state", "cursor_position", "x"), 1e300, "out of range"),
        (("inverse3", 0, "state", "cursor_position", "x"), 30.0, "out of range"),
        (("inverse3", 0, "state", "cursor_velocity", "z"), float("inf"), "out of range"),
        (("wireless_verse_grip", 0, "state", "orientation", "x"), 0.0, "norm 0"),
        (("wireless_verse_grip", 0, "state", "orientation", "x"), float("nan"), "norm nan"),
        (("wireless_verse_grip", 0, "state"), None, "state"),
    ],
)
def test_nonsense_is_refused_by_its_name(path, value, expected):
    with pytest.raises(ValueError, match=expected) as caught:
        read_state(changed(path, value), "049D", "auto")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "3", '"inverse3"', "[" * 100_000, "\0"])
def test_what_is_no_frame_is_refused(text):
    with pytest.raises(ValueError, match="the service sent"):
        read_state(text, None, "auto")
    assert device_ids(text) == []


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(["inverse3", "state", "device_id", "cursor_position", "cursor_velocity",
                         "x", "y", "z", "wireless_verse_grip", "orientation", "buttons"]),
        inner, max_size=4),
    max_leaves=20,
)  # fmt: skip


@settings(max_examples=200, deadline=None)
@given(json_values, st.sampled_from(["auto", "wired", "none"]))
def test_no_json_gets_past_with_a_number_that_is_none(value, grip):
    try:
        state = read_state(json.dumps(value), None, grip)
    except ValueError:
        return
    assert all(map(math.isfinite, state.position + state.velocity))


@pytest.mark.parametrize("spelling", ["vector", "values"])
def test_a_force_in_either_spelling(spelling):
    text = force_message("049D", (0.25, -1e-9, 2.0), spelling)
    entry = json.loads(text)["inverse3"][0]
    assert entry["device_id"] == "049D"
    assert entry["commands"]["set_cursor_force"] == {spelling: {"x": 0.25, "y": -1e-9, "z": 2.0}}


def test_the_first_message_names_the_program_and_asks_for_plain_axes():
    message = json.loads(force_message('odd"id', (0, 0, 0), "vector", first_part("lab", "vector")))
    assert message["session"]["configure"] == {
        "profile": {"name": "lab"},
        "basis": {"permutation": "XYZ"},
    }
    assert message["inverse3"][0]["device_id"] == 'odd"id'
    # Services of the older spelling know no basis.
    assert "basis" not in first_part("lab", "values")
