"""A scene's tool, moved at chosen speeds and forces: the data of a vibration model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from asperity.errors import AsperityError, require_between, require_positive
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion
from asperity.simulation.simulation import Rollout, Simulation
from asperity.vibrotactile.signals import Exploration, explored, true_stretches

_STEADY = 0.02
"""How far a speed may be from its own to count as steady."""
_SETTLING = 0.1
"""At the beginning and end of a run, where filters have no past, nothing counts [s]."""


def explore(
    scene: Scene,
    speeds: Sequence[float],
    forces: Sequence[float],
    *,
    rate: float,
    seconds: float | Sequence[float],
    mass: float,
    on_tick: Callable[[int], None] = lambda _: None,
) -> list[Exploration]:
    """Return one exploration for each pair of speed and force: the steady part of a slide.

    Parameters
    ----------
    scene : Scene
        Its own motion defines the start and the line.
    speeds, forces : sequence of float
        [m/s], and pressed with at the start [N].
    rate : float
        Ticks a second [Hz].
    seconds : float or sequence of float
        Of each slide; or, one for each speed, of those at that speed, to slide as far at low speeds
        as at high ones.
    mass : float
        See `signals.explored` [kg].
    on_tick : callable
        Called with the number of ticks done since it was called last.
    """
    require_between("rate", rate, 100.0, 1e5, "Hz")
    lengths = [seconds] * len(speeds) if isinstance(seconds, int | float) else list(seconds)
    if len(lengths) != len(speeds):
        raise AsperityError(f"{len(lengths)} seconds for {len(speeds)} speeds; valid: one for each")
    for length in lengths:
        require_between("seconds", length, 0.3, 600.0, "s")
    motion = scene.motion
    if not isinstance(motion, ScriptedMotion):
        raise AsperityError(
            f"scene {scene.name!r} moves along given poses; a model needs one that slides, or "
            "recordings"
        )
    simulation = Simulation(scene, dt=1.0 / rate)
    out = []
    for (speed, length), force in product(zip(speeds, lengths, strict=True), forces):
        require_positive("speed", speed, "m/s")
        require_positive("force", force, "N")
        slide = replace(
            motion, kind="slide", speed=speed, press_force=force, press_depth=None, seconds=length
        )
        done = 0

        def count(i: int, _: Rollout) -> None:
            nonlocal done
            if i - done >= 100:
                on_tick(i - done)
                done = i

        run = simulation.rollout(slide, on_tick=count)
        on_tick(len(run.time) - done)
        name = f"{speed * 1e3:.3g} mm/s, {force:.3g} N"
        whole = explored(
            run.time, run.tool_pose, run.contact_wrench, run.contact_count, mass=mass, name=name
        )
        out.append(_steady(whole, run, speed))
    return out


def _steady(whole: Exploration, run: Rollout, speed: float) -> Exploration:
    """Return the longest stretch at the requested speed."""
    velocity = np.linalg.norm(
        np.gradient(run.tool_pose[:, :3], run.time[1] - run.time[0], axis=0)[:, :2], axis=1
    )
    room = int(_SETTLING * whole.rate)
    steady = np.abs(velocity / speed - 1.0) < _STEADY
    steady[:room], steady[len(steady) - room :] = False, False
    begin, end = max(
        zip(*true_stretches(steady), strict=True), key=lambda run: run[1] - run[0], default=(0, 0)
    )
    if end - begin < 2 * room:
        raise AsperityError(
            f"the slide at {whole.name} is steady for {(end - begin) / whole.rate:.2f} s; valid: "
            f"{2.0 * _SETTLING:g} s or more: give more seconds, or a lower speed"
        )
    return whole.part(begin, end)


def geometric_means(values: Sequence[float]) -> list[float]:
    """Return the geometric means of neighbours; of one value, that value."""
    ordered = sorted(values)
    if len(ordered) == 1:
        return ordered
    return [float(np.sqrt(a * b)) for a, b in pairwise(ordered)]
