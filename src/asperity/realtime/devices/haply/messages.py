"""The JSON messages of the Haply Inverse service.

The service (3.1 to 3.5, port 10001) sends an inventory when a client connects, and from then on
exactly one frame of state for each message of the client:

    {"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": ..}, ..}}],
     "wireless_verse_grip": [{"state": {"orientation": {"w": ..}, "buttons": {"a": ..}}}]}

Positions are in metres, right-handed with x right, y forward and z up, which are the axes of
`protocol`. A force has one of two spellings, `vector` (documentation of 3.5) or `values` (samples
of 3.1).
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from asperity.realtime.devices.orientation import unit_quaternion

SPELLINGS = ("vector", "values")
HOME = (0.0, -0.12, 0.15)
"""Middle of the workspace, from the base of an Inverse3 [m]."""
GRIPS = ("auto", "wireless", "wired", "none")
FARTHEST, FASTEST = 2.0, 50.0
"""Largest plausible position [m] and velocity [m/s]."""
_BUTTONS = (("a", "button_1"), ("b", "button_2"), ("c", "button_3"))
_GRIP_LISTS = {"wireless": "wireless_verse_grip", "wired": "verse_grip"}


@dataclass
class HaplyState:
    """One frame's state of a device and its grip."""

    device_id: str
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    orientation: tuple[float, float, float, float] | None
    """Quaternion wxyz; None: there is no grip in the frame."""
    buttons: int


def force_message(
    device_id: str, force: tuple[float, ...], spelling: str = "vector", first: str = ""
) -> bytes:
    """Return the message that commands a force [N].

    `first` is the part that only the first message of a connection has, from `first_part`.
    """
    x, y, z = force[:3]
    vector = f'{{"x":{x:.6g},"y":{y:.6g},"z":{z:.6g}}}'
    command = f'{{"set_cursor_force":{{"{spelling}":{vector}}}}}'
    entry = f'{{"device_id":{json.dumps(device_id)},"commands":{command}}}'
    return f'{{{first}"inverse3":[{entry}]}}'.encode()


def first_part(profile: str, spelling: str) -> str:
    """Return the part of the first message that names this program and requests unpermuted axes."""
    configure: dict[str, Any] = {"profile": {"name": profile}}
    if spelling == "vector":
        configure["basis"] = {"permutation": "XYZ"}
    return f'"session":{json.dumps({"configure": configure})},'


def read_state(text: str | bytes, device_id: str | None, grip: str) -> HaplyState:
    """Return the state of a device in a frame; of the first device if `device_id` is None.

    Raises
    ------
    ValueError
        The text is not a frame, the device is not in it, or a value is implausible. One line.
    """
    try:
        frame = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError("the service sent invalid JSON") from None
    listed = frame.get("inverse3") if isinstance(frame, dict) else None
    if not isinstance(listed, list):
        raise ValueError("the service sent a frame without a list of devices")
    entry = _entry(listed, device_id)
    try:
        state = entry["state"]
        position = _vector(state["cursor_position"], FARTHEST)
        velocity = _vector(state["cursor_velocity"], FASTEST)
        orientation, buttons = _grip(frame, grip)
        return HaplyState(str(entry["device_id"]), position, velocity, orientation, buttons)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"the service sent a frame that lacks {error}") from None


def device_ids(text: str | bytes) -> list[str]:
    """Return the ids of the Inverse3 devices in a frame; empty if it is not one."""
    try:
        return [str(entry["device_id"]) for entry in json.loads(text)["inverse3"]]
    except (ValueError, RecursionError, KeyError, TypeError):
        return []


def _entry(listed: list[Any], device_id: str | None) -> dict[str, Any]:
    for entry in listed:
        if isinstance(entry, dict) and device_id in (None, entry.get("device_id")):
            return entry
    if device_id is None:
        raise ValueError("the service lists no Inverse3: is it plugged in and switched on?")
    raise ValueError(f"the service lists no Inverse3 {device_id!r}: is it still plugged in?")


def _vector(vector: dict[str, Any], largest: float) -> tuple[float, float, float]:
    x, y, z = float(vector["x"]), float(vector["y"]), float(vector["z"])
    if not math.sqrt(x * x + y * y + z * z) <= largest:  # also refuses nan
        raise ValueError(f"the service sent {x:.3g}, {y:.3g}, {z:.3g}, which is out of range")
    return x, y, z


def _grip(frame: dict[str, Any], grip: str) -> tuple[tuple[float, float, float, float] | None, int]:
    """Return orientation and buttons of the first grip of the wanted kind."""
    if grip == "none":
        return None, 0
    for kind in ("wireless", "wired") if grip == "auto" else (grip,):
        listed = frame.get(_GRIP_LISTS[kind])
        if not listed:
            continue
        state = listed[0]["state"]
        vector = state["orientation"]
        orientation = unit_quaternion(
            float(vector["w"]), float(vector["x"]), float(vector["y"]), float(vector["z"])
        )
        if kind == "wired":
            return orientation, int(bool(state.get("button")))
        pressed = state.get("buttons") or {}
        bits = sum(
            1 << bit for bit, names in enumerate(_BUTTONS) if any(pressed.get(n) for n in names)
        )
        return orientation, bits
    return None, 0
