"""What may be changed while somebody feels: stiffness, friction, coupling, rate; as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from asperity.contact.response.settings import ForceSettings
from asperity.dynamics.virtual_coupling.coupled_tool import CoupledTool
from asperity.dynamics.virtual_coupling.settings import CouplingSettings, DeviceLimits, coupled_body
from asperity.errors import require_between
from asperity.scene.scene import Scene

RATES = (100.0, 20e3)
"""Ticks a second."""


@dataclass(frozen=True)
class LiveParameters:
    """What a running loop may be given.

    Parameters
    ----------
    rate : float
        Ticks a second, 100 to 20000.
    stiffness : float
        Of the contact [N/m].
    friction : float
        Coefficient of the material.
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
        """Return those of a scene."""
        return LiveParameters(rate, scene.force.stiffness, scene.force.friction, scene.coupling)

    @staticmethod
    def from_plain(plain: Mapping[str, Any]) -> LiveParameters:
        """Return what `plain` made plain."""
        return LiveParameters(**{**plain, "coupling": CouplingSettings(**plain["coupling"])})

    def plain(self) -> dict[str, Any]:
        """Return them as texts and numbers."""
        return asdict(self)

    @property
    def dt(self) -> float:
        """The tick [s]."""
        return 1.0 / self.rate

    def force(self, settings: ForceSettings) -> ForceSettings:
        """Return a scene's settings with these in them; refuses values out of range."""
        return replace(settings, stiffness=self.stiffness, friction=self.friction)

    def tool(self, scene: Scene, limits: DeviceLimits | None) -> CoupledTool:
        """Return a tool on this coupling."""
        body = coupled_body(scene.model, scene.tool, mass_scale=self.coupling.mass_scale)
        return CoupledTool(body, self.coupling, dt=self.dt, limits=limits)
