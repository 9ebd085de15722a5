"""Modules that have moved: their old names still work for one version, with a warning.

`install` adds a finder behind those of Python, which sees only names that no other finder
knows. A module under its old name hands on every attribute of the one that took its place.
"""

from __future__ import annotations

import importlib
import importlib.machinery
import importlib.util
import sys
import warnings
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

PACKAGES = {
    "comparison": "studies.comparison",
    "devices": "realtime.devices",
    "engine": "contact",
    "experiments": "psychophysics",
    "findings": "studies.literature",
    "forces": "studies.otaduy_lin_2004.force_models",
    "methods": "studies.baselines",
    "page": "viewer",
    "perception": "studies.otaduy_lin_2004",
    "picture": "drawing.renderer",
    "scenes": "scene.builtin",
    "servo": "realtime.servo",
    "sweeps": "studies.sweeps",
    "vibration": "vibrotactile",
}
"""Old and new names of packages, without `asperity.`; modules not listed below kept theirs."""
MODULES = {
    "anti_alias": "simulation.anti_aliasing",
    "cli.felt": "cli.realtime_run",
    "cli.files": "cli.data_files",
    "compile_time": "_core.compile_time",
    "compiled": "_core.kernels",
    "contact.pair": "contact.body_pair",
    "contact_stage": "simulation.tool_contact",
    "demo": "cli.demo_pipeline",
    "devices.exchange": "realtime.devices.polling_thread",
    "devices.haply_cursor": "realtime.devices.haply.fake_service",
    "devices.haply_fake": "realtime.devices.haply.fake_service",
    "devices.haply_fake_device": "realtime.devices.haply.fake_device",
    "devices.haply_hardware": "realtime.devices.haply.serial_port",
    "devices.haply_link": "realtime.devices.haply.service",
    "devices.haply_messages": "realtime.devices.haply.messages",
    "devices.haply_service": "realtime.devices.haply.service",
    "devices.mapped": "realtime.devices.mapping",
    "devices.pointed": "realtime.devices.pointer_file",
    "devices.wrenches": "realtime.devices.protocol",
    "doctor": "cli.doctor",
    "dynamics.coupling": "dynamics.virtual_coupling.settings",
    "dynamics.damping": "dynamics.passivity.step",
    "dynamics.drag": "dynamics.dragged_hand.integrator",
    "dynamics.hand": "dynamics.dragged_hand.hand",
    "dynamics.hand_tick": "dynamics.simulated_hand.step",
    "dynamics.held_tool": "dynamics.virtual_coupling.coupled_tool",
    "dynamics.implicit": "dynamics.virtual_coupling.backward_euler",
    "dynamics.repeat": "dynamics.dragged_hand.periodic_motion",
    "dynamics.rigid": "geometry.rigid_body",
    "dynamics.semi_implicit": "dynamics.virtual_coupling.semi_implicit",
    "dynamics.static_coupling": "dynamics.virtual_coupling.static",
    "dynamics.tied": "dynamics.virtual_coupling.loads",
    "engine.engine": "contact.solver",
    "engine.memory": "contact.contacts",
    "experiments.analysis": "psychophysics.analysis.analysis",
    "experiments.figures": "psychophysics.analysis.figures",
    "experiments.fronts": "psychophysics.interfaces.protocol",
    "experiments.journal": "psychophysics.session.journal",
    "experiments.magnitudes": "psychophysics.analysis.magnitudes",
    "experiments.page": "psychophysics.interfaces.page",
    "experiments.participants": "psychophysics.interfaces.simulated_participants",
    "experiments.presenters": "psychophysics.session.presenters",
    "experiments.procedures": "psychophysics.procedures.procedures",
    "experiments.psychometric": "psychophysics.analysis.psychometric",
    "experiments.psychometric_fit": "psychophysics.analysis.psychometric_fit",
    "experiments.psychometric_search": "psychophysics.analysis.psychometric_search",
    "experiments.questplus": "psychophysics.procedures.questplus",
    "experiments.results": "psychophysics.analysis.results",
    "experiments.scales": "psychophysics.analysis.scales",
    "experiments.session": "psychophysics.session.session",
    "experiments.staircase": "psychophysics.procedures.staircase",
    "experiments.tables": "psychophysics.session.tables",
    "experiments.terminal": "psychophysics.interfaces.terminal",
    "experiments.trials": "psychophysics.session.trials",
    "export": "runs.export",
    "findings.search": "studies.literature.hand_search",
    "forces.laws": "contact.response.point_laws",
    "forces.settings": "contact.response.settings",
    "geometry.analytic": "geometry.offsets.analytic",
    "geometry.atlas": "geometry.mesh.atlas",
    "geometry.disk_search": "geometry.offsets.disk_search",
    "geometry.dots": "geometry.offsets.dots",
    "geometry.mesh_checks": "geometry.mesh.checks",
    "geometry.mesh_crossings": "geometry.mesh.crossings",
    "geometry.mesh_files": "geometry.mesh.files",
    "geometry.mesh_normals": "geometry.mesh.normals",
    "geometry.mesh_topology": "geometry.mesh.topology",
    "geometry.mesh_uv": "geometry.mesh.uv",
    "geometry.offset": "geometry.offsets.surface",
    "geometry.piece_cache": "geometry.convex.pieces",
    "geometry.pieces": "geometry.convex.pieces",
    "geometry.piecewise": "geometry.offsets.piecewise",
    "geometry.placing": "geometry.mesh.texture_coordinates",
    "geometry.polygons": "geometry.facets.polygons",
    "geometry.sampled": "geometry.offsets.sampled",
    "geometry.shapes.cad_part": "geometry.shapes.shape",
    "geometry.shapes.file_tool": "geometry.shapes.shape",
    "geometry.shapes.hammer": "geometry.shapes.shape",
    "geometry.sphere_search": "geometry.offsets.sphere_search",
    "geometry.tessellate": "geometry.facets.tessellate",
    "headless": "runs.run_scene",
    "kernel_clock": "_core.clock",
    "methods.by_engine": "studies.baselines.asperity_laws",
    "methods.method": "studies.baselines.protocol",
    "methods.placed": "studies.baselines.placement",
    "methods.voxel_points": "studies.baselines.voxmap",
    "methods.surfaces": "studies.baselines.displaced_surfaces",
    "output": "_core.output",
    "page.atlas": "viewer.drawables.atlas",
    "page.choice": "viewer.session_config",
    "page.colours": "viewer.drawables.colours",
    "page.contacts": "viewer.replayed_contacts",
    "page.controls": "viewer.panels.controls",
    "page.frames": "viewer.panels.panel",
    "page.glb": "viewer.drawables.glb",
    "page.instruments": "viewer.app",
    "page.history": "viewer.tick_buffer",
    "page.kept": "viewer.tick_buffer",
    "page.link": "viewer.servo_client",
    "page.live": "viewer.app",
    "page.mouse": "viewer.panels.mouse",
    "page.origin": "viewer.server.access",
    "page.panel": "viewer.panels.panel",
    "page.panels": "viewer.app",
    "page.plots_panel": "viewer.panels.plots",
    "page.proxy": "viewer.server.access",
    "page.record_panel": "viewer.panels.record",
    "page.roughness_panel": "viewer.panels.roughness",
    "page.say": "viewer.notify",
    "page.server": "viewer.server.server",
    "page.shapes": "viewer.drawables.shapes",
    "page.sound_panel": "viewer.panels.sound",
    "page.stage": "viewer.panels.scene_view",
    "page.status": "viewer.panels.status",
    "page.textures": "viewer.panels.textures",
    "page.time_panel": "viewer.panels.time",
    "page.transfers": "viewer.server.transfers",
    "page.uploads": "viewer.server.uploads",
    "perception.fit": "studies.otaduy_lin_2004.peak_fit",
    "perception.metrics": "runs.vibration_metrics",
    "perception.sweep": "studies.otaduy_lin_2004.drags",
    "picture.mesh_relief": "geometry.displaced.relief",
    "picture.mesh_sheets": "geometry.displaced.meshes",
    "picture.sheets": "geometry.displaced.geoms",
    "picture.view": "geometry.displaced.view",
    "plots": "drawing.figure_style",
    "plots_run": "runs.figures",
    "plots_stability": "studies.stability.figures",
    "plots_traces": "runs.figures",
    "poses": "geometry.poses",
    "press": "simulation.press",
    "real_surfaces": "studies.otaduy_lin_2004.real_surfaces",
    "recording": "runs.recording",
    "recording_dataset": "runs.dataset",
    "report": "cli.report",
    "report_style": "drawing.pages",
    "scene_file": "scene.document",
    "scene_from_files": "scene.from_files",
    "scene_mesh": "scene.mesh",
    "scene_mjcf": "scene.mjcf",
    "scene_place": "scene.placement",
    "scene_texture": "scene.texture",
    "realtime.servo.device_makers": "realtime.servo.process",
    "servo.in_hand": "realtime.servo.process",
    "servo.on_request": "realtime.servo.recorder",
    "servo.pace": "realtime.servo.deadlines",
    "servo.mailbox": "realtime.servo.ipc",
    "servo.parent": "realtime.servo.ipc",
    "servo.realtime": "realtime.servo.scheduling",
    "servo.publish": "realtime.servo.ipc",
    "servo.ring": "realtime.servo.ipc",
    "servo.rows": "realtime.servo.ipc",
    "shared_file": "realtime.shared_file",
    "sound": "runs.sound",
    "stability": "studies.stability.measure",
    "stack": "_core.stack",
    "texture.arrays": "texture.files.arrays",
    "texture.checks": "texture.files.checks",
    "texture.fillets": "texture.patterns.fillets",
    "texture.images": "texture.files.images",
    "texture.machined": "texture.patterns.machined",
    "texture.normal_maps": "texture.files.normal_maps",
    "texture.procedural": "texture.patterns.random_surfaces",
    "texture.reading": "texture.files.reading",
    "tool_motion": "runs.tool_motion",
    "trajectory": "scene.trajectory",
    "trajectory_file": "scene.trajectory_file",
    "sweeps.drags": "studies.sweeps.drag_runs",
    "sweeps.uninterrupted": "studies.sweeps.ignore_interrupts",
    "sweeps.work": "studies.sweeps.batch",
}
"""Old and new names of modules, without `asperity.`."""
NAMES = {
    "contact_stage.ContactStage": "simulation.tool_contact.ToolContact",
    "dynamics.coupling.held_body": "dynamics.virtual_coupling.settings.coupled_body",
    "dynamics.held_tool.HeldTool": "dynamics.virtual_coupling.coupled_tool.CoupledTool",
    "engine.engine.Engine": "contact.solver.ContactSolver",
    "experiments.analysis.Options": "psychophysics.analysis.analysis.AnalysisOptions",
    "experiments.design.Design": "psychophysics.design.ExperimentDesign",
    "experiments.design.design_of": "psychophysics.design.parse_design",
    "experiments.fronts.SimulatedFront": "psychophysics.interfaces.protocol.SimulatedInterface",
    "experiments.terminal.TerminalFront": "psychophysics.interfaces.terminal.TerminalInterface",
    "perception.sweep.Sweep": "studies.otaduy_lin_2004.drags.DragSimulator",
    "findings.criteria.number": "studies.otaduy_lin_2004.claims.plain",
    "findings.criteria.Top": "studies.literature.criteria.CurveMaximum",
    "findings.criteria.top_of": "studies.literature.criteria.maximum_of",
    "findings.search.Searched": "studies.literature.hand_search.SearchResult",
    "findings.search.luckiest": "studies.literature.hand_search.most_findings",
    "methods.asperity_laws.EngineMethod": "studies.baselines.asperity_laws.SolverMethod",
    "methods.asperity_laws.EngineRenderer": "studies.baselines.asperity_laws.SolverRenderer",
    "plots.level_labels": "studies.otaduy_lin_2004.figures.level_labels",
    "plots.models_figure": "studies.otaduy_lin_2004.figures.models_figure",
    "plots.rub_figure": "studies.otaduy_lin_2004.figures.rub_figure",
    "plots.study_figure": "studies.otaduy_lin_2004.figures.study_figure",
    "simulation.BUDGET_SPENT": "simulation.tool_contact.BUDGET_SPENT",
    "simulation.FLAGS": "simulation.tool_contact.FLAGS",
    "simulation.NOT_CERTIFIED": "simulation.tool_contact.NOT_CERTIFIED",
    "simulation.OVERFLOW": "simulation.tool_contact.OVERFLOW",
    "simulation.SUB_POSES": "simulation.tool_contact.SUB_POSES",
    "simulation.TOO_FAST": "simulation.tool_contact.TOO_FAST",
    "simulation.announce_compiling": "simulation.tool_contact.announce_compiling",
    "servo.parameters.Parameters": "realtime.servo.parameters.LiveParameters",
    "servo.snapshot.Moment": "realtime.servo.snapshot.Snapshot",
    "simulation.State": "simulation.simulation.ToolState",
    "sweeps.drags.Drags": "studies.sweeps.drag_runs.DragRuns",
    "findings.search.hands_of": "studies.literature.hand_search.sample_hands",
    "findings.search.measures_tried": "studies.literature.hand_search.candidate_measures",
    "findings.search.neighbours": "studies.literature.hand_search.find_neighbours",
    "findings.search.parameter": "studies.literature.hand_search.parameter_values",
    "findings.search.profile": "studies.literature.hand_search.profile_counts",
    "findings.search.interval": "studies.literature.hand_search.percentile_interval",
    "findings.search.other_conditions": "studies.literature.hand_search.draw_conditions",
    "findings.fit.published": "studies.literature.fit.read_published_fit",
    "findings.fit.chosen_of": "studies.literature.fit.chosen_design",
    "findings.table.columns_of": "studies.literature.table.make_columns",
    "findings.table.counts": "studies.literature.table.count_findings",
    "findings.laboratory.judged": "studies.literature.laboratory.judge_or_explain",
    "comparison.drive.raised": "studies.comparison.drive.raise_path",
    "comparison.drive.pressed_to": "studies.comparison.drive.find_pressing_height",
    "comparison.drive.held_still": "studies.comparison.drive.simulate_resting_hand",
    "comparison.drive.follow": "studies.comparison.drive.follow_path",
    "comparison.compare.path_of": "studies.comparison.compare.make_path",
    "methods.chosen": "studies.baselines.choose_methods",
    "methods.voxmap.voxmap": "studies.baselines.voxmap.build_voxmap",
    "methods.voxmap.pointshell": "studies.baselines.voxmap.build_pointshell",
    "methods.contact_levels.levels_of": "studies.baselines.contact_levels.build_levels",
}
"""Names that have changed, or gone elsewhere than the rest of their module."""

