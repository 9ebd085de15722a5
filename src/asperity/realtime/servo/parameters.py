"""Parameters of a running loop: stiffness, friction, coupling and rate, replaced as a whole."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from typing import Any

from asperity import __version__
from asperity.contact.response.settings import ForceSettings
from asperity.dynamics.virtual_coupling.coupled_tool import CoupledTool
from asperity.dynamics.virtual_coupling.settings import CouplingSettings, DeviceLimits, coupled_body
from asperity.errors import require_between
from asperity.scene.scene import Scene

RATES = (100.0, 20e3)
"""Valid tick rates [Hz]."""


@dataclass(frozen=True)
class LiveParameters:
    """The parameters of a running loop.

    Parameters
    ----------
    rate : float
        Ticks per second, 100 to 20000 [Hz].
    stiffness : float
        Contact stiffness [N/m]: on a coupling that of the objects.
    friction : float
        Coefficient of friction of the material.
    coupling : CouplingSettings
    """

    rate: float
    stiffness: float
    friction: float
    coupling: CouplingSettings

    def __post_init__(self) -> None:
        require_between("rate", self.rate, *RATES, "Hz")

    @staticmethod
    def of(scene: Scene, rate: float) -> LiveParameters:
        """Return a scene's parameters."""
        force = scene.acting_force
        return LiveParameters(rate, force.stiffness, force.friction, scene.coupling)

    def changed(self, scene: Scene, changes: Mapping[str, Any]) -> LiveParameters:
        """Return the parameters with some of them changed.

        If a coupling is added or removed, the stiffness is the scene's for that mode, unless given.
        """
        new = replace(self, **changes)
        if "stiffness" in changes or new.is_direct == self.is_direct:
            return new
        return replace(new, stiffness=replace(scene, coupling=new.coupling).acting_force.stiffness)

    @property
    def is_direct(self) -> bool:
        """Whether tool and handle are one body."""
        return self.coupling.mode == "direct"

    @staticmethod
    def from_plain(plain: Mapping[str, Any]) -> LiveParameters:
        """Return parameters from the mapping that `plain` made."""
        return LiveParameters(**{**plain, "coupling": CouplingSettings(**plain["coupling"])})

    def plain(self) -> dict[str, Any]:
        """Return the parameters as a mapping of strings and numbers."""
        return asdict(self)

    @property
    def dt(self) -> float:
        """Tick [s]."""
        return 1.0 / self.rate

    def force(self, settings: ForceSettings) -> ForceSettings:
        """Return force settings with these parameters; AsperityError if out of range."""
        return replace(settings, stiffness=self.stiffness, friction=self.friction)

    def tool(self, scene: Scene, limits: DeviceLimits | None) -> CoupledTool:
        """Return a tool with this coupling, within a device's limits."""
        body = coupled_body(scene.model, scene.tool, mass_scale=self.coupling.mass_scale)
        return CoupledTool(body, self.coupling, dt=self.dt, limits=limits)


def attributes_of(
    scene: Scene, parameters: LiveParameters, *, source: str, device: str = ""
) -> dict[str, Any]:
    """Return the attributes of a recording of a running loop with its present parameters."""
    document = deepcopy(dict(scene.document))
    stiffness = "stiffness" if parameters.is_direct else "object_stiffness"
    force = {stiffness: parameters.stiffness, "friction": parameters.friction}
    document["force"] = {**document.get("force", {}), **force}
    coupling = parameters.coupling
    document["coupling"] = {k: v for k, v in asdict(coupling).items() if v is not None}
    return {
        "scene": scene.name, "source": source, "trajectory": "device", "device": device,
        "dt": parameters.dt, "anti_alias": scene.anti_alias, "coupling": coupling.mode,
        "hand": "device", "contact_lag": int(coupling.mode != "direct"), "version": __version__,
        "document": json.dumps(document), "notes": "\n".join(scene.notes),
        "begun": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }  # fmt: skip
