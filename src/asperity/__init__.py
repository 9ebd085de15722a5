"""asperity: contact forces and torques between two textured objects, at haptic rates.

The public names live here, once each, and are loaded when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "AsperityError": "asperity.errors",
    "Body": "asperity.geometry.bodies",
    "BodyPair": "asperity.contact.pair",
    "ContactStage": "asperity.contact_stage",
    "CouplingSettings": "asperity.dynamics.coupling",
    "DotPlate": "asperity.geometry.dots",
    "Engine": "asperity.engine.engine",
    "ForceSettings": "asperity.forces.settings",
    "Geom": "asperity.geometry.bodies",
    "Grating": "asperity.geometry.analytic",
    "Hand": "asperity.dynamics.hand",
    "HandSettings": "asperity.dynamics.simulated_hand",
    "HeightField": "asperity.texture.height_field",
    "HeightMap": "asperity.geometry.sampled",
    "HeldTool": "asperity.dynamics.held_tool",
    "Limits": "asperity.devices.protocol",
    "Mapping": "asperity.devices.mapping",
    "Motion": "asperity.dynamics.hand",
    "PassivityController": "asperity.dynamics.passivity",
    "Reading": "asperity.devices.protocol",
    "ReplayedDevice": "asperity.devices.replayed",
    "SampledProfile": "asperity.geometry.sampled",
    "Scene": "asperity.scene",
    "ScriptedMotion": "asperity.trajectory",
    "Servo": "asperity.servo.running",
    "ServoSpec": "asperity.servo.process",
    "SimulatedDevice": "asperity.devices.simulated",
    "SimulatedHand": "asperity.dynamics.simulated_hand",
    "Simulation": "asperity.simulation",
    "Sinusoid": "asperity.geometry.analytic",
    "SnapshotReader": "asperity.servo.snapshot",
    "Trajectory": "asperity.trajectory",
    "SweepStudy": "asperity.sweeps.study",
    "bake": "asperity.baking.bake",
    "device": "asperity.devices.catalogue",
    "drag": "asperity.dynamics.hand",
    "drop_point": "asperity.geometry.offset",
    "load_scene": "asperity.scenes",
    "make_scene": "asperity.scene_from_files",
    "measure_stability": "asperity.stability",
    "offset_surface": "asperity.geometry.sampled",
    "open_recording": "asperity.recording_dataset",
    "open_sweep": "asperity.sweeps.store",
    "read_heights": "asperity.texture.reading",
    "read_poses": "asperity.trajectory_file",
    "read_recording": "asperity.recording",
    "read_study": "asperity.sweeps.study",
    "run_sweep": "asperity.sweeps.run",
    "scene_of": "asperity.scene",
    "self_affine": "asperity.texture.procedural",
}

__all__ = ["__version__", *_HOME]

if TYPE_CHECKING:
    from asperity.baking.bake import bake as bake
    from asperity.contact.pair import BodyPair as BodyPair
    from asperity.contact_stage import ContactStage as ContactStage
    from asperity.devices.catalogue import device as device
    from asperity.devices.mapping import Mapping as Mapping
    from asperity.devices.protocol import Limits as Limits
    from asperity.devices.protocol import Reading as Reading
    from asperity.devices.replayed import ReplayedDevice as ReplayedDevice
    from asperity.devices.simulated import SimulatedDevice as SimulatedDevice
    from asperity.dynamics.coupling import CouplingSettings as CouplingSettings
    from asperity.dynamics.hand import Hand as Hand
    from asperity.dynamics.hand import Motion as Motion
    from asperity.dynamics.hand import drag as drag
    from asperity.dynamics.held_tool import HeldTool as HeldTool
    from asperity.dynamics.passivity import PassivityController as PassivityController
    from asperity.dynamics.simulated_hand import HandSettings as HandSettings
    from asperity.dynamics.simulated_hand import SimulatedHand as SimulatedHand
    from asperity.engine.engine import Engine as Engine
    from asperity.errors import AsperityError as AsperityError
    from asperity.forces.settings import ForceSettings as ForceSettings
    from asperity.geometry.analytic import Grating as Grating
    from asperity.geometry.analytic import Sinusoid as Sinusoid
    from asperity.geometry.bodies import Body as Body
    from asperity.geometry.bodies import Geom as Geom
    from asperity.geometry.dots import DotPlate as DotPlate
    from asperity.geometry.offset import drop_point as drop_point
    from asperity.geometry.sampled import HeightMap as HeightMap
    from asperity.geometry.sampled import SampledProfile as SampledProfile
    from asperity.geometry.sampled import offset_surface as offset_surface
    from asperity.recording import read_recording as read_recording
    from asperity.recording_dataset import open_recording as open_recording
    from asperity.scene import Scene as Scene
    from asperity.scene import scene_of as scene_of
    from asperity.scene_from_files import make_scene as make_scene
    from asperity.scenes import load_scene as load_scene
    from asperity.servo.process import ServoSpec as ServoSpec
    from asperity.servo.running import Servo as Servo
    from asperity.servo.snapshot import SnapshotReader as SnapshotReader
    from asperity.simulation import Simulation as Simulation
    from asperity.stability import measure_stability as measure_stability
    from asperity.sweeps.run import run_sweep as run_sweep
    from asperity.sweeps.store import open_sweep as open_sweep
    from asperity.sweeps.study import SweepStudy as SweepStudy
    from asperity.sweeps.study import read_study as read_study
    from asperity.texture.height_field import HeightField as HeightField
    from asperity.texture.procedural import self_affine as self_affine
    from asperity.texture.reading import read_heights as read_heights
    from asperity.trajectory import ScriptedMotion as ScriptedMotion
    from asperity.trajectory import Trajectory as Trajectory
    from asperity.trajectory_file import read_poses as read_poses


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'asperity' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
