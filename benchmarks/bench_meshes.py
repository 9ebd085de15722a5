"""The time of a whole tick where meshes touch, beside the paper's method and python-fcl.

    make bench
    python benchmarks/bench_meshes.py [--only SECTION ...] [--quick] [--json FILE] [--figure FILE]

The paper's two hard scenes, a hammer on striped blocks and a file on a machined part, are run
tick by tick in eight stretches of their own paths, and of three perturbed ones at depths of 0.2 to
1 mm; then other tools, whose triangles or contacts grow in number. A tick is `ContactSolver.wrench`
from Python, MuJoCo's query included. All is repeated in three rounds, in which all that is compared
takes turns, and each pose counts with its median over the rounds: see `bench_contact.py`. For the
inputs of the paper's method and of python-fcl: see `mesh_cases.py`. Bars are ratios of medians of
one run, at the same poses. Times are in microseconds, one thread.

One bar is a time: the tick's p99.9 on a scene's own path, which has 15 rounds. Beside it stand
what the same ticks take *left alone*, each pose with its least over the rounds (what is above that
is the machine's, others at work on it or in its caches), and *all rounds*, every single tick. All
these are without anti-aliasing, one evaluation a tick; *as shipped* is `Simulation.step` with the
scene's own settings, which averages over sub-poses where the texture is faster than the tick and
while there is time.

Printed too is the *work round a closed path*: one round of 12 mm by 8 mm on each scene, tilting and
pressing as it goes, without friction. The wrench is the gradient of a potential for one patch and
one n; where patches share a body and n turns, it need not be, and this says by how much: what is
gained or lost in a round, over the sum of the sizes of all that is given and taken.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.contact.solver import ContactSolver
from asperity.geometry.poses import rotated, rotation_between
from asperity.scene.builtin import load_scene
from asperity.scene.scene import Scene
from asperity.simulation.simulation import Simulation
from mesh_cases import (
    DT,
    FULL_DETAIL,
    LEAD,
    SEGMENTS,
    FclPair,
    Growing,
    Paper,
    Where,
    ball,
    blocks,
    bumps,
    contact_of,
    dragged,
    families,
    feet,
    full_detail,
    pressed,
    rotation,
    stretches,
)

SCENES = ("hammer-blocks", "file-cad")
SECTIONS = ("scenes", "paper", "fcl", "triangles", "contacts")
PAIRS, EVERY, MOST_LOOKED = 300, 100_000, 96
"""Pairs of triangles that python-fcl has to report, and what it is asked for besides: all; and
at how many poses of a path it is seen how many there are."""
FLOOR, AIM = 3.0, 20.0
"""python-fcl's time over asperity's: the bar, and what is aimed at."""
SHALLOW, DEEP = 2e-4, 1e-3
FLOOR_US, AIM_US = 800.0, 200.0
"""What the p99.9 of a tick on a scene's own path is to stay under, where the paper had 5 to 10 ms;
and what is aimed at for the median."""
OWN_ROUNDS = 15
TURNS = 7
"""Of python-fcl and asperity, where they are timed beside each other."""
TOO_LONG = 1e5
"""A tool whose tick takes longer [us] does not grow further."""
Times = NDArray[np.float64]


class Effort(NamedTuple):
    """How much is done: what a whole run takes, and a quick look."""

    own: float
    """For a scene's own path [s]; the number of poses follows, of those in `COUNTS`."""
    perturbed: float
    growing: float
    beside: int
    """Poses of a path at which the paper's method and python-fcl are run."""
    triangles: dict[str, tuple[int, ...]]
    contacts: tuple[int, ...]
    detail: float
    """Part of the triangles of full detail."""
    rounds: int


COUNTS = (24, 48, 96, 200, 400, 1000, 2000)
WHOLE = Effort(
    8.0, 3.0, 1.0, 24, {"ball": (1, 2, 3, 4, 5, 6), "bumps": (7, 16, 40, 100, 224)},
    (1, 2, 4, 8, 16, 32, 64), 1.0, 3,
)  # fmt: skip
QUICK = Effort(0.0, 0.0, 0.3, 6, {"ball": (2, 4), "bumps": (7, 40)}, (1, 16), 0.1, 1)
SERIES: dict[str, tuple[str, Callable[[int], Growing]]] = {
    "ball": ("ball on a plate", ball),
    "bumps": ("bumps on bumps", bumps),
    "feet": ("one tool's feet on a plate", feet),
    "blocks": ("blocks, each a body", blocks),
}


