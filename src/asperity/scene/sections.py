"""Tables of `scene.toml` that are settings: force, coupling, trajectory."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from asperity.contact.response.settings import ForceSettings
from asperity.dynamics.virtual_coupling.settings import COUPLING_MODES, CouplingSettings
from asperity.errors import require_choice
from asperity.scene.document import Table, arguments, at, find_file, parse_options, require_keys
from asperity.scene.trajectory import KINDS, ScriptedMotion, Trajectory
from asperity.scene.trajectory_file import read_poses

ANTI_ALIAS_MODES = ("off", "tick", "band")
"""Treatments of texture that passes faster than the tick."""


def force_of(table: Table) -> tuple[ForceSettings, str]:
    """Return the settings of the force, and the anti-aliasing, in the table `[force]`."""
    rest = {key: value for key, value in table.items() if key != "anti_alias"}
    require_keys(table, "force", [*(f.name for f in fields(ForceSettings)), "anti_alias"])
    mode = table.get("anti_alias", "off")
    at("force.anti_alias", lambda: require_choice("mode", mode, ANTI_ALIAS_MODES))
    options = arguments(rest, "force", ForceSettings)
    return at("force", lambda: ForceSettings(**options)), mode


def coupling_of(table: Table) -> CouplingSettings:
    """Return the settings in the table `[coupling]`."""
    options = arguments(table, "coupling", CouplingSettings)
    mode = options.get("mode", "direct")
    at("coupling.mode", lambda: require_choice("mode", mode, COUPLING_MODES))
    return at("coupling", lambda: CouplingSettings(**options))


def motion_of(table: Table, folder: Path | None) -> ScriptedMotion | Trajectory:
    """Return the motion in the table `[trajectory]`; files of poses lie in a folder."""
    if "file" in table:
        given = parse_options(table, "trajectory", read_poses, "file", ())
        path = find_file(table, "trajectory", folder)
        return at("trajectory", lambda: read_poses(path, **given))
    if "kind" in table:
        at("trajectory.kind", lambda: require_choice("trajectory", table["kind"], KINDS))
    options = arguments(table, "trajectory", ScriptedMotion)
    return at("trajectory", lambda: ScriptedMotion(**options))
