"""The time of a full wrench on textured plates, beside an uncertified search and other engines.

    make bench
    python benchmarks/bench_contact.py [--only SECTION ...] [--json FILE]

A sphere of 3 mm is dragged at 83 mm/s over a plate, 1000 poses a second, its depth going between
20 um and 0.2 mm. Every query is timed by itself: compiled code reads the clock round it (which
takes 20 ns); a Python call is timed from Python. The same queries are repeated in several rounds,
in which all that is compared takes turns, and each query counts with its median over the rounds:
so p99 says how hard the hardest poses are, and not what else the machine was doing. Bars are
ratios of medians of one run. Times are in microseconds, one thread.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import kernel
from asperity.contact.broad_phase.mujoco_pairs import Candidates
from asperity.contact.geom_tick import tick
from asperity.contact.narrow_phase.geom_depth import (
    BodyGeoms,
    DepthQuery,
    SearchLimits,
    depth_along,
)
from asperity.contact.narrow_phase.records import PENETRATION
from asperity.contact.records import Output, Query
from asperity.contact.response.settings import ForceSettings
from asperity.contact.solver import ContactSolver
from asperity.geometry.bodies import Body, Geom
from asperity.scene.builtin import load_scene
from asperity.scene.trajectory import at_ticks
from asperity.simulation.simulation import Simulation
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.random_surfaces import self_affine
from peers import (
    FclField,
    MujocoField,
    coefficient_pyramid,
    now,
    sharper_pyramid,
    timed_uncertified,
)

RADIUS, SIDE, WAVELENGTH, AMPLITUDE = 1.5e-3, 20e-3, 2e-3, 0.1e-3
DT, SPEED = 1e-3, 0.083
SHALLOW, DEEP = 20e-6, 200e-6
SIZES, PEER_SIZES = (256, 512, 1024, 2048, 4096), (64, 256, 1024)
SURFACES = ("sinusoid", "sin x sin", "self-affine")
QUERIES, ROUNDS = 1000, 7
BLOCK = 80e-6
FLAT, TWICE = 3.0, 2.0
"""Bars: slowest to fastest size; certified to uncertified."""
SECTIONS = ("search", "tick", "peers", "paper", "first")
XML = f"""<mujoco><worldbody>
<body name="plate"><geom type="box" size="0.02 0.02 0.01" pos="0 0 -0.01"/></body>
<body name="tip" pos="0 0 0.01"><freejoint/>
<geom type="sphere" size="{RADIUS}" mass="0.01"/></body></worldbody></mujoco>"""
Times = NDArray[np.float64]


@kernel
def timed_ticks(
    model, law, starts, candidates, path, memory, space, contacts, ns_out, wrench_out, found_out
):  # fmt: skip
    """Fill time [ns], wrench (6,), and depth, gap, nodes and status of each pose of `path`."""
    stamp = np.zeros(2, np.int64)
    for q in range(len(path)):
        a, b = starts[q], starts[q + 1]
        begun = now(stamp)
        near = Candidates(
            b - a, candidates.geoms[a:b], candidates.points[a:b], candidates.distances[a:b],
            candidates.margins[a:b],
        )  # fmt: skip
        tick(model, law, Query(path[q], DT, near), memory, space, Output(contacts, wrench_out[q]))
        ns_out[q] = now(stamp) - begun
        found_out[q] = 0.0
        if contacts.count[0] > 0:
            found_out[q, 0], found_out[q, 1] = contacts.depth[0], contacts.gap[0]
            found_out[q, 2], found_out[q, 3] = contacts.nodes[0], contacts.status[0]


@kernel
def timed_depths(
    textures, geometry, geoms_a, geoms_b, path, tolerance, max_nodes, space, ns_out, depth_out
):  # fmt: skip
    """Fill time [ns] and depth of each place of `path` (n, 3): the certified search alone."""
    stamp = np.zeros(2, np.int64)
    out, guess, n = np.zeros(1, PENETRATION), np.full(3, np.nan), np.array([0.0, 0.0, 1.0])
    body_a, body_b = np.zeros((3, 4)), np.zeros((3, 4))
    for i in range(3):
        body_a[i, i] = body_b[i, i] = 1.0
    for q in range(len(path)):
        begun = now(stamp)
        for i in range(3):
            # Seen from the sphere's centre, which moves; the place stays on the plate.
            body_b[i, 3] = -path[q, i]
            guess[i] = guess[i] if q == 0 else out[0].point[i] + path[q - 1, i] - path[q, i]
        query = DepthQuery(
            BodyGeoms(geoms_a, 1, body_a, 0.0), BodyGeoms(geoms_b, 1, body_b, 0.0), n, guess
        )
        depth_along(textures, geometry, query, SearchLimits(tolerance, max_nodes), space, out)
        ns_out[q] = now(stamp) - begun
        depth_out[q] = out[0].depth


def surface(name: str, n: int) -> HeightField:
    """Return a plate's texture of n x n samples, 20 mm a side; it wraps."""
    pixel = SIDE / n
    if name == "self-affine":
        # Shorter waves the finer the map: down to 8 pixels.
        heights = self_affine((n, n), pixel, hurst=0.8, rms_slope=0.3, rolloff=WAVELENGTH)
        return HeightField(heights, pixel, "wrap")
    wave = np.sin(2.0 * math.pi / WAVELENGTH * (np.arange(n) + 0.5) * pixel)
    across = wave if name == "sin x sin" else np.ones(n)
    return HeightField(AMPLITUDE * across[:, None] * wave, pixel, "wrap")