class Ticks(NamedTuple):
    """What was measured on a path; rows are poses."""

    microseconds: Times
    least: Times
    """Of all rounds."""
    every: Times
    """Of all ticks of all rounds, one after the other."""
    patches: NDArray[np.int64]
    bodies: NDArray[np.int64]
    certified: NDArray[np.int64]
    gap: Times
    nodes: Times
    deepest: Times
    no_room: NDArray[np.bool_]
    """Whether there was no room for all contacts or pairs of facets."""
    where: list[Where | None]


def ticks(
    engine: ContactSolver,
    path: Sequence[NDArray[np.float64]],
    rounds: int,
    lead: Sequence[float] = (0.0,),
) -> Ticks:
    """Time the engine on stretches of poses; the first of each, from above, only leads in.

    `lead` are heights above the first pose [m], a tick each.
    """
    clock, laps, notes, where = time.perf_counter_ns, [], [], []
    for lap in range(rounds + 1):
        ns = []
        for stretch in path:
            engine.reset()
            for above in lead:
                pose = stretch[0].copy()
                pose[2] += above
                engine.wrench(pose, DT)
            for pose in stretch[1:]:
                begun = clock()
                engine.wrench(pose, DT)
                ns.append(clock() - begun)
                # The first lap only notes what is found.
                if lap == 0:
                    notes.append(_noted(engine))
                    where.append(contact_of(engine, pose))
        if lap > 0:
            laps.append(ns)
    columns = [np.array(column) for column in zip(*notes, strict=True)]
    times, least = np.median(laps, axis=0) * 1e-3, np.min(laps, axis=0) * 1e-3
    return Ticks(times, least, np.ravel(laps) * 1e-3, *columns, where)


def _noted(engine: ContactSolver) -> tuple[int, int, int, float, float, float, bool]:
    c = engine.contacts
    k = c.count[0]
    # Patches whose deepest places are one place were searched once.
    searches = {(c.depth[i], c.gap[i], c.nodes[i]) for i in range(k)}
    return (
        k,
        len(set(c.body[:k].tolist())),
        int(np.sum(c.status[:k] == 0)),
        float(c.gap[:k].max(initial=0.0)),
        float(sum(nodes for _, _, nodes in searches)),
        float(c.depth[:k].max(initial=0.0)),
        # Where nothing is left of a contact there is none whose status could say so.
        bool((c.status[:k] == 2).any() or engine._mesh.space.manifold.count["dropped"][0] > 0),
    )


def spread(times: Times) -> dict[str, float]:
    """Return median, p95, p99, p99.9 and max."""
    levels = {"median": 50.0, "p95": 95.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}
    return {name: float(np.percentile(times, level)) for name, level in levels.items()}


def found(done: Ticks) -> dict[str, Any]:
    """Return what the searches came to."""
    total = int(done.patches.sum())
    return {
        "poses": len(done.microseconds),
        "patches": int(np.median(done.patches)),
        "bodies": int(np.median(done.bodies)),
        "certified": float(done.certified.sum() / total) if total else None,
        "gap_m": float(done.gap.max()),
        "nodes": float(np.median(done.nodes)),
        "nodes_max": float(done.nodes.max()),
        "deepest_m": float(done.deepest.max()),
        "no_room": int(done.no_room.sum()),
        "without_contact": int(np.sum(done.patches == 0)),
    }


def affordable(
    engine: ContactSolver, path: Sequence[NDArray[np.float64]], seconds: float, rounds: int
) -> int:
    """Return how many poses can be timed in so long, from what a few of them take."""
    begun, few = time.perf_counter(), 0
    for stretch in path:
        engine.reset()
        for pose in stretch[:4]:
            engine.wrench(pose, DT)
            few += 1
    each = (time.perf_counter() - begun) / few * (rounds + 1)
    return max([n for n in COUNTS if n * each <= seconds], default=COUNTS[0])


