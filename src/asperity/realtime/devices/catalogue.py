"""The catalogue of devices: their names, what each needs, and making one by name."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

from asperity.errors import AsperityError, require_choice
from asperity.realtime.devices import force_dimension, openhaptics
from asperity.realtime.devices.calibration import (
    Calibrated,
    Calibration,
    calibration_file,
    load_calibration,
)
from asperity.realtime.devices.haply.messages import HOME
from asperity.realtime.devices.protocol import Device


@dataclass(frozen=True)
class DeviceEntry:
    """A backend of the catalogue."""

    name: str
    description: str
    """Description in a few words."""
    module: str
    kind: str
    """Name of the class in `asperity.realtime.devices.MODULE`."""
    package: str = ""
    """Package that it imports; empty: none beyond asperity's dependencies."""
    extra: str = ""
    by_hand: str = ""
    """What has to be installed by hand."""
    home: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Middle of the workspace in the vendor's axes, if there is no calibration [m]."""
    steady: bool = False
    """Whether its poses are those of the scene: nothing is mapped or calibrated. The page offers
    only the mouse of these."""
    check_options: Mapping[str, Any] = field(default_factory=dict)
    """Options for `asperity devices check`."""
    found: str = ""
    """How the names that the module's `attached` returns are shown; empty: it has none."""


_ENTRIES = (
    DeviceEntry("simulated", "a simulated hand", "simulated", "SimulatedDevice", steady=True),
    DeviceEntry(
        "mouse", "a page's pointer, in a simulated hand", "mouse", "MouseDevice", steady=True
    ),
    DeviceEntry(
        "replay", "a recording or a file of poses", "replayed", "ReplayedDevice", steady=True
    ),
    DeviceEntry(
        "haply", "Haply Inverse3, by its service", "haply.service", "HaplyServiceDevice",
        "websockets", "haply", "Haply Hub or the Inverse service", HOME,
        found="Inverse3 {}",
    ),
    DeviceEntry(
        "haply-fake", "the same, simulated", "haply.fake_device",
        "HaplyFakeDevice", "websockets", "haply", "", HOME, check_options={"motion": "still"},
    ),
    DeviceEntry(
        "haply-serial", "Haply Inverse3, by serial port", "haply.serial_port",
        "HaplyHardwareDevice", "HaplyHardwareAPI", "haply",
        "an Inverse3 on USB (Linux: group dialout)", HOME, found="Inverse3 on {}",
    ),
    DeviceEntry(
        "force-dimension", "omega, sigma, lambda", "force_dimension", "ForceDimensionDevice",
        "forcedimension_core", "forcedimension", "Force Dimension SDK 3.16 or later",
        found="{} found",
    ),
    DeviceEntry(
        "openhaptics", "3D Systems Touch, Premium", "openhaptics", "OpenHapticsDevice",
        "pyOpenHaptics", "openhaptics", "OpenHaptics and the device's driver",
    ),
)  # fmt: skip
ENTRIES = {entry.name: entry for entry in _ENTRIES}
MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "inverse3": ("haply", {}),
    **{model: ("force-dimension", {"model": model}) for model in force_dimension.MODELS},
    **{model: ("openhaptics", {"model": model}) for model in openhaptics.MODELS},
}
"""Names of models: the backend and its options."""


@dataclass(frozen=True)
class BackendStatus:
    """The status of a backend on this computer."""

    entry: DeviceEntry
    installed: bool
    attached: str
    """What is connected, in a few words."""
    advice: str
    """How to get what is missing; empty if nothing is."""


def device(name: str, *, calibrated: bool = True, **options: Any) -> Device:
    """Return a device by name, not opened.

    Parameters
    ----------
    name : str
        A backend (`haply`, `force-dimension`, ...), a model (`touch`, `sigma.7`, ...), or
        `replay:FILE`.
    calibrated : bool
        Apply the calibration that `asperity devices check` saved, or the backend's usual home if
        there is none.
    **options
        Options of the backend's class.

    Raises
    ------
    AsperityError
        Unknown name or option, a value out of range, or an unreadable calibration.
    """
    if name.startswith("replay:"):
        name, options = "replay", {"source": name.partition(":")[2], **options}
    entry = entry_of(name)
    made = _make(entry, {**MODELS[name][1], **options} if name in MODELS else options)
    if entry.steady or not calibrated:
        return made
    return Calibrated(made, load_calibration(name) or Calibration(home=entry.home))


def entry_of(name: str) -> DeviceEntry:
    """Return the backend that a name stands for, `replay:FILE` included."""
    if name.startswith("replay:"):
        name = "replay"
    require_choice("device", name, [*ENTRIES, *MODELS])
    return ENTRIES[MODELS[name][0] if name in MODELS else name]


def backend_statuses() -> list[BackendStatus]:
    """Return the status of every backend. Opens no device."""
    return [_status_of(entry) for entry in _ENTRIES]


def is_installed(entry: DeviceEntry) -> bool:
    """Return whether a backend's package is installed; parts installed by hand may be missing."""
    return not entry.package or find_spec(entry.package) is not None


def is_calibrated(name: str) -> bool:
    """Return whether a calibration of a device has been saved."""
    return calibration_file(name).is_file()


def _make(entry: DeviceEntry, options: Mapping[str, Any]) -> Device:
    module = importlib.import_module(f"asperity.realtime.devices.{entry.module}")
    kind = getattr(module, entry.kind)
    parameters = inspect.signature(kind).parameters
    for option in options:
        if option not in parameters:
            require_choice(f"option of the device {entry.name}", option, parameters)
    for option, parameter in parameters.items():
        if parameter.default is inspect.Parameter.empty and option not in options:
            raise AsperityError(f"the device {entry.name} needs the option {option}=")
    made: Device = kind(**options)
    return made


def _status_of(entry: DeviceEntry) -> BackendStatus:
    if not entry.package:
        return BackendStatus(entry, True, "-", "")
    if not is_installed(entry):
        also = f"; and {entry.by_hand}" if entry.by_hand else ""
        return BackendStatus(entry, False, "-", f"pip install 'asperity[{entry.extra}]'{also}")
    attached, complete = _attached(entry)
    none = attached.startswith("none")
    advice = "" if complete and not none else entry.by_hand
    return BackendStatus(entry, True, attached, f"needs {advice}" if advice else "")


def _attached(entry: DeviceEntry) -> tuple[str, bool]:
    """Return what a vendor's package reports as connected, and whether it could report."""
    module = importlib.import_module(f"asperity.realtime.devices.{entry.module}")
    if not entry.found:
        return "cannot be detected" if entry.by_hand else "-", True
    try:
        # The packages print to these streams.
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            names = module.attached()
    except ImportError:
        return "no vendor library", False
    except Exception as error:  # an error of one vendor's package must not end the list
        return f"unknown ({type(error).__name__})", False
    return entry.found.format(", ".join(names)) if names else "none found", True
