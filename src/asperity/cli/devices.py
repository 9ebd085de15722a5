"""`asperity devices`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.errors import AsperityError, require_choice


@dataclass
class DevicesCommand:
    """List the haptic devices: what is installed, attached, and how to get the rest.

    `asperity devices check NAME` tries one: axes, home, and a force up to 0.5 N; it saves what it
    finds.
    """

    action: Annotated[Positional[str], arg(metavar="[list|check]")] = "list"
    """What to do."""
    name: Annotated[Positional[str | None], arg(metavar="NAME")] = None
    """Which device to check."""
    yes: bool = False
    """Check without asking: axes and home are taken as they are. Clear the space around it!"""

    def run(self) -> None:
        """List, or check."""
        require_choice("action", self.action, ("list", "check"))
        if self.action == "check":
            self._check()
        elif self.name is not None or self.yes:
            raise AsperityError("asperity devices takes no name; to try one: devices check NAME")
        else:
            self._list()

    def _list(self) -> None:
        from asperity.realtime.devices.catalogue import findings, is_calibrated

        print(f"{'NAME':17}{'INSTALLED':11}{'ATTACHED':20}WHAT IT IS")
        found = findings()
        for finding in found:
            entry = finding.entry
            installed = "yes" if finding.installed else "no"
            print(f"{entry.name:17}{installed:11}{finding.attached[:19]:20}{entry.told[:32]}")
        print()
        for finding in found:
            if finding.advice:
                print(f"{finding.entry.name}: {finding.advice}")
        kept = [f.entry.name for f in found if is_calibrated(f.entry.name)]
        if kept:
            print(f"calibrated: {', '.join(kept)}")

    def _check(self) -> None:
        from asperity.realtime.devices.calibration import save_calibration
        from asperity.realtime.devices.catalogue import device, entry_of
        from asperity.realtime.servo.device_check import check_device

        if self.name is None:
            raise AsperityError("asperity devices check NAME: which one? See 'asperity devices'")
        entry = entry_of(self.name)
        if entry.steady:
            raise AsperityError(f"{entry.name} is no device to check: it has no motors and no axes")
        tried = device(self.name, calibrated=False, **entry.checked_with)
        outcome = check_device(tried, home=entry.home, ask=None if self.yes else _ask)
        if entry.name == "haply-fake":
            print("nothing is saved: it is simulated")
            return
        path = save_calibration(self.name, outcome.calibration)
        print(f"saved {path}")


def _ask(request: str) -> None:
    """Show a request and wait for Enter."""
    try:
        input(f"{request}, then press Enter ")
    except EOFError:
        raise AsperityError("nobody answers on standard input; give --yes") from None
