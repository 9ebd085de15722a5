"""The devices there are: their names, what each needs, what is here, and making one by name."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

from asperity.errors import AsperityError, require_choice
from asperity.realtime.devices.calibration import (
    Calibrated,
    Calibration,
    calibration_file,
    load_calibration,
)
from asperity.realtime.devices.haply.cursor import HOME
from asperity.realtime.devices.protocol import Device


@dataclass(frozen=True)
class Entry:
    """One backend."""

    name: str
    told: str
    """What it is, in a few words."""
    module: str
    kind: str
    """Class in `asperity.realtime.devices.MODULE`."""
    package: str = ""
    """The import that has to succeed; empty: none beyond asperity's own."""
    extra: str = ""
    by_hand: str = ""
    """What no package installer brings."""
    home: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Middle of the workspace in the vendor's origin, where no calibration says [m]."""
    steady: bool = False
    """It has no axes and home to be found out."""
    checked_with: Mapping[str, Any] = field(default_factory=dict)
    """Options under which it can be checked."""


_ENTRIES = (
    Entry("simulated", "a simulated hand", "simulated", "SimulatedDevice", steady=True),
    Entry("mouse", "a page's pointer, in a simulated hand", "mouse", "MouseDevice", steady=True),
    Entry("replay", "a recording or a file of poses", "replayed", "ReplayedDevice", steady=True),
    Entry(
        "haply", "Haply Inverse3, by its service", "haply.service", "HaplyServiceDevice",
        "websockets", "haply", "Haply Hub or the Inverse service", HOME,
    ),
    Entry(
        "haply-fake", "the same, simulated", "haply.fake_device",
        "HaplyFakeDevice", "websockets", "haply", "", HOME, checked_with={"motion": "still"},
    ),
    Entry(
        "haply-serial", "Haply Inverse3, by serial port", "haply.serial_port",
        "HaplyHardwareDevice", "HaplyHardwareAPI", "haply",
        "an Inverse3 on USB (Linux: group dialout)", HOME,
    ),
    Entry(
        "force-dimension", "omega, sigma, lambda", "force_dimension", "ForceDimensionDevice",
        "forcedimension_core", "forcedimension", "Force Dimension SDK 3.16 or later",
    ),
    Entry(
        "openhaptics", "3D Systems Touch, Premium", "openhaptics", "OpenHapticsDevice",
        "pyOpenHaptics", "openhaptics", "OpenHaptics and the device's driver",
    ),
)  # fmt: skip
ENTRIES = {entry.name: entry for entry in _ENTRIES}
MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "inverse3": ("haply", {}),
    "omega.6": ("force-dimension", {"model": "omega.6"}),
    "sigma.7": ("force-dimension", {"model": "sigma.7"}),
    "lambda.7": ("force-dimension", {"model": "lambda.7"}),
    "touch": ("openhaptics", {"model": "touch"}),
    "omni": ("openhaptics", {"model": "omni"}),
    "premium-1.5-6dof": ("openhaptics", {"model": "premium-1.5-6dof"}),
    "premium-3.0-6dof": ("openhaptics", {"model": "premium-3.0-6dof"}),
}
"""What people call them, too: the backend and its options."""


@dataclass(frozen=True)
class BackendStatus:
    """What is here of one backend."""

    entry: Entry
    installed: bool
    attached: str
    """What is plugged in, in a few words."""
    advice: str
    """How to get what lacks; empty if nothing does."""


