"""asperity: contact forces and torques between two textured objects, at haptic rates.

The public names live here, once each, and are loaded when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from asperity._core.moved import install

__version__ = "0.1.0"

install()

_HOME = {
    "AsperityError": "asperity.errors",
    "Body": "asperity.geometry.bodies",
    "BodyPair": "asperity.contact.body_pair",
    "ContactStage": "asperity.simulation.tool_contact",
    "CouplingSettings": "asperity.dynamics.virtual_coupling.settings",
    "DotPlate": "asperity.geometry.offsets.dots",
    "Engine": "asperity.contact.solver",
    "ForceSettings": "asperity.contact.response.settings",
    "Geom": "asperity.geometry.bodies",
    "Grating": "asperity.geometry.offsets.analytic",
    "Hand": "asperity.dynamics.dragged_hand.hand",
    "HandSettings": "asperity.dynamics.simulated_hand.hand",
    "HeightField": "asperity.texture.height_field",
    "HeightMap": "asperity.geometry.offsets.sampled",
    "HeldTool": "asperity.dynamics.virtual_coupling.coupled_tool",
    "Limits": "asperity.realtime.devices.protocol",
    "Mapping": "asperity.realtime.devices.mapping",
    "Motion": "asperity.dynamics.dragged_hand.hand",
    "PassivityController": "asperity.dynamics.passivity.controller",
    "Reading": "asperity.realtime.devices.protocol",
    "ReplayedDevice": "asperity.realtime.devices.replayed",
    "SampledProfile": "asperity.geometry.offsets.sampled",
    "Scene": "asperity.scene.scene",
    "ScriptedMotion": "asperity.scene.trajectory",
    "Servo": "asperity.realtime.servo.running",
    "ServoSpec": "asperity.realtime.servo.process",
    "SimulatedDevice": "asperity.realtime.devices.simulated",
    "SimulatedHand": "asperity.dynamics.simulated_hand.hand",
    "Simulation": "asperity.simulation.simulation",
    "Sinusoid": "asperity.geometry.offsets.analytic",
    "SnapshotReader": "asperity.realtime.servo.snapshot",
    "Trajectory": "asperity.scene.trajectory",
    "SweepStudy": "asperity.studies.sweeps.study",
    "bake": "asperity.baking.bake",
    "device": "asperity.realtime.devices.catalogue",
    "drag": "asperity.dynamics.dragged_hand.hand",
    "drop_point": "asperity.geometry.offsets.surface",
    "load_scene": "asperity.scene.builtin",
    "make_scene": "asperity.scene.from_files",
    "measure_stability": "asperity.studies.stability.measure",
    "offset_surface": "asperity.geometry.offsets.sampled",
    "open_recording": "asperity.runs.dataset",
    "open_sweep": "asperity.studies.sweeps.store",
    "read_heights": "asperity.texture.files.reading",
    "read_poses": "asperity.scene.trajectory_file",
    "read_recording": "asperity.runs.recording",
    "read_study": "asperity.studies.sweeps.study",
    "run_sweep": "asperity.studies.sweeps.run",
    "scene_of": "asperity.scene.scene",
    "self_affine": "asperity.texture.patterns.random_surfaces",
}

__all__ = ["__version__", *_HOME]

if TYPE_CHECKING:
    from asperity.baking.bake import bake as bake
    from asperity.contact.body_pair import BodyPair as BodyPair
    from asperity.contact.response.settings import ForceSettings as ForceSettings
    from asperity.contact.solver import Engine as Engine
    from asperity.dynamics.dragged_hand.hand import Hand as Hand
    from asperity.dynamics.dragged_hand.hand import Motion as Motion
    from asperity.dynamics.dragged_hand.hand import drag as drag
    from asperity.dynamics.passivity.controller import PassivityController as PassivityController
    from asperity.dynamics.simulated_hand.hand import HandSettings as HandSettings
    from asperity.dynamics.simulated_hand.hand import SimulatedHand as SimulatedHand
    from asperity.dynamics.virtual_coupling.coupled_tool import HeldTool as HeldTool
    from asperity.dynamics.virtual_coupling.settings import CouplingSettings as CouplingSettings
    from asperity.errors import AsperityError as AsperityError
    from asperity.geometry.bodies import Body as Body
    from asperity.geometry.bodies import Geom as Geom
    from asperity.geometry.offsets.analytic import Grating as Grating
    from asperity.geometry.offsets.analytic import Sinusoid as Sinusoid
    from asperity.geometry.offsets.dots import DotPlate as DotPlate
    from asperity.geometry.offsets.sampled import HeightMap as HeightMap
    from asperity.geometry.offsets.sampled import SampledProfile as SampledProfile
    from asperity.geometry.offsets.sampled import offset_surface as offset_surface
    from asperity.geometry.offsets.surface import drop_point as drop_point
    from asperity.realtime.devices.catalogue import device as device
    from asperity.realtime.devices.mapping import Mapping as Mapping
    from asperity.realtime.devices.protocol import Limits as Limits
    from asperity.realtime.devices.protocol import Reading as Reading
    from asperity.realtime.devices.replayed import ReplayedDevice as ReplayedDevice
    from asperity.realtime.devices.simulated import SimulatedDevice as SimulatedDevice
    from asperity.realtime.servo.process import ServoSpec as ServoSpec
    from asperity.realtime.servo.running import Servo as Servo
    from asperity.realtime.servo.snapshot import SnapshotReader as SnapshotReader
    from asperity.runs.dataset import open_recording as open_recording
    from asperity.runs.recording import read_recording as read_recording
    from asperity.scene.builtin import load_scene as load_scene
    from asperity.scene.from_files import make_scene as make_scene
    from asperity.scene.scene import Scene as Scene
    from asperity.scene.scene import scene_of as scene_of
    from asperity.scene.trajectory import ScriptedMotion as ScriptedMotion
    from asperity.scene.trajectory import Trajectory as Trajectory
    from asperity.scene.trajectory_file import read_poses as read_poses
    from asperity.simulation.simulation import Simulation as Simulation
    from asperity.simulation.tool_contact import ContactStage as ContactStage
    from asperity.studies.stability.measure import measure_stability as measure_stability
    from asperity.studies.sweeps.run import run_sweep as run_sweep
    from asperity.studies.sweeps.store import open_sweep as open_sweep
    from asperity.studies.sweeps.study import SweepStudy as SweepStudy
    from asperity.studies.sweeps.study import read_study as read_study
    from asperity.texture.files.reading import read_heights as read_heights
    from asperity.texture.height_field import HeightField as HeightField
    from asperity.texture.patterns.random_surfaces import self_affine as self_affine


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'asperity' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
