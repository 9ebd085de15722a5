"""Provenance of results: versions, revision, machine."""

from __future__ import annotations

import os
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from asperity import __version__
from asperity.studies.sweeps.batch import machine, program, version_of


def session_facts() -> dict[str, Any]:
    """Return the facts of a run that begins now, without names of people or machines."""
    return {
        "started": now(),
        "version": __version__,
        "revision": revision(),
        "program": program(),
        "packages": {name: version_of(name) for name in ("zarr", "dask", "distributed", "xarray")},
        "started_on": machine(),
        "cores": os.cpu_count() or 1,
    }


def now() -> str:
    """Return date and time, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def revision() -> str | None:
    """Return the git revision of the package, "-dirty" if changed; None outside a checkout."""
    folder = Path(__file__).parents[2]
    try:
        _git(folder, "ls-files", "--error-unmatch", "__init__.py")
        return _git(folder, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(folder: Path, *words: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=10, check=True
    )
    return done.stdout.strip()