def device(name: str, *, calibrated: bool = True, **options: Any) -> Device:
    """Return a device by name, not yet opened.

    Parameters
    ----------
    name : str
        A backend (`haply`, `force-dimension`, ...), a model (`touch`, `sigma.7`, ...), or
        `replay:FILE`.
    calibrated : bool
        Take axes and home from the calibration that `asperity devices check` saved, or the
        backend's usual home where there is none.
    **options
        Of the backend's class.

    Raises
    ------
    AsperityError
        Unknown name or option, a value out of range, or a calibration that cannot be read.
    """
    if name.startswith("replay:"):
        name, options = "replay", {"source": name.partition(":")[2], **options}
    require_choice("device", name, [*ENTRIES, *MODELS])
    if name in MODELS:
        backend, settings = MODELS[name]
        entry, options = ENTRIES[backend], {**settings, **options}
    else:
        entry = ENTRIES[name]
    made = _make(entry, options)
    if entry.steady or not calibrated:
        return made
    return Calibrated(made, load_calibration(name) or Calibration(home=entry.home))


def entry_of(name: str) -> Entry:
    """Return the backend that a name stands for."""
    require_choice("device", name, [*ENTRIES, *MODELS])
    return ENTRIES[MODELS[name][0] if name in MODELS else name]


def findings() -> list[BackendStatus]:
    """Return what is installed and attached, of every backend. Opens no device."""
    return [_finding(entry) for entry in _ENTRIES]


def is_installed(entry: Entry) -> bool:
    """Return whether the package of a backend is there (it may still lack what is by hand)."""
    return not entry.package or find_spec(entry.package) is not None


def is_calibrated(name: str) -> bool:
    """Return whether a calibration is kept for a device."""
    return calibration_file(name).is_file()


def _make(entry: Entry, options: Mapping[str, Any]) -> Device:
    try:
        kind = getattr(
            importlib.import_module(f"asperity.realtime.devices.{entry.module}"), entry.kind
        )
    except ModuleNotFoundError as error:
        if error.name != f"asperity.realtime.devices.{entry.module}":
            raise
        raise AsperityError(f"this version of asperity has no {entry.name} device") from None
    parameters = inspect.signature(kind).parameters
    for option in options:
        if option not in parameters:
            require_choice(f"option of the device {entry.name}", option, parameters)
    for option, parameter in parameters.items():
        if parameter.default is inspect.Parameter.empty and option not in options:
            raise AsperityError(f"the device {entry.name} needs {option}=")
    made: Device = kind(**options)
    return made


def _finding(entry: Entry) -> BackendStatus:
    if not entry.package:
        return BackendStatus(entry, True, "-", "")
    if not is_installed(entry):
        also = f"; and {entry.by_hand}" if entry.by_hand else ""
        return BackendStatus(entry, False, "-", f"pip install 'asperity[{entry.extra}]'{also}")
    ask = _ASKED.get(entry.name)
    if ask is None:
        attached, complete = ("-", True) if not entry.by_hand else ("cannot be asked", True)
    else:
        attached, complete = _asked(ask)
    none = attached.startswith("none")
    advice = "" if complete and not none else entry.by_hand
    return BackendStatus(entry, True, attached, f"needs {advice}" if advice else "")


def _asked(ask: Callable[[], str]) -> tuple[str, bool]:
    """Return what a vendor's package says is attached, and whether it could say."""
    try:
        # The packages talk on these; the table is no place for it.
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return ask(), True
    except ImportError:
        return "no vendor library", False
    except Exception as error:  # whatever a vendor's package does, the rest of the list stands
        return f"unknown ({type(error).__name__})", False


def _ask_service() -> str:
    from asperity.realtime.devices.haply.service import attached

    ids = attached()
    return f"Inverse3 {', '.join(ids)}" if ids else "none found"


def _ask_serial() -> str:
    import HaplyHardwareAPI as api  # noqa: N813

    ports = api.detect_inverse3s()
    return f"Inverse3 on {', '.join(ports)}" if ports else "none found"


def _ask_force_dimension() -> str:
    from asperity.realtime.devices.force_dimension import attached

    count = attached()
    return f"{count} found" if count > 0 else "none found"


_ASKED: dict[str, Callable[[], str]] = {
    "haply": _ask_service,
    "haply-serial": _ask_serial,
    "force-dimension": _ask_force_dimension,
}
