"""The paper's three studies along a line, beside the same in six directions with a simulated hand.

For each factor and level: where the metric peaks over spacing, its value there, and the largest
difference between the two over all spacings; then whether the levels come in the same order at
each spacing. `python benchmarks/bench_hand_study.py [--spacings 11] [--hands constant full]`.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from asperity.studies.otaduy_lin_2004.drags import Condition
from asperity.studies.otaduy_lin_2004.six_dof import HANDS, drag_in_scene
from asperity.studies.otaduy_lin_2004.studies import FACTORS, StudySettings

METRICS = ("max_acceleration", "band_rms")


def peak(spacing, values):
    """Return place and height of the largest value, by a parabola through it in log-log."""
    i = int(np.clip(np.argmax(values), 1, len(values) - 2))
    x, y = np.log(spacing[i - 1 : i + 2]), np.log(values[i - 1 : i + 2])
    a, b, c = np.polyfit(x - x[1], y, 2)
    at = np.clip(-0.5 * b / a, x[0] - x[1], x[2] - x[1]) if a < 0 else 0.0
    return float(np.exp(x[1] + at)), float(np.exp(a * at**2 + b * at + c))


def same_order(line, scene, least=0.05):
    """Return in how many pairs of levels, told apart by the line study, the scene agrees."""
    agree = pairs = 0
    for i in range(len(line)):
        for j in range(i):
            for a, b, c, d in zip(line[i], line[j], scene[i], scene[j], strict=True):
                if abs(np.log(a / b)) > least:
                    pairs += 1
                    agree += (a > b) == (c > d)
    return agree, pairs


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacings", type=int, default=11)
    parser.add_argument("--hands", nargs="+", choices=HANDS, default=list(HANDS))
    options = parser.parse_args()
    settings = StudySettings(spacings=options.spacings)
    spacing, simulator, known = settings.spacing_values(), settings.simulator(), {}
    start = time.perf_counter()
    for kind in options.hands:
        print(f"\nhand: {kind}")
        for study, (factor, _, unit) in FACTORS.items():
            levels = settings.levels()[study]
            for metric in METRICS:
                line, scene = [], []
                for level in levels:
                    conditions = [
                        Condition(spacing=float(s), **(settings.middle() | {factor: level}))
                        for s in spacing
                    ]
                    line.append([simulator.metric(metric, c) for c in conditions])
                    for c in conditions:
                        if (kind, c) not in known:
                            known[kind, c] = drag_in_scene(c, kind=kind)
                    scene.append([getattr(known[kind, c], metric) for c in conditions])
                for level, a, b in zip(levels, line, scene, strict=True):
                    (p, h), (q, g) = peak(spacing, np.array(a)), peak(spacing, np.array(b))
                    off = np.abs(np.log(np.array(b) / np.array(a)))
                    print(
                        f"  {study:8s} {level:8.4g} {unit:4s} {metric:17s} peak line "
                        f"{p * 1e3:5.2f} mm scene {q * 1e3:5.2f} mm; height {h:5.2f} {g:5.2f}; "
                        f"differ by {100 * np.median(off):4.1f} % median, "
                        f"{100 * off.max():5.1f} % most"
                    )
                agree, pairs = same_order(line, scene)
                print(f"  {study:8s} order of levels agrees in {agree} of {pairs} pairs")
        spread = [
            d.normal_force_deviation / d.normal_force for (k, _), d in known.items() if k == kind
        ]
        print(f"  normal force varies by {100 * np.median(spread):.1f} % (median), "
              f"{100 * max(spread):.0f} % at most")  # fmt: skip
    print(f"\n{len(known)} drags in six directions, {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
