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
_USUAL = {
    ("force", "friction"): (5.0, ""), ("trajectory", "speed"): (10.0, " m/s"),
    ("trajectory", "press_force"): (100.0, " N"), ("trajectory", "length"): (3.0, " m"),
    ("trajectory", "radius"): (3.0, " m"), ("trajectory", "press_depth"): (0.1, " m"),
}  # fmt: skip
"""Values, of hands and plates, above which a unit is doubted."""


def force_of(table: Table) -> tuple[ForceSettings, str]:
    """Return the settings of the force, and the anti-aliasing, in the table `[force]`."""
    rest = {key: value for key, value in table.items() if key != "anti_alias"}
    require_keys(table, "force", [*(f.name for f in fields(ForceSettings)), "anti_alias"])
    mode = table.get("anti_alias", "off")
    at("force.anti_alias", lambda: require_choice("mode", mode, ANTI_ALIAS_MODES))
    options = arguments(rest, "force", ForceSettings)
    return at("force", lambda: ForceSettings(**options)), mode


def unusual(document: Table) -> list[str]:
    """Return notes on values that are valid but hardly in SI units, as a speed in mm/s."""
    return [
        f"is {section}.{key} = {value:g}{unit} right? Usual: {most:g}{unit} at most; all values "
        "are in SI units"
        for (section, key), (most, unit) in _USUAL.items()
        if isinstance(value := document.get(section, {}).get(key), int | float) and value > most
    ]


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
