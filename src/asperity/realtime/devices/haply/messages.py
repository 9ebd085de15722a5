"""What the Haply Inverse service says and is told, as JSON.

The service (3.1 to 3.5, port 10001) pushes an inventory when a client connects, and from then on
exactly one frame of state for each message of the client's:

    {"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": ..}, ..}}],
     "wireless_verse_grip": [{"state": {"orientation": {"w": ..}, "buttons": {"a": ..}}}]}

Positions are in metres, right-handed with x right, y forward and z up: asperity's own axes. A force
is told in one of two spellings, `vector` (documentation of 3.5) or `values` (samples of 3.1).
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from asperity.realtime.devices.orientation import unit_quaternion

SPELLINGS = ("vector", "values")
GRIPS = ("auto", "wireless", "wired", "none")
FARTHEST, FASTEST = 2.0, 50.0
"""A position [m] or velocity [m/s] beyond these is no measurement of a device on a desk."""
_BUTTONS = (("a", "button_1"), ("b", "button_2"), ("c", "button_3"))
_GRIP_LISTS = {"wireless": "wireless_verse_grip", "wired": "verse_grip"}


@dataclass
class HaplyState:
    """What one frame says of one device and its grip."""

    device_id: str
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    orientation: tuple[float, float, float, float] | None
    """wxyz; None: the frame tells of no grip."""
    buttons: int


def force_message(
    device_id: str, force: tuple[float, ...], spelling: str = "vector", first: str = ""
) -> bytes:
    """Return the message that commands a force [N].

    `first` is what only the first message after connecting carries, from `first_part`.
    """
    x, y, z = force[:3]
    told = f'{{"x":{x:.6g},"y":{y:.6g},"z":{z:.6g}}}'
    command = f'{{"set_cursor_force":{{"{spelling}":{told}}}}}'
    entry = f'{{"device_id":{json.dumps(device_id)},"commands":{command}}}'
    return f'{{{first}"inverse3":[{entry}]}}'.encode()


def first_part(profile: str, spelling: str) -> str:
    """Return the part of the first message that names this program and asks for plain axes."""
    configure: dict[str, Any] = {"profile": {"name": profile}}
    if spelling == "vector":
        configure["basis"] = {"permutation": "XYZ"}
    return f'"session":{json.dumps({"configure": configure})},'


def read_state(text: str, device_id: str | None, grip: str) -> HaplyState:
    """Return what a frame says of a device (None: the first that is listed).

    Raises
    ------
    ValueError
        It is no frame, or the device is not in it, or what it says cannot be. One line.
    """
    try:
        frame = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError("the service sent what is no JSON") from None
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


def device_ids(text: str) -> list[str]:
    """Return the ids of the Inverse3 devices that a frame lists; empty if it is none."""
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


def _vector(told: dict[str, Any], largest: float) -> tuple[float, float, float]:
    x, y, z = float(told["x"]), float(told["y"]), float(told["z"])
    if not math.sqrt(x * x + y * y + z * z) <= largest:  # also refuses nan
        raise ValueError(f"the service sent {x:.3g}, {y:.3g}, {z:.3g}, which cannot be")
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
        told = state["orientation"]
        orientation = unit_quaternion(
            float(told["w"]), float(told["x"]), float(told["y"]), float(told["z"])
        )
        if kind == "wired":
            return orientation, int(bool(state.get("button")))
        pressed = state.get("buttons") or {}
        bits = sum(
            1 << bit for bit, names in enumerate(_BUTTONS) if any(pressed.get(n) for n in names)
        )
        return orientation, bits
    return None, 0
