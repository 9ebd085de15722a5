"""The page at 30 updates a second, with a tab that drags the tool, and what that costs the loop.

    make bench
    python benchmarks/bench_page.py [--scene probe-plate] [--blocks 4] [--seconds 4] [--json FILE]

A servo runs with the mouse's hand going round in a circle, pressed. In turn nobody looks, and a
page with a scripted tab does (`page_client.ScriptedTab`), which turns the tool's gizmo to and fro
60 times a second, so that the motion is its own. Told are updates of the tool that reached the tab,
a second, and the loop's misses and fallbacks with the tab less those without, in percentage points.
The bar is that of the servo, 0.1 points, and is meant for a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from asperity.scene.builtin import load_scene
from asperity.viewer.app import live_panels
from asperity.viewer.changes import on_coupling
from asperity.viewer.drawables.stage import UNITS
from asperity.viewer.motions import CannedMotion
from asperity.viewer.server.pace import UPDATE_RATE
from asperity.viewer.server.server import Page, serve
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.session_config import SessionConfig
from page_client import ScriptedTab

BAR = 0.1
"""Percentage points."""


def counts(servo: ServoClient) -> np.ndarray:
    """Return ticks that were due, misses, fallbacks so far."""
    snapshot = servo.latest()
    assert snapshot is not None
    return np.array([round(snapshot.time * 1000.0), snapshot.misses, snapshot.fallbacks])


def alone(servo: ServoClient, seconds: float) -> np.ndarray:
    """Let the hand go round with nobody looking; return the counts."""
    servo.move(CannedMotion("circle", 0.03, 0.01), press=0.6)
    time.sleep(1.0)
    before = counts(servo)
    time.sleep(seconds)
    return counts(servo) - before


def looked_at(servo: ServoClient, seconds: float) -> tuple[np.ndarray, float]:
    """Let a tab drag the tool round; return the counts, and updates a second."""
    with serve(servo, lambda: live_panels(), port=0) as page, ScriptedTab(page.url) as tab:
        time.sleep(2.0)
        before, seen, begun = counts(servo), len(tab.updates), time.perf_counter()
        dragged(page, tab, servo, seconds)
        lasted = time.perf_counter() - begun
        return counts(servo) - before, (len(tab.updates) - seen) / lasted


def dragged(page: Page, tab: ScriptedTab, servo: ServoClient, seconds: float) -> None:
    """Drag the gizmo round the circle that the hand goes round otherwise, pressed in."""
    gizmo = page.server.scene.get_handle_by_name("/gizmo")
    assert gizmo is not None
    middle = np.array(gizmo.position)
    middle[2] -= UNITS * (servo.target[2] - servo.config.first_pose[2] + 6e-3)
    begun, due = time.perf_counter(), 0.0
    while due < seconds:
        angle = 0.03 / 0.005 * due
        tab.drag("/gizmo", middle + 0.005 * UNITS * np.array([np.sin(angle), np.cos(angle), 0.0]))
        due += 1.0 / 60.0
        time.sleep(max(begun + due - time.perf_counter(), 0.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="probe-plate")
    parser.add_argument("--blocks", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=4.0, help="of each block")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    config = SessionConfig(on_coupling(load_scene(given.scene)), given.scene)
    sums = {"alone": np.zeros(3), "looked at": np.zeros(3)}
    rates = []
    with ServoClient(config) as servo:
        for _ in range(given.blocks):
            servo.point(config.first_pose)
            sums["alone"] += alone(servo, given.seconds)
            servo.point(config.first_pose)
            more, rate = looked_at(servo, given.seconds)
            sums["looked at"] += more
            rates.append(rate)
    shares = {name: 100.0 * (n[1] + n[2]) / n[0] for name, n in sums.items()}
    added = shares["looked at"] - shares["alone"]
    print(
        f"{given.scene}: {np.median(rates):.1f} updates a second reached the tab (of "
        f"{UPDATE_RATE:.0f}); misses and fallbacks {shares['alone']:.2f} % alone, "
        f"{shares['looked at']:.2f} % looked at: {added:+.2f} points "
        f"(bar {BAR}: {'met' if added <= BAR else 'MISSED'})"
    )
    if given.json:
        message: dict[str, Any] = {"updates": rates, "percent": shares, "added_points": added}
        given.json.write_text(json.dumps(message, indent=2))


if __name__ == "__main__":
    main()