PUBLIC = {
    "ContactStage": "simulation.tool_contact.ToolContact",
    "DotPlate": "geometry.offsets.dots.DotPlate",
    "Engine": "contact.solver.ContactSolver",
    "Grating": "geometry.offsets.analytic.Grating",
    "Hand": "dynamics.dragged_hand.hand.Hand",
    "HandSettings": "dynamics.simulated_hand.hand.HandSettings",
    "HeightMap": "geometry.offsets.sampled.HeightMap",
    "HeldTool": "dynamics.virtual_coupling.coupled_tool.CoupledTool",
    "Limits": "realtime.devices.protocol.Limits",
    "Mapping": "realtime.devices.mapping.Mapping",
    "Motion": "dynamics.dragged_hand.hand.Motion",
    "PassivityController": "dynamics.passivity.controller.PassivityController",
    "Reading": "realtime.devices.protocol.Reading",
    "ReplayedDevice": "realtime.devices.replayed.ReplayedDevice",
    "SampledProfile": "geometry.offsets.sampled.SampledProfile",
    "ServoSpec": "realtime.servo.process.ServoSpec",
    "SimulatedDevice": "realtime.devices.simulated.SimulatedDevice",
    "SimulatedHand": "dynamics.simulated_hand.hand.SimulatedHand",
    "Sinusoid": "geometry.offsets.analytic.Sinusoid",
    "SnapshotReader": "realtime.servo.snapshot.SnapshotReader",
    "SweepStudy": "studies.sweeps.study.SweepStudy",
    "drag": "dynamics.dragged_hand.hand.drag",
    "drop_point": "geometry.offsets.surface.drop_point",
    "measure_stability": "studies.stability.measure.measure_stability",
    "offset_surface": "geometry.offsets.sampled.offset_surface",
    "open_sweep": "studies.sweeps.store.open_sweep",
    "read_recording": "runs.recording.read_recording",
    "read_study": "studies.sweeps.study.read_study",
    "run_sweep": "studies.sweeps.run.run_sweep",
    "scene_of": "scene.scene.scene_of",
    "self_affine": "texture.patterns.random_surfaces.self_affine",
}
"""Names that `asperity` itself had, and where they are now; without `asperity.`."""


