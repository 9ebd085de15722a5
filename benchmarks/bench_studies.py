"""The three studies, and the hand's integrator beside scipy's solve_ivp on the same problem.

    make bench

Prints the time of the three studies at 40 spacings x 3 levels (warm), and for a set of drags the
ratio of solve_ivp's time to asperity's. The peer integrates the same equation
with the same compiled force look-up, at the loosest tolerance at which every metric is within
1e-3 of the reference (DOP853 at 1e-11), until the motion has settled: it has no way to jump there.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from asperity._core.kernels import kernel
from asperity.dynamics.dragged_hand.hand import Hand, Motion, MotionStatus, drag
from asperity.dynamics.dragged_hand.integrator import force_at, force_table
from asperity.geometry.offsets.analytic import Sinusoid
from asperity.geometry.offsets.piecewise import PiecewiseCubic
from asperity.runs.vibration_metrics import METRICS, evaluate
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import texture_force
from asperity.studies.otaduy_lin_2004.studies import FACTORS, StudySettings, run_study

ACCURACY = 1e-3
BAR = 100.0
METHODS = ("RK45", "DOP853", "LSODA")
TOLERANCES = tuple(10.0 ** (-0.5 * k) for k in range(4, 21))
CONDITIONS = [(s, v) for v in (0.042, 0.083, 0.169) for s in (0.6e-3, 1.2e-3, 2.2e-3, 3.3e-3)]
DIAMETER, FORCE, AMPLITUDE = 3e-3, 0.58, 0.1e-3


@kernel
def derivative(t, state, course, mass, stiffness, damping, speed):
    """Return (u', u'') of Eq. 7: the right-hand side that solve_ivp is given."""
    out = np.empty(2)
    out[0] = state[1]
    pull = stiffness * (speed * t - state[0]) + damping * (speed - state[1])
    out[1] = (pull - force_at(course, state[0])) / mass
    return out


def problem(table: PiecewiseCubic, hand: Hand, speed: float) -> tuple[object, ...]:
    """Return the arguments of the right-hand side; its places count from the first jump."""
    return force_table(*table[:3]), hand.mass, hand.stiffness, hand.damping, speed


def peer(
    arguments: tuple[object, ...], start: float, waited: Motion, method: str, tolerance: float
) -> Motion:
    """Integrate until the motion has settled, with solve_ivp, and return the period after."""
    speed = float(arguments[-1])  # type: ignore[arg-type]
    shift = start / speed
    times = shift + waited.settled_after + waited.step * np.arange(waited.acceleration.size)
    solution = solve_ivp(
        derivative, (shift, times[-1]), [start, speed], method=method, t_eval=times,
        args=arguments, rtol=tolerance, atol=tolerance * 1e-4,
    )  # fmt: skip
    states = solution.y
    acceleration = np.array(
        [derivative(t, y, *arguments)[1] for t, y in zip(times, states.T, strict=True)]
    )
    return waited._replace(
        place=states[0], lag=states[0] - speed * times, speed=states[1], acceleration=acceleration,
        largest=float(acceleration.max()), smallest=float(acceleration.min()),
    )  # fmt: skip


def seconds(function: Callable[[], object], repeats: int) -> float:
    """Return the median time of some calls."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def worst_error(motion: Motion, reference: Motion) -> float:
    """Return the largest relative error over all metrics."""
    return max(abs(evaluate(name, motion) / evaluate(name, reference) - 1.0) for name in METRICS)


def compare(spacing: float, speed: float) -> tuple[float, dict[str, tuple[float, float]]] | None:
    """Return asperity's time [s], and method -> (time, tolerance); None if nothing repeats."""
    hand, table = Hand(), texture_force(Sinusoid(AMPLITUDE, spacing), DIAMETER, FORCE)
    own, waited = drag(table, hand, speed), drag(table, hand, speed, extrapolate=False)
    if {own.status, waited.status} != {MotionStatus.PERIODIC}:
        return None
    # Maxima are compared as sampled at equal phase: solve_ivp gives no others.
    sampled = own._replace(
        largest=float(own.acceleration.max()), smallest=float(own.acceleration.min())
    )
    arguments = problem(table, hand, speed)
    start = float(np.mod(-table.jumps[0], table.period)) if table.jumps.size else 0.0
    reference = peer(arguments, start, waited, "DOP853", 1e-11)
    error = worst_error(sampled, reference)
    if error > ACCURACY:
        raise SystemExit(f"asperity is off by {error:.1e} at {spacing * 1e3:g} mm, {speed:g} m/s")
    mine = seconds(lambda: drag(table, hand, speed), 25)
    found = {}
    for method in METHODS:
        for tolerance in TOLERANCES:
            motion = peer(arguments, start, waited, method, tolerance)
            if worst_error(motion, reference) <= ACCURACY:
                end = start / speed + waited.settled_after + waited.duration
                took = seconds(
                    lambda m=method, t=tolerance, e=end: solve(arguments, start, e, m, t), 3
                )
                found[method] = (took, tolerance)
                break
    return mine, found


def solve(
    arguments: tuple[object, ...], start: float, end: float, method: str, tolerance: float
) -> None:
    """Do only what is timed of the peer: the integration, from rest to one settled period."""
    speed = float(arguments[-1])  # type: ignore[arg-type]
    solve_ivp(
        derivative, (start / speed, end), [start, speed], method=method, args=arguments,
        rtol=tolerance, atol=tolerance * 1e-4, t_eval=[end],
    )  # fmt: skip


def main() -> int:
    """Run the benchmark; return 1 if a bar is missed."""
    settings = StudySettings()
    for study in FACTORS:
        run_study(study, settings, peaks=False)

    def three_studies(peaks: bool) -> None:
        simulator = settings.simulator()
        for study in FACTORS:
            run_study(study, settings, simulator=simulator, peaks=peaks)

    bare = seconds(lambda: three_studies(False), 5)
    whole = seconds(lambda: three_studies(True), 3)
    print(f"three studies, {settings.spacings} spacings x 3 levels, warm: {bare:.2f} s (bar: 2 s)")
    print(f"the same with every peak refined under four metrics: {whole:.2f} s\n")
    print("ratio of solve_ivp's time to asperity's, at the loosest rtol that gives 1e-3")
    print(f"{'spacing':>8} {'speed':>9}  " + "".join(f"{m:>18}" for m in METHODS))
    own, least, totals = 0.0, [], dict.fromkeys(METHODS, 0.0)
    for spacing, speed in CONDITIONS:
        result = compare(spacing, speed)
        head = f"{spacing * 1e3:5.1f} mm {speed * 1e3:4.0f} mm/s  "
        if not result:
            print(head + "  (the motion does not repeat)")
            continue
        mine, found = result
        own += mine
        for method, (took, _) in found.items():
            totals[method] += took
        least.append(min(took for took, _ in found.values()) / mine)
        cells = [f"{found[m][0] / mine:8.0f} ({found[m][1]:.0e})" for m in METHODS]
        print(head + "".join(f"{cell:>18}" for cell in cells))
    ratios = {method: total / own for method, total in totals.items()}
    print("all together         " + "".join(f"{ratios[m]:18.0f}" for m in METHODS))
    print(
        f"\nbeside the fastest method of each drag: median {statistics.median(least):.0f}, "
        f"least {min(least):.0f}; bar, for all together: {BAR:g}"
    )
    return 0 if bare < 2.0 and min(ratios.values()) >= BAR else 1


if __name__ == "__main__":
    sys.exit(main())
