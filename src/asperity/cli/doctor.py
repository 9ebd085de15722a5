"""`asperity doctor`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class DoctorCommand:
    """Print what this machine has: versions, compiled cache, graphics, timer, devices."""

    def run(self) -> None:
        """Print the report."""
        from asperity.cli.machine_check import report

        for subject, finding in report():
            print(f"{subject + ':':16}{finding}")
