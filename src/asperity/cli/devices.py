"""`asperity devices`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import command
from asperity.errors import AsperityError, require_choice


@command
@dataclass
class DevicesCommand:
    """List the haptic devices: which are installed and attached, and how to install the others.

    `asperity devices check NAME` tests one (axes, home position, a force up to 0.5 N) and saves
    its calibration.
    """

    action: Annotated[Positional[str], arg(metavar="[list|check]")] = "list"
    """What to do."""
    name: Annotated[Positional[str | None], arg(metavar="NAME")] = None
    """The device to check."""
    yes: bool = False
    """Check without prompts: axes and home are accepted as they are. Clear the space around it!"""

    def run(self) -> None:
        """List the devices, or check one."""
        require_choice("action", self.action, ("list", "check"))
        if self.action == "check":
            self._check()
        elif self.name is not None or self.yes:
            raise AsperityError("asperity devices takes no name; to test one: devices check NAME")
        else:
            self._list()

    def _list(self) -> None:
        from asperity.realtime.devices.catalogue import backend_statuses, is_calibrated

        print(f"{'NAME':17}{'INSTALLED':11}{'ATTACHED':20}WHAT IT IS")
        found = backend_statuses()
        for finding in found:
            entry = finding.entry
            installed = "yes" if finding.installed else "no"
            print(
                f"{entry.name:17}{installed:11}{finding.attached[:19]:20}{entry.description[:32]}"
            )
        print()
        for finding in found:
            if finding.advice:
                print(f"{finding.entry.name}: {finding.advice}")
        calibrated = [f.entry.name for f in found if is_calibrated(f.entry.name)]
        if calibrated:
            print(f"calibrated: {', '.join(calibrated)}")

    def _check(self) -> None:
        from asperity.realtime.devices.calibration import save_calibration
        from asperity.realtime.devices.catalogue import device, entry_of
        from asperity.realtime.servo.device_check import check_device

        if self.name is None:
            raise AsperityError(
                "the name of the device is missing: asperity devices check NAME; "
                "'asperity devices' lists the names"
            )
        entry = entry_of(self.name)
        if entry.steady:
            raise AsperityError(f"{entry.name} cannot be checked: it has no motors and no axes")
        unchecked = device(self.name, calibrated=False, **entry.check_options)
        outcome = check_device(unchecked, home=entry.home, ask=None if self.yes else _ask)
        if entry.name == "haply-fake":
            print("the device is simulated: no calibration is saved")
            return
        path = save_calibration(self.name, outcome.calibration)
        print(f"saved {path}")


def _ask(request: str) -> None:
    """Show a request and wait for Enter."""
    try:
        input(f"{request}, then press Enter ")
    except EOFError:
        raise AsperityError(
            "standard input is closed; give --yes to check without prompts"
        ) from None
