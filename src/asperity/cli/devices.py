"""`asperity devices`."""

from __future__ import annotations

import itertools
import textwrap
from dataclasses import dataclass
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import command
from asperity.cli.result import announce, print_result
from asperity.errors import AsperityError, require_choice

_WIDTHS = (17, 11, 20, 32)
"""Of the columns of the table of devices."""


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

        found = [
            {
                "name": status.entry.name,
                "installed": status.installed,
                "attached": status.attached,
                "what": status.entry.description,
                "advice": status.advice,
                "calibrated": is_calibrated(status.entry.name),
            }
            for status in backend_statuses()
        ]
        lines = _row("NAME", "INSTALLED", "ATTACHED", "WHAT IT IS")
        for one in found:
            installed = "yes" if one["installed"] else "no"
            lines += _row(str(one["name"]), installed, str(one["attached"]), str(one["what"]))
        lines += ["", *(f"{one['name']}: {one['advice']}" for one in found if one["advice"])]
        calibrated = [str(one["name"]) for one in found if one["calibrated"]]
        if calibrated:
            lines.append(f"calibrated: {', '.join(calibrated)}")
        print_result(lines, found)

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
        outcome = check_device(
            unchecked, home=entry.home, ask=None if self.yes else _ask, tell=announce
        )
        if entry.name == "haply-fake":
            line = "the device is simulated: no calibration is saved"
            print_result(line, {"device": entry.name, "saved": None})
            return
        path = save_calibration(self.name, outcome.calibration)
        print_result(f"saved {path}", {"device": entry.name, "saved": path})


def _row(*cells: str) -> list[str]:
    """Return a row of the table, 80 columns wide, as lines: what is longer goes on below."""
    wrapped = [textwrap.wrap(cell, width - 1) for cell, width in zip(cells, _WIDTHS, strict=True)]
    return [
        "".join(f"{part:{width}}" for part, width in zip(line, _WIDTHS, strict=True)).rstrip()
        for line in itertools.zip_longest(*wrapped, fillvalue="")
    ]


def _ask(request: str) -> None:
    """Show a request and wait for Enter."""
    try:
        input(f"{request}, then press Enter ")
    except EOFError:
        raise AsperityError(
            "standard input is closed; give --yes to check without prompts"
        ) from None