def row(name: str, cells: Sequence[str], width: int = 11) -> None:
    """Print a line of a table."""
    print(f"  {name:<28}" + "".join(f"{c:>{width}}" for c in cells), flush=True)


def micro(value: float) -> str:
    """Return microseconds as they are printed."""
    return f"{value:.1f}" if value < 100.0 else f"{value:.0f}"


HEAD = [
    "poses", "median", "p95", "p99", "p99.9", "max", "patches", "bodies", "certif.", "gap um",
    "nodes", "(max)", "mm deep", "no room",
]  # fmt: skip


def print_path(name: str, times: dict[str, float], what: dict[str, Any]) -> None:
    """Print the line of a path."""
    certified = "-" if what["certified"] is None else f"{what['certified']:.1%}"
    row(name, [
        str(what["poses"]), *(micro(t) for t in times.values()), str(what["patches"]),
        str(what["bodies"]),
        certified, f"{1e6 * what['gap_m']:.3g}", f"{what['nodes']:.0f}",
        f"{what['nodes_max']:.0f}", f"{1e3 * what['deepest_m']:.2f}", str(what["no_room"]),
    ], 9)  # fmt: skip


def scenes(effort: Effort, only: Sequence[str], bars: list[dict[str, Any]]) -> dict[str, Any]:
    """The two scenes, beside the paper's method and python-fcl."""
    return {name: one_scene(name, effort, only, bars) for name in SCENES}


def one_scene(
    name: str, effort: Effort, only: Sequence[str], bars: list[dict[str, Any]]
) -> dict[str, Any]:
    """Do one scene."""
    scene = load_scene(name).changed(force={"anti_alias": "off"})
    simulation = Simulation(scene)
    engine = simulation.stage.engine
    print(f"\n{name}: us a tick, ContactSolver.wrench with MuJoCo's query")
    row("", HEAD, 9)
    out: dict[str, Any] = {"paths": {}}
    done: dict[str, Ticks] = {}
    again: dict[str, Callable[[], Ticks]] = {}
    for path_name, path in families(scene, simulation).items():
        own = path_name == "own path"
        timed = _timed_part(engine, path, effort, own)
        lead = (0.0,) if own else LEAD
        rounds = OWN_ROUNDS if own and effort.rounds > 1 else effort.rounds
        done[path_name] = ticks(engine, timed, rounds, lead)
        again[path_name] = functools.partial(ticks, engine, timed, 1, lead)
        times, what = spread(done[path_name].microseconds), found(done[path_name])
        print_path(path_name, times, what)
        out["paths"][path_name] = {"tick_us": times, **what}
        if own:
            alone = out["paths"][path_name]["alone_us"] = spread(done[path_name].least)
            row("  left alone", ["", *(micro(t) for t in alone.values())], 9)
            every = out["paths"][path_name]["every_us"] = spread(done[path_name].every)
            row("  all rounds", ["", *(micro(t) for t in every.values())], 9)
            out["as_shipped_us"] = as_shipped(name, timed)
            bars.append({
                "bar": f"{name}: p99.9 of its own path [us]; {alone['p99.9']:.0f} left alone; "
                f"median {times['median']:.0f}, aim {AIM_US:.0f}",
                "value": times["p99.9"], "most": FLOOR_US, "held": times["p99.9"] <= FLOOR_US,
            })  # fmt: skip
    poses = [w.pose for t in done.values() for w in t.where if w]
    query = _query_times(engine, poses, effort.rounds)
    print(f"  of it MuJoCo's query {micro(query['median'])}, p99 {micro(query['p99'])}")
    out["query_us"] = query
    net, gross = out["work_j"] = round_a_path(scene)
    print(
        f"  work round a closed path: net {1e6 * net:+.3g} uJ of {1e6 * gross:.3g} uJ given and "
        f"taken ({abs(net) / gross:.1%})"
    )
    if "paper" in only:
        beside_paper(engine, done, effort, out)
    if "fcl" in only:
        try:
            beside_fcl(name, scene, engine, done, again, effort, out, bars)
        except ImportError as error:
            print(f"  python-fcl: not installed ({error})")
            bars.append(_no_ratio(name))
    return out


