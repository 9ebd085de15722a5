"""asperity: contact forces and torques between two textured objects, at haptic rates.

The public names live here, once each, and are loaded when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "AsperityError": "asperity.errors",
    "DotPlate": "asperity.geometry.dots",
    "Grating": "asperity.geometry.analytic",
    "Hand": "asperity.dynamics.hand",
    "HeightMap": "asperity.geometry.sampled",
    "Motion": "asperity.dynamics.hand",
    "SampledProfile": "asperity.geometry.sampled",
    "Sinusoid": "asperity.geometry.analytic",
    "drag": "asperity.dynamics.hand",
    "drop_point": "asperity.geometry.offset",
    "offset_surface": "asperity.geometry.sampled",
    "read_heights": "asperity.texture.reading",
    "self_affine": "asperity.texture.procedural",
}

__all__ = ["__version__", *_HOME]

if TYPE_CHECKING:
    from asperity.dynamics.hand import Hand as Hand
    from asperity.dynamics.hand import Motion as Motion
    from asperity.dynamics.hand import drag as drag
    from asperity.errors import AsperityError as AsperityError
    from asperity.geometry.analytic import Grating as Grating
    from asperity.geometry.analytic import Sinusoid as Sinusoid
    from asperity.geometry.dots import DotPlate as DotPlate
    from asperity.geometry.offset import drop_point as drop_point
    from asperity.geometry.sampled import HeightMap as HeightMap
    from asperity.geometry.sampled import SampledProfile as SampledProfile
    from asperity.geometry.sampled import offset_surface as offset_surface
    from asperity.texture.procedural import self_affine as self_affine
    from asperity.texture.reading import read_heights as read_heights


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'asperity' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
