"""Energy at the hand: every device at its maximum stiffness, four sessions, three scenes.

The simulated hand rests on the scene, presses and lifts, taps at 8 Hz, and slides, with the
passivity controller off and on. Printed for each: the stiffness, how much the hand had got out
beyond what it had put in (`gained`, 0 is passive) and when that was, the account at the end, the
ticks in which the controller acted, and what it took. The bar: with the controller on nothing is
gained, in any session; it exits with 1 if something is.

    python benchmarks/bench_energy.py [--seconds 0.5] [--scenes probe-plate] [--modes direct]
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from asperity.dynamics.passivity.controller import MOST_DAMPING, PassivityController
from asperity.dynamics.simulated_hand.hand import HandSettings, SimulatedHand
from asperity.realtime.devices.protocol import Limits
from asperity.scene.builtin import load_scene
from asperity.simulation.press import touching_pose
from asperity.simulation.simulation import Simulation

SCENES = ("probe-plate", "hammer-blocks", "file-cad")
MODES = ("direct", "implicit", "semi-implicit", "static")
SESSIONS = ("rest", "press", "tap", "slide")
# Software limits of public device code (DESIGN.md, section 1): N, N m, N/m, N s/m, N m/rad.
DEVICES = {
    "touch": Limits(3.3, 0.0, 400.0, 4.0),
    "omni": Limits(3.3, 0.0, 700.0, 5.0),
    "premium-1.5": Limits(8.5, 0.188, 800.0, 5.0, 0.3, torque_dof=3),
    "omega.6": Limits(12.0, 0.0, 5000.0, 30.0),
    "sigma.7": Limits(12.0, 0.2, 4000.0, 30.0, 1.0, torque_dof=3),
    "lambda.7": Limits(12.0, 0.2, 8000.0, 30.0, 1.0, torque_dof=3),
}
ABOVE, DEEP = 5e-4, 2e-3
"""Where the hand begins, and how far it aims into the scene [m]."""


def target_of(session, touching, seconds, speed=0.08):
    """Return the pose that the hand aims at, at a time."""

    def target(t):
        pose = touching.copy()
        down = ABOVE + DEEP
        if session == "rest":
            depth = down * min(t / (0.2 * seconds), 1.0)
        elif session == "press":
            depth = down * 0.5 * (1.0 - np.cos(2.0 * np.pi * min(t / seconds, 1.0)))
        elif session == "tap":
            depth = down * (0.5 - 0.5 * np.cos(2.0 * np.pi * 8.0 * t))
        else:
            depth = down * min(t / (0.2 * seconds), 1.0)
            pose[0] += speed * max(t - 0.2 * seconds, 0.0)
        pose[2] += ABOVE - depth
        return pose

    return target


def limited(wrench, limits):
    """Return a wrench as the device can give it."""
    out = wrench.copy()
    for half, most in ((slice(0, 3), limits.max_force), (slice(3, 6), limits.max_torque)):
        size = np.linalg.norm(out[half])
        out[half] *= min(1.0, most / size) if size > 0.0 else 1.0
    return out


def run(simulation, touching, session, limits, seconds, active):
    """Return the controller after a session, and when most was gained [s].

    Its account is of the wrenches sent to the device.
    """
    simulation.reset()
    hand = SimulatedHand(
        target_of(session, touching, seconds), HandSettings(), centre=simulation.tool.body.centre,
        damping=limits.damping,
    )  # fmt: skip
    most = min(MOST_DAMPING, limits.max_damping)
    controller = PassivityController(max_damping=most, active=active)
    gained, when = 0.0, 0.0
    for tick in range(round(seconds / simulation.dt)):
        wrench = simulation.step(hand.pose)
        sent = limited(controller.correct(limited(wrench, limits), simulation.port_twist), limits)
        controller.sent(sent)
        hand.advance(sent)
        if controller.gained > gained:
            gained, when = controller.gained, tick * simulation.dt
    return controller, when


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--modes", nargs="+", choices=MODES, default=["direct", "implicit"])
    parser.add_argument("--devices", nargs="+", choices=list(DEVICES), default=list(DEVICES))
    options = parser.parse_args()
    begin, worst, runs = time.perf_counter(), {False: 0.0, True: 0.0}, 0
    print(f"{'scene':14s} {'mode':9s} {'device':12s} {'session':7s} {'k N/m':>6s} | "
          f"{'off: gained uJ':>14s} {'at s':>5s} {'end uJ':>9s} | "
          f"{'on: gained uJ':>13s} {'end uJ':>9s} {'acted':>5s} {'took uJ':>8s}")  # fmt: skip
    for name in options.scenes:
        plain = load_scene(name)
        touching = touching_pose(Simulation(plain).stage.engine, plain.start.copy())
        for mode in options.modes:
            for device in options.devices:
                limits = DEVICES[device]
                scene = plain.changed(
                    coupling={"mode": mode}, force={"stiffness": limits.max_stiffness}
                )
                if mode != "direct":
                    scene = scene.changed(coupling={"stiffness": limits.max_stiffness})
                simulation = Simulation(scene, limits=limits)
                for session in SESSIONS:
                    (off, when), (on, _) = (
                        run(simulation, touching, session, limits, options.seconds, active)
                        for active in (False, True)
                    )
                    runs += 2
                    worst[False] = max(worst[False], off.gained)
                    worst[True] = max(worst[True], on.gained)
                    print(
                        f"{name:14s} {mode:9s} {device:12s} {session:7s} "
                        f"{limits.max_stiffness:6.0f} | {off.gained * 1e6:14.3f} "
                        f"{when:5.2f} {off.energy * 1e6:9.2f} | {on.gained * 1e6:13.3f} "
                        f"{on.energy * 1e6:9.2f} {on.interventions:5d} {on.dissipated * 1e6:8.2f}",
                        flush=True,
                    )
    took = time.perf_counter() - begin
    print(
        f"\n{runs} sessions of {options.seconds:g} s in {took:.0f} s; most gained: "
        f"off {worst[False] * 1e6:.3g} uJ, on {worst[True] * 1e6:.3g} uJ (bar: 0)"
    )
    sys.exit(1 if worst[True] > 0.0 else 0)


if __name__ == "__main__":
    main()