def drag(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places (x, y) (count, 2) of a drag in straight lines, and the depth at each [m]."""
    way = SPEED * DT * np.arange(count)
    places = []
    for angle, start in ((0.37, 1.3e-3), (0.37 + 0.5 * math.pi, -2.1e-3)):
        turns = (start + way * math.cos(angle)) / 16e-3 + 0.25
        places.append(16e-3 * (np.abs(2.0 * (turns % 1.0) - 1.0) - 0.5))
    depth = 0.5 * (SHALLOW + DEEP) - 0.5 * (DEEP - SHALLOW) * np.cos(0.0437 * np.arange(count))
    return np.column_stack(places), depth


class Case:
    """A sphere on one textured plate: its engine, and a drag's poses with MuJoCo's answers."""

    def __init__(self, field: HeightField, count: int, settings: ForceSettings | None = None):
        plate = Body("plate", [Geom("box", (0.02, 0.02, 0.01), (0, 0, -0.01))], field)
        bodies = (plate, Body("tip", [Geom("sphere", (RADIUS,))]))
        model = mujoco.MjModel.from_xml_string(XML)
        self.engine = ContactSolver(model, bodies, "tip", settings)
        e = self.engine
        self._geoms = [np.flatnonzero(e._scene.geometry.body == i) for i in (1, 0)]
        self.per_metre = 1.0 / field.pixel_size[0]
        self._pyramids = coefficient_pyramid(field), sharper_pyramid(e._scene.textures)
        self.tolerance = max(1e-9, 1e-3 * field.rms)
        places, wanted = drag(count)
        self.path = np.zeros((count, 7))
        self.path[:, :2], self.path[:, 2], self.path[:, 3] = places, RADIUS, 1.0
        # Along n a tool that is lifted is less deep by just as much.
        self.path[:, 2] += self.depths(exact=True)[1] - wanted
        self.answers = answers(self.engine, self.path)

    def depths(self, exact: bool = False) -> tuple[Times, Times]:
        """Return times [us] and depths of the certified search alone."""
        e, places = self.engine, np.ascontiguousarray(self.path[:, :3])
        ns, depths = np.empty(len(places)), np.empty(len(places))
        tolerance, budget = (1e-9, 10**7) if exact else (self.tolerance, e.settings.max_nodes)
        timed_depths(
            e._scene.textures, e._scene.geometry, *self._geoms, places, tolerance, budget,
            e._space, ns, depths,
        )  # fmt: skip
        return ns * 1e-3, depths

    def ticks(self) -> tuple[Times, Times, Times]:
        """Return times [us], wrenches (n, 6) and what was found (n, 4) of compiled ticks."""
        return compiled_ticks(self.engine, self.answers, self.path)

    def uncertified(self, block: float = 0.0, sharper: bool = False) -> tuple[Times, Times]:
        """Return times [us] and depths of the uncertified search, wrench included.

        It divides down to blocks of about `block` [m], and to cells at most. `sharper`: by the
        bounds that the certified search has, and not by the spline's coefficients.
        """
        finest = max(round(math.log2(max(block * self.per_metre, 1.0))), 0)
        ns, depths = np.empty(len(self.path)), np.empty(len(self.path))
        centres, wrenches = np.ascontiguousarray(self.path[:, :3]), np.empty((len(self.path), 6))
        timed_uncertified(
            self.engine._scene.textures,
            *self._pyramids[sharper],
            RADIUS,
            400.0,
            finest,
            centres,
            ns,
            depths,
            wrenches,
        )
        return ns * 1e-3, depths

    def calls(self) -> Times:
        """Return times [us] of the Python call."""
        self.engine.reset()
        return timed(lambda pose: self.engine.wrench(pose, DT), self.path)


def answers(
    engine: ContactSolver, path: NDArray[np.float64]
) -> tuple[NDArray[np.int64], Candidates]:
    """Return where MuJoCo's answer to each pose begins, and the answers to all in a row."""
    parts = []
    for pose in path:
        count, *found = engine.candidates(pose)
        parts.append(tuple(np.array(part[:count]) for part in found))
    starts = np.cumsum([0, *(len(part[2]) for part in parts)])
    rows = [np.concatenate([part[i] for part in parts]) for i in range(4)]
    return starts, Candidates(int(starts[-1]), *rows)


def compiled_ticks(
    e: ContactSolver, answers: tuple[NDArray[np.int64], Candidates], path: NDArray[np.float64]
) -> tuple[Times, Times, Times]:
    """Return times [us], wrenches and what was found of ticks in compiled code."""
    ns, wrench, found = np.empty(len(path)), np.empty((len(path), 6)), np.empty((len(path), 4))
    e.reset()
    timed_ticks(
        e._model, e._law, *answers, path, e._memory, e._space, e.contacts, ns, wrench, found
    )
    return ns * 1e-3, wrench, found


def timed(call: Callable[[Any], object], arguments: Sequence[Any]) -> Times:
    """Return how long each call takes [us]."""
    clock, out = time.perf_counter_ns, np.empty(len(arguments))
    for i, argument in enumerate(arguments):
        begun = clock()
        call(argument)
        out[i] = clock() - begun
    return out * 1e-3


def each(rounds: Sequence[Times]) -> Times:
    """Return the median over rounds of every query's time."""
    return np.median(rounds, axis=0)


def summary(times: Times) -> dict[str, float]:
    """Return median and p99."""
    return {"median": float(np.median(times)), "p99": float(np.percentile(times, 99))}


def cell(times: dict[str, float]) -> str:
    """Return "median (p99)"."""
    digits = 1 if times["median"] < 100.0 else 0
    return f"{times['median']:.{digits}f} ({times['p99']:.{digits}f})"


def row(name: str, cells: Sequence[str]) -> None:
    """Print a line of a table."""
    print(f"  {name:<34}" + "".join(f"{c:>16}" for c in cells), flush=True)


def bar(name: str, value: float, most: float, bars: list[dict[str, Any]]) -> str:
    """Note a bar; return how it stands."""
    bars.append({"bar": name, "value": value, "most": most, "held": value <= most})
    return f"{'held' if value <= most else 'NOT held'}: {name} {value:.2f} (bar: at most {most:g})"


def search(bars: list[dict[str, Any]]) -> dict[str, Any]:
    """Full wrenches over sizes, beside the uncertified search."""
    print("\n1. Full wrench of a sphere on a plate: median (p99) of us a query")
    print("   certified: every depth proved to max(1 nm, 1e-3 rms height); uncertified: a pyramid")
    print("   of coefficients down to cells, or to 80 um blocks, and Newton's method (peers.py);")
    print("   with sharper bounds: the pyramid that the certified search has, lent to it")
    return {name: search_on(name, bars) for name in SURFACES}


def search_on(name: str, bars: list[dict[str, Any]]) -> dict[str, Any]:
    """Do one surface at all sizes; the sizes take turns."""
    cases = [Case(surface(name, n), QUERIES) for n in SIZES]
    ways: dict[str, Callable[[Case], Times]] = {
        "certified, full wrench, compiled": lambda case: case.ticks()[0],
        "  of it the certified search": lambda case: case.depths()[0],
        "uncertified, to cells": lambda case: case.uncertified()[0],
        "uncertified, to blocks": lambda case: case.uncertified(BLOCK)[0],
        "  with sharper bounds, cells": lambda case: case.uncertified(0.0, True)[0],
        "  with sharper bounds, blocks": lambda case: case.uncertified(BLOCK, True)[0],
        "ContactSolver.wrench from Python": Case.calls,
    }
    full, _, cells, blocks, sharp_cells, sharp_blocks, _ = ways
    laps: dict[str, list[list[Times]]] = {way: [[] for _ in SIZES] for way in ways}
    for lap in range(ROUNDS + 1):
        for i, case in enumerate(cases):
            for way, do in ways.items():
                times = do(case)
                # The first lap compiles.
                if lap > 0:
                    laps[way][i].append(times)
    times = {way: [summary(each(lap)) for lap in column] for way, column in laps.items()}
    print()
    row(name, [f"{n}^2" for n in SIZES])
    for way in ways:
        row(way, [cell(t) for t in times[way]])
    medians = {way: np.array([t["median"] for t in column]) for way, column in times.items()}
    ratios = {
        way: medians[full] / medians[way] for way in (cells, blocks, sharp_cells, sharp_blocks)
    }
    for way in ratios:
        row(f"ratio to {way}", [f"{r:.2f}" for r in ratios[way]])
    figures = {"sizes": SIZES, "times_us": times, **what_was_found(cases)}
    figures["ratios"] = {way: ratio.tolist() for way, ratio in ratios.items()}
    worst = float(np.maximum(ratios[cells], ratios[blocks]).max())
    flat = figures["slowest_to_fastest"] = float(medians[full].max() / medians[full].min())
    if name != "self-affine":
        print("  " + bar(f"{name}: slowest size to fastest", flat, FLAT, bars))
        print("  " + bar(f"{name}: certified to the faster uncertified", worst, TWICE, bars))
    aim = "50 us" if name == "self-affine" else "10 us, 20 us at most"
    print(f"  slowest median {medians[full].max():.1f} us on this machine (aim: {aim})")
    return figures


def what_was_found(cases: Sequence[Case]) -> dict[str, Any]:
    """Print and return how much work the searches were, and what they left open or missed."""
    found = [case.ticks()[2] for case in cases]
    exact = [case.depths(exact=True)[1] for case in cases]
    nodes = [summary(f[:, 2]) for f in found]
    row("boxes looked at, median (p99)", [f"{n['median']:.0f} ({n['p99']:.0f})" for n in nodes])
    gaps = [float(f[:, 1].max()) for f in found]
    row("largest gap between bounds [nm]", [f"{gap * 1e9:.3f}" for gap in gaps])
    not_certified = [int(np.sum(f[:, 3] != 0.0)) for f in found]
    row(f"not certified, of {QUERIES}", [str(n) for n in not_certified])
    # What the tick says, beside the same search run to a nanometre without a budget.
    off = [float(np.abs(f[:, 0] - d).max()) for f, d in zip(found, exact, strict=True)]
    row("tick's depth off by at most [nm]", [f"{x * 1e9:.3f}" for x in off])
    figures: dict[str, Any] = {
        "boxes": nodes, "gap_m": gaps, "not_certified": not_certified, "tick_off_m": off,
    }  # fmt: skip
    for way, block in (("to cells", 0.0), ("to blocks", BLOCK)):
        short = [d - case.uncertified(block)[1] for d, case in zip(exact, cases, strict=True)]
        row(f"missed by > 1 nm, {way} (worst)", [
            f"{np.sum(s > 1e-9)} ({s.max() * 1e6:.2g} um)" if s.max() > 1e-9 else "0"
            for s in short
        ])  # fmt: skip
        if min(s.min() for s in short) < -1.1e-9:
            deeper = max(-s.min() for s in short)
            print(f"  WRONG: a certified depth is {deeper * 1e9:.1f} nm less than one found {way}")
        figures[f"missed {way}"] = [int(np.sum(s > 1e-9)) for s in short]
        figures[f"worst miss {way} [m]"] = [float(s.max()) for s in short]
    return figures


def tick_parts(bars: list[dict[str, Any]]) -> dict[str, Any]:
    """What a tick of the built-in scene consists of."""
    scene = load_scene("probe-plate")
    simulations = {mode: Simulation(scene.changed(force={"anti_alias": mode}))
                   for mode in ("off", "tick")}  # fmt: skip
    plain = simulations["off"]
    path = np.asarray(at_ticks(plain.trajectory(), DT), dtype=np.float64)[:QUERIES]
    e = plain.stage.engine
    collider = e._collider
    prepared = answers(collider, path)
    starts, (_, *rows) = prepared
    parts = [Candidates(int(b - a), *(part[a:b] for part in rows)) for a, b in pairwise(starts)]

    def kernel_call(q: int) -> None:
        tick(e._model, e._law, Query(path[q], DT, parts[q]), e._memory, e._space, e._out)

    laps: dict[str, list[Times]] = {}
    for _ in range(ROUNDS):
        for key, call in (
            ("tick, compiled", lambda: compiled_ticks(e, prepared, path)[0]),
            ("MuJoCo's query, from Python", lambda: timed(collider.query, path)),
            ("tick, called from Python", lambda: timed(kernel_call, range(len(path)))),
            ("ContactSolver.wrench", lambda: timed(lambda pose: e.wrench(pose, DT), path)),
            ("Simulation.step, no anti-alias", lambda: timed(plain.step, path)),
            ("Simulation.step, anti-alias", lambda: timed(simulations["tick"].step, path)),
        ):
            e.reset()
            laps.setdefault(key, []).append(call())
    print("\n2. A tick of the scene probe-plate: median (p99) of us")
    times = {key: summary(each(lap)) for key, lap in laps.items()}
    for key, value in times.items():
        row(key, [cell(value)])
    return times


def peers(bars: list[dict[str, Any]]) -> dict[str, Any]:
    """MuJoCo's height field and python-fcl on the same samples, with their errors."""
    print("\n3. Peers on the same samples, Python calls: median (p99) of us a query;")
    print("   |error| of the depth along z against the certified one, median and worst, um;")
    print("   MuJoCo keeps 50 contacts, fcl is asked for 1000; the centre's distance: spheres only")
    out = {}
    for name in ("sin x sin", "self-affine"):
        fields = [surface(name, n) for n in PEER_SIZES]
        cases = [Case(field, 200) for field in fields]
        print()
        row(name, [f"{n}^2" for n in PEER_SIZES])
        laps = [[case.calls() for _ in range(3)] for case in cases]
        own = [summary(each(lap)) for lap in laps]
        row("asperity, ContactSolver.wrench (6-DoF)", [cell(t) for t in own])
        out[name] = {"asperity": own}
        for label, make in (
            ("MuJoCo hfield", MujocoField),
            ("python-fcl, all contacts", FclField),
            ("python-fcl, distance of centre", lambda f, r: FclField(f, r, by="distance")),
        ):
            try:
                found = [one_peer(make, f, c) for f, c in zip(fields, cases, strict=True)]
            except ImportError as error:
                print(f"  {label}: not installed ({error}); left out")
                continue
            row(label, [cell(t) for t in found])
            row("  error of depth, median / worst", [
                f"{t['error_median'] * 1e6:.1f} / {t['error_worst'] * 1e6:.0f}" for t in found
            ])  # fmt: skip
            row("  time : asperity's", [
                f"{t['median'] / o['median']:.1f}" for t, o in zip(found, own, strict=True)
            ])  # fmt: skip
            out[name][label] = found
    return out


def one_peer(make: Callable[..., Any], field: HeightField, case: Case) -> dict[str, float]:
    """Return a peer's times and errors on a case."""
    peer, centres = make(field, RADIUS), np.ascontiguousarray(case.path[:, :3])
    laps = [timed(peer.query, centres)]
    if np.median(laps[0]) < 2e3:
        laps += [timed(peer.query, centres) for _ in range(2)]
    exact = case.depths(exact=True)[1]
    error = np.array([peer.depth(c) for c in centres]) - exact
    # No contact at all is an error of the whole depth.
    error = np.abs(np.where(np.isnan(error), exact, error))
    return {
        **summary(each(laps)), "error_median": float(np.median(error)),
        "error_worst": float(error.max()),
    }  # fmt: skip


def paper(bars: list[dict[str, Any]]) -> dict[str, Any]:
    """The paper's eleven depths on a 50^2 grid, beside the exact gradient."""
    print("\n4. The paper's method (50^2 grid over 4 mm, eleven depths) at 1024^2")
    out = {}
    row("", ["exact us", "paper us", "ratio", "force off by", "worst"])
    for name in SURFACES:
        field = surface(name, 1024)
        exact = Case(field, 100)
        other = Case(field, 100, ForceSettings(gradient="differences", grid=50))
        laps = [(exact.ticks()[0], other.ticks()[0]) for _ in range(3)]
        times = [summary(each(lap)) for lap in zip(*laps, strict=True)]
        force, theirs = exact.ticks()[1][:, :3], other.ticks()[1][:, :3]
        error = np.linalg.norm(theirs - force, axis=1) / np.linalg.norm(force, axis=1)
        ratio = times[1]["median"] / times[0]["median"]
        row(name, [
            *(cell(t) for t in times), f"{ratio:.0f}", f"{np.median(error):.1%}",
            f"{error.max():.1%}",
        ])  # fmt: skip
        out[name] = {
            "exact_us": times[0], "paper_us": times[1], "ratio": ratio,
            "force_error_median": float(np.median(error)), "force_error_worst": float(error.max()),
        }  # fmt: skip
    return out


FIRST = """
import sys, time
begun = time.perf_counter()
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation
simulation = Simulation(load_scene("probe-plate"))
pose = simulation.scene.start.copy()
pose[2] -= 2e-4
force = simulation.step(pose)[2]
print(time.perf_counter() - begun, time.process_time(), force,
      *[m for m in ("matplotlib", "trimesh", "viser", "scipy.optimize") if m in sys.modules])
"""


def first(bars: list[dict[str, Any]]) -> dict[str, Any]:
    """From import to the first force, before and after compilation."""
    print("\n5. From import to the first force of probe-plate, seconds in a fresh process")
    out = {}
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "NUMBA_CACHE_DIR": str(Path(folder) / "fresh")}
        # The package that runs here is the one to be measured.
        env["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
        for label, aim, times in (("compiling", 30.0, 1), ("from the cache", 2.0, 3)):
            took, worked = [], []
            for _ in range(times):
                done = subprocess.run(
                    [sys.executable, "-c", FIRST], env=env, capture_output=True, text=True,
                    check=True,
                )  # fmt: skip
                seconds, work, force, *modules = done.stdout.split()
                took.append(float(seconds))
                worked.append(float(work))
            loaded = f"; also imported: {', '.join(modules)}" if modules else ""
            cpu = float(np.median(worked))
            print(
                f"  {label:<16} {np.median(took):6.2f} s, {cpu:.2f} s of them at work on a core "
                f"(aim: {aim:g} s); force {float(force):.3f} N{loaded}"
            )
            out[label] = {"seconds": float(np.median(took)), "cpu": cpu, "modules": modules}
    return out


def main() -> int:
    """Run the benchmark; return 1 if a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=SECTIONS)
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    options = parser.parse_args()
    begun, bars = time.perf_counter(), []
    run = {"search": search, "tick": tick_parts, "peers": peers, "paper": paper, "first": first}
    figures: dict[str, Any] = {name: run[name](bars) for name in SECTIONS if name in options.only}
    print()
    for b in bars:
        state = "held    " if b["held"] else "NOT held"
        print(f"{state}  {b['bar']}: {b['value']:.2f} (bar: at most {b['most']:g})")
    print(f"all of it took {time.perf_counter() - begun:.0f} s")
    if options.json:
        figures |= {"bars": bars, "seconds": time.perf_counter() - begun, "threads": 1}
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    return 0 if all(b["held"] for b in bars) else 1


if __name__ == "__main__":
    sys.exit(main())
