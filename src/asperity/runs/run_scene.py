"""One run of a scene in simulated time, and what it leaves on disk."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity import __version__
from asperity._core.output import write_json
from asperity.drawing.pages import render
from asperity.drawing.renderer.contact import ContactMoment, Picture, close_picture, whole_picture
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.passivity.controller import PassivityController
from asperity.runs.recording import RecordingWriter, variables_of
from asperity.runs.skin_fields import FieldWriter
from asperity.runs.tool_taxels import ToolTaxels
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion, Trajectory
from asperity.simulation.anti_aliasing import SPAN
from asperity.simulation.simulation import Rollout, Simulation
from asperity.simulation.tool_contact import (
    BUDGET_SPENT,
    CUT_SHORT,
    FALLBACK,
    NOT_CERTIFIED,
    OVERFLOW,
    SUB_POSES,
    TOO_FAST,
)

_LINEAR = 0.2
"""Displacement over the smallest side of an elastic body above which a run has a note."""
_ROWS = 256
"""Ticks that go into the recording at once."""
_LINE = {"radius", "turning"}
_UNUSED: dict[str, set[str]] = {
    "slide": _LINE,
    "press-and-slide": _LINE,
    "circle": {"length", "turning"},
    "rotate": {"speed", "length", "direction", "radius"},
}
"""What does not matter to each kind of motion."""


@dataclass(frozen=True, eq=False)
class Run:
    """What came of a run."""

    rollout: Rollout
    moment: ContactMoment
    """When the force across the mean normal was largest."""
    summary: dict[str, Any]


def run_scene(
    scene: Scene,
    recording: Path | None,
    *,
    motion: ScriptedMotion | Trajectory | None = None,
    dt: float = 1e-3,
    hand: bool | Hand = False,
    source: str = "",
    field_rate: float = 0.0,
    on_tick: Callable[[int, Rollout], None] = lambda _, __: None,
) -> Run:
    """Move the tool along a trajectory; write the recording, if any, while it moves.

    Parameters
    ----------
    scene : Scene
    recording : Path or None
        The file to write; must not exist. None writes none.
    motion : ScriptedMotion or Trajectory, optional
        Default: the scene's own.
    dt : float
        Tick [s].
    hand : bool or Hand
        Whether a simulated hand holds the handle: it follows the trajectory through a spring and
        damper, presses with the trajectory's force, and yields to the wrench; a passivity
        controller is on. A `Hand` sets its mass, spring and damper.
    source : str
        What `load_scene` needs to load the scene again, for `replay`. Default: its name.
    field_rate : float
        Rate at which the pressure and shear of a soft body, or of a rigid tool, are recorded [Hz],
        at most that of the ticks; 0 records none.
    on_tick : callable
        Called after each tick with its number and what there is so far.
    """
    motion = scene.motion if motion is None else motion
    simulation = Simulation(scene, dt=dt)
    trajectory = simulation.trajectory(motion)
    stage = simulation.stage
    best = ContactMoment.of(0.0, trajectory.poses[0], simulation.contacts, stage.displacements)
    largest, written = -1.0, 0
    attributes = {
        "scene": scene.name, "source": source, "trajectory": trajectory.name,
        "dt": simulation.dt,
        "anti_alias": scene.anti_alias, "coupling": scene.coupling.mode,
        "hand": "simulated" if hand else "none", "version": __version__, "document": json.dumps(
            scene.document), "notes": "\n".join(scene.notes),
    }  # fmt: skip
    every = max(round(1.0 / (field_rate * simulation.dt)), 1) if field_rate > 0.0 else 0
    which = hand if isinstance(hand, Hand) else None
    held = simulation.hand(motion, hand=which) if hand else None
    controller = PassivityController(simulation.dt) if hand else None
    with ExitStack() as stack:
        writer = recording and stack.enter_context(RecordingWriter(recording, attributes))
        is_rigid = scene.soft is None
        taxels = ToolTaxels(scene, stage.engine) if writer and every and is_rigid else None
        source_of_fields = taxels or stage.engine
        fields = FieldWriter(writer.file, source_of_fields.grid) if writer and every else None

        def keep(i: int, rollout: Rollout) -> None:
            nonlocal best, largest, written
            across = _across(simulation)
            if across > largest:
                largest = across
                pose = rollout.tool_pose[i]
                best = ContactMoment.of(
                    float(rollout.time[i]), pose, simulation.contacts, stage.displacements
                )
            if writer and i + 1 - written == _ROWS:
                writer.add_rows(variables_of(rollout, slice(written, i + 1)))
                written = i + 1
            if fields and i % every == 0:
                if taxels:
                    pose, wrench = rollout.tool_pose[i], rollout.contact_wrench[i]
                    taxels.fill(pose, simulation.contacts, wrench, stage.engine.centre)
                fields.add(float(rollout.time[i]), source_of_fields.skin)
            on_tick(i, rollout)

        rollout = simulation.rollout(trajectory, hand=held, controller=controller, on_tick=keep)
        if writer:
            writer.add_rows(variables_of(rollout, slice(written, None)))
    summary = summary_of(scene, _described(motion), rollout) | {
        "coupling": _coupling(simulation),
        "hand": controller and {
            "mean_force_n": rollout.device_wrench[:, :3].mean(axis=0).tolist(),
            **controller.summary(),
        },
    }  # fmt: skip
    if scene.elastic is not None and stage.engine.strain > _LINEAR:
        summary["notes"].append(
            f"{scene.elastic.body.name} was displaced by up to {100 * stage.engine.strain:.3g} % "
            f"of its smallest side: beyond some {100 * _LINEAR:.0f} % a linear body has wrong "
            "forces; press less, or take a stiffer or thicker one"
        )
    if taxels:
        summary["notes"].append(
            "a rigid contact has no area: its pressure and shear are recorded as spread over "
            f"{2e3 * taxels.spread:.2g} mm, a choice"
        )
    if isinstance(motion, Trajectory):
        summary["notes"] += [f"{motion.name}: {note}" for note in motion.notes]
    return Run(rollout, best, summary)


def _coupling(simulation: Simulation) -> dict[str, Any]:
    """Return how the tool hung on the handle."""
    mode, gains = simulation.scene.coupling.mode, simulation.tool.gains
    if mode == "direct":
        return {"mode": mode}
    return {
        "mode": mode,
        "stiffness_n_m": gains.stiffness,
        "damping_n_s_m": gains.damping,
        "rotational_stiffness_n_m_rad": gains.rotational_stiffness,
        "tool_mass_kg": 0.0 if mode == "static" else simulation.tool.body.mass,
        "tool_put_back": simulation.tool.resets,
    }


def _across(simulation: Simulation) -> float:
    """Return the size of the contact forces across their normals [N]; -1 without contact."""
    n = simulation.contact_count
    if n == 0:
        return -1.0
    force, normal = simulation.contacts.force[:n], simulation.contacts.normal[:n]
    along = np.einsum("ij,ij->i", force, normal)
    return float(np.linalg.norm((force - along[:, None] * normal).sum(axis=0)))


def _described(motion: ScriptedMotion | Trajectory) -> dict[str, Any]:
    """Return a motion as texts and numbers."""
    if isinstance(motion, Trajectory):
        return {"kind": "poses", "file": motion.name, "seconds": motion.seconds}
    unused = _UNUSED[motion.kind] | ({"press_force"} if motion.press_depth is not None else set())
    values = dataclasses.asdict(motion)
    return {k: v for k, v in values.items() if v is not None and k not in unused}


def summary_of(scene: Scene, trajectory: dict[str, Any], rollout: Rollout) -> dict[str, Any]:
    """Return the numbers of a run, in SI units but for the times of ticks.

    Parameters
    ----------
    scene : Scene
    trajectory : dict
        What moved the handle, with its `kind`.
    rollout : Rollout
        Of one tick at least.
    """
    us = rollout.tick_seconds * 1e6
    quantiles = {"median": 50.0, "p95": 95.0, "p99": 99.0, "p999": 99.9, "max": 100.0}
    ticks = len(rollout.time)
    dt = float(rollout.time[1] - rollout.time[0]) if ticks > 1 else 1e-3
    force = np.linalg.norm(rollout.contact_wrench[:, :3], axis=1)
    torque = np.linalg.norm(rollout.contact_wrench[:, 3:], axis=1)

    def flagged(bit: int) -> int:
        return int(np.count_nonzero(rollout.flags & bit))

    return {
        "schema": 1,
        "version": __version__,
        "scene": scene.name,
        "trajectory": trajectory,
        "ticks": ticks,
        "tick_seconds": dt,
        "tick_us": {name: float(np.percentile(us, q)) for name, q in quantiles.items()},
        "status": dict(
            zip(("certified", "budget_spent", "overflow"), rollout.statuses.tolist(), strict=True)
        ),
        "contacts": {
            "ticks_in_contact": int(np.count_nonzero(rollout.contact_count)),
            "mean": float(rollout.contact_count.mean()),
            "largest": int(rollout.contact_count.max()),
        },
        "largest_force_n": float(force.max()),
        "largest_torque_n_m": float(torque.max()),
        "anti_alias": {
            "mode": scene.anti_alias,
            "delay_s": 0.5 * SPAN[scene.anti_alias] * dt,
            "ticks_active": flagged(SUB_POSES),
            "ticks_beyond_budget": flagged(BUDGET_SPENT),
            "ticks_too_fast_and_off": flagged(TOO_FAST),
        },
        "notes": [*scene.notes, *_doubts(scene, rollout, dt)],
    }


def _doubts(scene: Scene, rollout: Rollout, dt: float) -> list[str]:
    """Return what lowers the worth of a run, each with what helps."""
    moved = np.linalg.norm(np.diff(rollout.tool_pose[:, :3], axis=0), axis=1)
    flags = {
        "too_fast": TOO_FAST, "old": FALLBACK, "lost": OVERFLOW, "flat": NOT_CERTIFIED,
        "cut": CUT_SHORT,
    }  # fmt: skip
    text = render(
        "run_notes.txt", scene=scene, dt=dt, ticks=len(rollout.time),
        late=int(np.count_nonzero(rollout.tick_seconds > dt)),
        fastest=moved.max() if moved.size else None,
        certified=int(rollout.statuses[0]), depths=int(rollout.statuses.sum()),
        **{name: int(np.count_nonzero(rollout.flags & bit)) for name, bit in flags.items()},
    )  # fmt: skip
    return text.splitlines()


def take_pictures(run: Run, scene: Scene, *, rows: int = 620) -> tuple[Picture, Picture]:
    """Return pictures of the run's moment, `rows` pixels high: close, and of the whole tool."""
    return (
        close_picture(scene, run.moment, columns=rows * 38 // 31, rows=rows),
        whole_picture(scene, run.moment, columns=rows * 19 // 31, rows=rows),
    )


def write_figures(
    run: Run,
    pictures: tuple[Picture, Picture],
    folder: Path,
    *,
    prefix: str = "",
    kinds: Sequence[str] = ("png", "svg"),
) -> None:
    """Write the picture (PNG) and the plots of force, torque and spectrum."""
    from asperity.drawing import figure_style
    from asperity.runs import figures
    from asperity.runs.contact_figure import contact_figure

    title = f"{run.summary['scene']}: {described(run.summary)}"
    picture = contact_figure(*pictures, run.moment, title)
    figure_style.save(picture, folder, f"{prefix}picture", ("png",))
    for name, figure in (
        ("force", figures.force_figure),
        ("torque", figures.torque_figure),
        ("spectrum", figures.spectrum_figure),
    ):
        figure_style.save(figure(run.rollout, title), folder, prefix + name, kinds)


def write_summary(run: Run, path: Path) -> None:
    """Write the numbers of a run as JSON."""
    write_json(path, run.summary)


def described(summary: dict[str, Any]) -> str:
    """Return the trajectory of a summary in words."""
    motion = summary["trajectory"]
    kind = motion["kind"]
    if kind == "poses":
        return f"poses of {motion['file']}"
    if kind == "device":
        return f"felt with the device {motion['device']}"
    if kind == "rotate":
        return f"rotate at {motion['turning']:.3g} rad/s"
    return f"{kind} at {motion['speed'] * 1e3:.3g} mm/s"
