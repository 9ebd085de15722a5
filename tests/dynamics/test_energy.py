"""Energy at the hand: every device at its maximum stiffness, four sessions, all three scenes."""

import sys
from pathlib import Path

import pytest

from asperity.scene.builtin import load_scene
from asperity.simulation.press import touching_pose
from asperity.simulation.simulation import Simulation

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from bench_energy import DEVICES, SCENES, SESSIONS, run

WHOLE = [pytest.param(name, 0.25, marks=pytest.mark.slow) for name in SCENES]


@pytest.mark.parametrize(("name", "seconds"), [*((name, 0.1) for name in SCENES), *WHOLE])
def test_with_the_controller_nothing_is_gained_and_without_it_something_is(name, seconds):
    """Directly held, without the coupling that would be passive by itself."""
    plain = load_scene(name)
    touching = touching_pose(Simulation(plain).stage.engine, plain.start.copy())
    watched, kept = {}, {}
    for device, limits in DEVICES.items():
        scene = plain.changed(force={"stiffness": limits.max_stiffness})
        simulation = Simulation(scene.changed(coupling={"mode": "direct"}), limits=limits)
        for session in SESSIONS:
            for active, gained in ((False, watched), (True, kept)):
                controller, _ = run(simulation, touching, session, limits, seconds, active)
                gained[device, session] = controller.gained
                if active:
                    assert controller.put_in.sum() > 0.0
    assert {case: energy for case, energy in kept.items() if energy > 0.0} == {}
    # Were the sessions harmless, the controller would have had nothing to do.
    assert sum(energy > 1e-6 for energy in watched.values()) >= 6
    assert max(watched["lambda.7", session] for session in SESSIONS) > 1e-5