def as_shipped(name: str, path: Sequence[NDArray[np.float64]]) -> dict[str, float]:
    """Time whole ticks of a scene with its own settings; print and return their spread [us]."""
    clock, laps = time.perf_counter_ns, []
    simulation = Simulation(load_scene(name))
    for _ in range(OWN_ROUNDS):
        ns = []
        for stretch in path:
            simulation.reset()
            simulation.step(stretch[0])
            for pose in stretch[1:]:
                begun = clock()
                simulation.step(pose)
                ns.append(clock() - begun)
        laps.append(ns)
    # The first round compiles what is not compiled yet.
    times = spread(np.median(laps[1:], axis=0) * 1e-3)
    row("  as shipped", ["", *(micro(t) for t in times.values())], 9)
    return times


def round_a_path(scene: Scene, count: int = 3000) -> tuple[float, float]:
    """Return what one round of a closed path gives, and the sum of sizes of all its parts [J]."""
    simulation = Simulation(scene.changed(force={"friction": 0.0}))
    engine, own = simulation.stage.engine, simulation.trajectory().poses
    middle, net, gross = np.asarray(own[len(own) // 3], dtype=np.float64), 0.0, 0.0
    last: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    # The first quarter leads in.
    for p in 2.0 * np.pi * np.arange(-count // 4, count + 1) / count:
        pose = rotated(
            middle, np.radians([0.4 * np.sin(p), 0.3 * np.sin(2.0 * p), 8.0 * np.sin(p)])
        )
        pose[:3] += [6e-3 * np.cos(p), 4e-3 * np.sin(p), 5e-5 * np.sin(3.0 * p)]
        wrench = engine.wrench(pose, DT).copy()
        if last is not None and p > 0.0:
            arms = [rotation(at) @ engine.centre for at in (pose, last[0])]
            moved = pose[:3] + arms[0] - last[0][:3] - arms[1]
            mean = 0.5 * (wrench + last[1])
            work = float(mean[:3] @ moved + mean[3:] @ rotation_between(last[0], pose))
            net, gross = net + work, gross + abs(work)
        last = pose, wrench
    return net, gross


def _no_ratio(name: str) -> dict[str, Any]:
    bar = f"{name}: python-fcl ({PAIRS} pairs) to asperity: there is no ratio"
    return {"bar": bar, "value": 0.0, "least": FLOOR, "aim": AIM, "held": False}


def _timed_part(
    engine: ContactSolver, path: NDArray[np.float64], effort: Effort, own: bool
) -> list[NDArray[np.float64]]:
    """Return the stretches of a path that are timed, pressed to depths unless they are its own."""
    depths = 0.5 * (SHALLOW + DEEP) - 0.5 * (DEEP - SHALLOW) * np.cos(0.0311 * np.arange(len(path)))

    def cut(count: int) -> list[NDArray[np.float64]]:
        parts = [path[a:b] for a, b in stretches(path, count)]
        if own:
            return parts
        wanted = [depths[a:b] for a, b in stretches(path, count)]
        return [pressed(engine, part, deep) for part, deep in zip(parts, wanted, strict=True)]

    few = cut(COUNTS[0])
    seconds = effort.own if own else effort.perturbed
    count = affordable(engine, few, seconds, effort.rounds)
    return few if count == COUNTS[0] else cut(count)


def _query_times(
    engine: ContactSolver, poses: Sequence[NDArray[np.float64]], rounds: int
) -> dict[str, float]:
    clock, laps = time.perf_counter_ns, []
    for _ in range(rounds):
        ns = []
        for pose in poses:
            begun = clock()
            engine.candidates(pose)
            ns.append(clock() - begun)
        laps.append(ns)
    return spread(np.median(laps, axis=0) * 1e-3)


def _taken(done: Ticks, count: int, body: int | None = None) -> list[int]:
    """Return up to `count` poses in contact (with one body), spread over a path."""
    there = [i for i, w in enumerate(done.where) if w and (body is None or w.body == body)]
    return [there[i] for i in np.linspace(0, len(there) - 1, min(count, len(there))).astype(int)]


def beside_paper(
    engine: ContactSolver, done: dict[str, Ticks], effort: Effort, out: dict[str, Any]
) -> None:
    """Run the paper's method at some of the poses."""
    paper = Paper(engine)
    print("  the paper's method: eleven depths on a grid of 50 x 50, compiled; at the same poses")
    row("", ["poses", "median", "p99", "asperity", "ratio", "  short of its depth by, um"])
    for name, one in done.items():
        chosen = _taken(one, effort.beside)
        looks = [paper.looked(w) for w in (one.where[i] for i in chosen) if w]
        if not looks:
            continue
        laps, depths = [], np.array([])
        for _ in range(effort.rounds + 1):
            # The first lap compiles.
            laps.append([look() for look in looks])
        depths = np.array([(look(), paper.depths[0])[1] for look in looks])
        short = np.array([one.where[i].depth for i in chosen]) - depths  # type: ignore[union-attr]
        times, own = spread(np.median(laps[1:], axis=0)), spread(one.microseconds[chosen])
        ratio = times["median"] / own["median"]
        row(name, [
            str(len(looks)), micro(times["median"]), micro(times["p99"]), micro(own["median"]),
            f"{ratio:.2f}",
            f"  {1e6 * np.median(short):.1f} ({1e6 * short.min():.1f} to {1e6 * short.max():.1f})",
        ])  # fmt: skip
        out["paths"][name]["paper"] = {
            "paper_us": times, "asperity_us": own, "ratio": ratio,
            "short_m": [float(x) for x in (np.median(short), short.min(), short.max())],
        }  # fmt: skip
    off = np.concatenate(paper.off)
    if off.size:
        middle, high = np.percentile(off, [50, 99])
        print(
            f"  drawn heights are off asperity's by {1e9 * middle:.2g} nm, p99 {1e9 * high:.2g} nm"
        )


def beside_fcl(
    name: str, scene: Scene, engine: ContactSolver, done: dict[str, Ticks],
    again: dict[str, Callable[[], Ticks]], effort: Effort, out: dict[str, Any],
    bars: list[dict[str, Any]],
) -> None:  # fmt: skip
    """Run python-fcl on the full-detail surfaces at some of the poses, and the paths again.

    By turns: a machine that others use too may be twice as slow a minute later. The ratio is the
    median of those of the turns.
    """
    part = {"hammer-blocks": "block-1", "file-cad": "part"}[name]
    bodies = {body.name: i for i, body in enumerate(scene.bodies)}
    meshes = {
        which: full_detail(scene.bodies[bodies[which]], round(effort.detail * FULL_DETAIL[which]))
        for which in (scene.tool, part)
    }
    size = {which: len(faces) for which, (_, faces) in meshes.items()}
    fixed = engine._collider.frames[bodies[part]]
    pair = FclPair(meshes[scene.tool], meshes[part], fixed, (PAIRS, EVERY))
    sizes = " and ".join(f"{n} triangles ({which})" for which, n in size.items())
    print(f"  python-fcl on {sizes}; at poses with {PAIRS} pairs of triangles or more")
    row("", ["poses", "asked", "median", "p99", "asperity", "ratio", "  pairs: median (most)"])
    out["fcl_triangles"] = size
    ratios = []
    for path, one in done.items():
        there = _taken(one, MOST_LOOKED, bodies[part])
        pairs = np.array([pair.query(one.where[i].pose, EVERY) for i in there])  # type: ignore[union-attr]
        many = np.flatnonzero(pairs >= PAIRS)
        out["paths"][path]["fcl"] = {"poses": len(there), "poses_of_many_pairs": len(many)}
        if not many.size:
            print(
                f"  {path}: none of {len(there)} poses has (at most {pairs.max(initial=0)} pairs)"
            )
            continue
        many = many[np.linspace(0, many.size - 1, min(effort.beside, many.size)).astype(int)]
        poses = [one.where[there[i]].pose for i in many]  # type: ignore[union-attr]
        rows, laps = [there[i] for i in many], []
        for _ in range(TURNS if effort.rounds > 1 else 1):
            ours = again[path]().microseconds[rows]
            laps.append([ours, *(_fcl_times(pair, poses, most) for most in (PAIRS, EVERY))])
        middles = np.median(laps, axis=2)
        own, *theirs = (spread(column) for column in np.median(laps, axis=0))
        for k, (most, times) in enumerate(zip((PAIRS, EVERY), theirs, strict=True)):
            ratio = float(np.median(middles[:, 1 + k] / middles[:, 0]))
            if most == PAIRS:
                ratios.append(ratio)
            row(path, [
                str(len(poses)), str(PAIRS) if most == PAIRS else "all", micro(times["median"]),
                micro(times["p99"]), micro(own["median"]), f"{ratio:.2f}",
                f"  {np.median(pairs[many]):.0f} ({pairs[many].max()})",
            ])  # fmt: skip
            out["paths"][path]["fcl"][str(most)] = {
                "fcl_us": times, "asperity_us": own, "ratio": ratio,
                "pairs_median": float(np.median(pairs[many])),
            }  # fmt: skip
    if ratios:
        bars.append({
            "bar": f"{name}: python-fcl ({PAIRS} pairs) to asperity, least of {len(ratios)} paths",
            "value": min(ratios), "least": FLOOR, "aim": AIM, "held": min(ratios) >= FLOOR,
        })  # fmt: skip
    else:
        bars.append(_no_ratio(name))


def _fcl_times(pair: FclPair, poses: Sequence[NDArray[np.float64]], most: int) -> list[float]:
    clock, out = time.perf_counter_ns, []
    for pose in poses:
        begun = clock()
        pair.query(pose, most)
        out.append((clock() - begun) * 1e-3)
    return out


def grown(which: str, sizes: Sequence[int], effort: Effort) -> list[dict[str, Any]]:
    """Time one tool at all its sizes, until a tick takes too long."""
    title, make = SERIES[which]
    out = []
    for size in sizes:
        growing = make(size)
        engine = ContactSolver(growing.model, growing.bodies, "tool")
        mesh = growing.bodies[-1].mesh
        assert mesh is not None
        number = len(mesh.faces) if which in ("ball", "bumps") else size
        count = affordable(engine, [dragged(engine, growing, 9)], effort.growing, effort.rounds)
        path = dragged(engine, growing, count + 1)
        done = ticks(engine, [path], effort.rounds if count > COUNTS[0] else 1)
        times, what = spread(done.microseconds), found(done)
        print_path(f"{title} {number:>{27 - len(title)}}", times, what)
        lost = what["no_room"] > 0 or what["patches"] == 0
        if which == "blocks" and what["bodies"] < size:
            print(f"  {title}: WRONG, only {what['bodies']} of {size} push back")
            lost = True
        out.append({"size": number, "tick_us": times, **what, "lost": lost})
        if times["median"] > TOO_LONG and size != sizes[-1]:
            print(f"  {title}: larger ones are left out, a tick takes over {TOO_LONG:.0f} us")
            break
    return out


def triangles(effort: Effort) -> dict[str, Any]:
    """Tools of more and more triangles."""
    print("\ngrowth with the tool's triangles: us a tick (bumps: of the plate below as well)")
    row("triangles", HEAD, 9)
    return {which: grown(which, sizes, effort) for which, sizes in effort.triangles.items()}


def contacts(effort: Effort) -> dict[str, Any]:
    """More and more places that touch at once."""
    print("\ngrowth with contacts: us a tick")
    row("contacts", HEAD, 9)
    return {which: grown(which, effort.contacts, effort) for which in ("feet", "blocks")}


def figure(figures: dict[str, Any], path: Path) -> None:
    """Draw growth with triangles and with contacts, medians with bands up to p99."""
    from matplotlib.figure import Figure

    from asperity.drawing.figure_style import COLOURS, MARKERS, style

    panels = [
        ("triangles", "triangles of the tool", "a  growth with triangles"),
        ("contacts", "feet or blocks that touch", "b  growth with contacts"),
    ]
    panels = [panel for panel in panels if panel[0] in figures]
    with style():
        drawn = Figure(figsize=(4.4 * len(panels), 3.6), layout="constrained")
        axes = drawn.subplots(1, len(panels), squeeze=False)[0]
        for axis, (section, label, title) in zip(axes, panels, strict=True):
            for i, (which, points) in enumerate(figures[section].items()):
                _series(axis, SERIES[which][0], points, COLOURS[i], MARKERS[i])
            axis.axhline(1e3, color="#666666", linewidth=0.8, linestyle=":")
            axis.annotate(
                "1 kHz", (0.01, 1e3), xycoords=("axes fraction", "data"), fontsize=8,
                color="#666666", ha="left", va="bottom",
            )  # fmt: skip
            axis.set(xscale="log", yscale="log", xlabel=label, ylabel="time of a tick [µs]")
            axis.set_title(title)
            if section == "contacts":
                axis.set_xticks(WHOLE.contacts, [str(n) for n in WHOLE.contacts])
                axis.minorticks_off()
            axis.legend(loc="upper left")
            low, high = axis.get_ylim()
            axis.set_ylim(low, 4.0 * high)
        drawn.supxlabel(
            "lines: median; bands: up to p99; hollow: not all certified; cross: contacts lost",
            fontsize=8, color="#666666",
        )  # fmt: skip
        drawn.savefig(path)
    print(f"wrote {path}")


def _series(axis: Any, name: str, points: Sequence[dict[str, Any]], colour: str, mark: str) -> None:
    sizes = [p["size"] for p in points]
    medians, highs = ([p["tick_us"][key] for p in points] for key in ("median", "p99"))
    axis.fill_between(sizes, medians, highs, color=colour, alpha=0.18, linewidth=0)
    axis.plot(sizes, medians, color=colour, label=name, marker=mark, markersize=5)
    for p in points:
        if p["lost"] or p["certified"] != 1.0:
            at = (p["size"], p["tick_us"]["median"])
            axis.plot(*at, mark, color=colour, markerfacecolor="white", markersize=5)
            if p["lost"]:
                axis.plot(*at, "x", color=colour, markersize=8)


def main() -> int:
    """Run the benchmark; return 1 if a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=SECTIONS)
    parser.add_argument("--quick", action="store_true", help="a look at everything, no bars")
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    parser.add_argument("--figure", type=Path, help="draw growth to this file (png, svg, pdf)")
    options = parser.parse_args()
    begun, bars = time.perf_counter(), list[dict[str, Any]]()
    effort = QUICK if options.quick else WHOLE
    _compile()
    figures: dict[str, Any] = {}
    if {"scenes", "paper", "fcl"} & set(options.only):
        figures["scenes"] = scenes(effort, options.only, bars)
    for name, run in (("triangles", triangles), ("contacts", contacts)):
        if name in options.only:
            figures[name] = run(effort)
    print()
    for b in bars:
        state = "held    " if b["held"] else "NOT held"
        limit = f"at most {b['most']:g}" if "most" in b else f"at least {b['least']:g}"
        aim = f", aim {b['aim']:g}" if "aim" in b else ""
        print(f"{state}  {b['bar']}: {b['value']:.{0 if 'most' in b else 2}f} (bar: {limit}{aim})")
    print(f"all of it took {time.perf_counter() - begun:.0f} s")
    if options.json:
        figures |= {
            "bars": bars, "seconds": time.perf_counter() - begun, "threads": 1,
            "rounds": effort.rounds, "stretches": SEGMENTS, "quick": options.quick,
        }  # fmt: skip
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    if options.figure and {"triangles", "contacts"} & set(figures):
        figure(figures, options.figure)
    return 0 if options.quick or all(b["held"] for b in bars) else 1


def _compile() -> None:
    """Compile the engine before anything is timed, and say how long that took."""
    begun = time.perf_counter()
    growing = ball(1)
    engine = ContactSolver(growing.model, growing.bodies, "tool")
    engine.wrench(growing.start, DT)
    print(f"compiled, or read from the cache, in {time.perf_counter() - begun:.1f} s")


if __name__ == "__main__":
    sys.exit(main())
