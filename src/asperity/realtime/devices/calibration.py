"""Calibrations of devices: found by `asperity devices check`, kept in the user's settings.

A vendor's documentation may be wrong about axes, a device may be mounted sideways, and its origin
may lie in its base. A calibration states which of the device's axes point to the right, away from
the user and up, and where its home is. `Calibrated` converts readings to these axes about home:

    schema = 1
    device = "haply"
    axes = ["+x", "+y", "+z"]        # right, away, up
    home = [0.0, -0.12, 0.15]        # m, in the device's axes
    checked_force = 0.5              # N; 0: the motors were not checked
"""

from __future__ import annotations

import math
import os
import sys
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_finite, require_not_negative
from asperity.realtime.devices.protocol import Device, Reading, finite_wrench
from asperity.scene.document import require_keys, write_toml

SCHEMA = 1
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
_KEYS = ("schema", "device", "axes", "home", "checked_force")


@dataclass(frozen=True)
class Calibration:
    """Axes and home of a device, and whether its motors were checked.

    Parameters
    ----------
    axes : tuple of str
        The device's axes that point to the right, away from the user, and up: `+x`, `-x`, `+y`, ...
    home : tuple of float
        Middle of the workspace, in the device's axes [m].
    checked_force : float
        Largest force at which the motors were found to push in the right direction [N].
    """

    axes: tuple[str, str, str] = ("+x", "+y", "+z")
    home: tuple[float, float, float] = (0.0, 0.0, 0.0)
    checked_force: float = 0.0

    def __post_init__(self) -> None:
        if len(self.axes) != 3 or any(axis not in AXES for axis in self.axes):
            raise AsperityError(f"axes must be three of {', '.join(AXES)}, got {self.axes!r}")
        if np.linalg.det(self.rows) < 0.5:  # -1: mirrored; 0: one axis twice
            twice = len({axis[1] for axis in self.axes}) < 3
            wrong = "name one axis twice" if twice else "are mirrored"
            raise AsperityError(
                f"axes {', '.join(self.axes)} {wrong}: right, away, up must be right-handed"
            )
        require_finite("home", self.home, 3)
        require_not_negative("checked_force", self.checked_force, "N")

    @property
    def rows(self) -> NDArray[np.float64]:
        """Rotation matrix (3, 3) from the device's axes to those of `protocol`."""
        out = np.zeros((3, 3))
        for row, axis in enumerate(self.axes):
            out[row, "xyz".index(axis[1])] = -1.0 if axis[0] == "-" else 1.0
        return out


class Calibrated:
    """A device whose readings and wrenches are converted by a calibration."""

    def __init__(self, device: Device, calibration: Calibration) -> None:
        self.device = device
        self.calibration = calibration
        self.name, self.limits = device.name, device.limits
        rows = calibration.rows
        self._same_axes = bool((rows == np.eye(3)).all())
        self._home = np.array(calibration.home)
        self._rows = rows
        self._raw = Reading.empty()
        self._wrench = np.zeros(6)

    def open(self) -> None:
        """Open the device."""
        self.device.open()

    def read(self, out: Reading) -> bool:
        """Fill the newest reading, about home and in the axes of `protocol`."""
        raw = self._raw
        new = self.device.read(raw)
        out.pose[:], out.twist[:] = raw.pose, raw.twist
        out.buttons, out.age, out.error = raw.buttons, raw.age, raw.error
        out.pose[:3] -= self._home
        if not self._same_axes:
            rows = self._rows
            out.pose[:3] = rows @ out.pose[:3]
            out.twist[:3], out.twist[3:] = rows @ out.twist[:3], rows @ out.twist[3:]
            # R q R^-1 rotates the axis of the rotation and keeps its angle.
            out.pose[4:] = rows @ out.pose[4:]
        return new

    def write(self, wrench: NDArray[np.float64]) -> None:
        """Send a wrench, given in the axes of `protocol`."""
        if self._same_axes:
            self.device.write(wrench)
            return
        values = finite_wrench(wrench)
        out = self._wrench
        if values is None:
            out[:] = math.nan  # the device reports it and sends zero
        else:
            out[:] = values
            out[:3], out[3:] = out[:3] @ self._rows, out[3:] @ self._rows
        self.device.write(out)

    def close(self) -> None:
        """Close the device."""
        self.device.close()


def calibration_file(name: str) -> Path:
    """Return the path of a device's calibration.

    It lies in `XDG_CONFIG_HOME` or `~/.config`; on Windows in `APPDATA`, on macOS in
    `~/Library/Application Support` (both untested).
    """
    home = Path.home()
    if os.environ.get("XDG_CONFIG_HOME"):
        base = Path(os.environ["XDG_CONFIG_HOME"])
    elif sys.platform == "win32":
        base = Path(os.environ.get("APPDATA") or home / "AppData" / "Roaming")
    elif sys.platform == "darwin":
        base = home / "Library" / "Application Support"
    else:
        base = home / ".config"
    return base / "asperity" / "devices" / f"{name}.toml"


def save_calibration(name: str, calibration: Calibration) -> Path:
    """Write the calibration of a device; return its path."""
    path = calibration_file(name)
    document = {"schema": SCHEMA, "device": name, **asdict(calibration)}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text(write_toml(document))
        os.replace(part, path)
    except OSError as error:
        raise AsperityError(f"{path} cannot be written: {error.strerror}") from None
    return path


def load_calibration(name: str) -> Calibration | None:
    """Return the calibration of a device, or None if there is none."""
    path = calibration_file(name)
    if not path.is_file():
        return None
    try:
        document = tomllib.loads(path.read_text("utf-8"))
        require_keys(document, "", _KEYS)
        if document.get("schema") != SCHEMA:
            raise AsperityError(f"schema must be {SCHEMA}, got {document.get('schema')!r}")
        axes = document.get("axes")
        if not isinstance(axes, list) or not all(isinstance(axis, str) for axis in axes):
            raise AsperityError(f"axes must be three of {', '.join(AXES)}, got {axes!r}")
        x, y, z = require_finite("home", document.get("home"), 3)
        force = require_not_negative("checked_force", document.get("checked_force", 0.0), "N")
        return Calibration(tuple(axes), (x, y, z), force)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, AsperityError) as error:
        raise AsperityError(
            f"{path}: {error}; correct it, or delete it and run 'asperity devices check {name}'"
        ) from None