def renamed(name: str) -> Any:
    """Return what `asperity.name` was until now, with a warning; None if it is not an old name."""
    if name not in PUBLIC:
        return None
    module, _, new = f"asperity.{PUBLIC[name]}".rpartition(".")
    warnings.warn(
        f"asperity.{name} is deprecated: use {module}.{new}", DeprecationWarning, stacklevel=3
    )
    return getattr(importlib.import_module(module), new)


def new_name(name: str) -> str | None:
    """Return the present name of a module that had the name `name`; None if there was none."""
    old = name.removeprefix("asperity.")
    package, _, rest = old.partition(".")
    if old in MODULES:
        return f"asperity.{MODULES[old]}"
    if package in PACKAGES:
        return f"asperity.{PACKAGES[package]}" + (f".{rest}" if rest else "")
    return None


def forwarded(old: str, new: str) -> Callable[[str], Any]:
    """Return a `__getattr__` for the module `old` that takes names from the module `new`."""

    def get(name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(f"module {old!r} has no attribute {name!r}")
        key = f"{old.removeprefix('asperity.')}.{name}"
        place = f"asperity.{NAMES[key]}" if key in NAMES else f"{new}.{name}"
        module, _, now = place.rpartition(".")
        value = getattr(importlib.import_module(module), now)
        warnings.warn(
            f"{old}.{name} has moved: use {module}.{now}", DeprecationWarning, stacklevel=2
        )
        return value

    return get


class _Finder:
    """Finds modules under their old names."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return a spec for an old name; None for all others."""
        new = new_name(name) if name.startswith("asperity.") else None
        if new is None or importlib.util.find_spec(new) is None:
            return None
        return importlib.machinery.ModuleSpec(name, self, is_package=True)  # type: ignore[arg-type]

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> None:
        """Leave making the module to Python."""

    def exec_module(self, module: ModuleType) -> None:
        """Have the module hand on what the new one has."""
        new = new_name(module.__name__)
        assert new is not None
        module.__doc__ = f"Moved to `{new}`."
        module.__dict__["__getattr__"] = forwarded(module.__name__, new)


def install() -> None:
    """Let modules be imported under their old names."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())
