"""Write a comparison to disk: tables, traces, figures, pages."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.output import write_json, write_whole
from asperity.drawing import figure_style
from asperity.studies.comparison import figures
from asperity.studies.comparison.claims import CLAIMS
from asperity.studies.comparison.compare import Comparison, MethodResult
from asperity.studies.comparison.page import FIGURES, markdown, page


def write_comparison(result: Comparison, folder: Path, command: str) -> None:
    """Fill a folder: comparison.json, methods.csv, traces.csv, figures, comparison.md and .html."""
    write_json(folder / "comparison.json", summary(result, command))
    _methods_csv(result, folder / "methods.csv")
    _traces_csv(result, folder / "traces.csv")
    if figures.done_rows(result):
        draw = (figures.traces_figure, figures.spectra_figure, figures.cost_figure)
        for name, figure in zip(FIGURES, draw, strict=True):
            figure_style.save(figure(result), folder, name)
    text = markdown(result, command, {name: f"{name}.png" for name in FIGURES})
    (folder / "comparison.md").write_text(text, "utf-8")
    (folder / "comparison.html").write_text(page(result, command, folder), "utf-8")


def summary(result: Comparison, command: str) -> dict[str, Any]:
    """Return all results for `comparison.json`, in SI units."""
    return {
        "schema": 2,
        "command": command,
        "scene": result.scene.name,
        "ticks": len(result.poses),
        "dt_s": result.settings.dt,
        "mean_push_n": result.push,
        "claims": {name: one._asdict() for name, one in CLAIMS.items()},
        "methods": [_row(row) for row in result.rows],
    }


def _row(row: MethodResult) -> dict[str, Any]:
    out: dict[str, Any] = {
        "name": row.method.name, "label": row.method.label, "source": row.method.source,
        "what_it_is_not": row.method.what_it_is_not, "cannot": row.reason,
    }  # fmt: skip
    done = row.rendered
    if done is not None:
        out |= {
            "ticks": len(done.run.force),
            "preparing_s": done.preparing,
            "raised_m": done.height,
            "tick_median_s": done.cost[0],
            "tick_p99_s": done.cost[1],
            "tick_over_asperity": done.ratio,
            "tangential_rms_n": done.tangential,
            "band_rms_n": done.band_rms,
            "mean_force_n": done.run.force.mean(axis=0).tolist(),
            "mean_torque_n_m": done.run.torque.mean(axis=0).tolist(),
            "torque_std_n_m": done.run.torque.std(axis=0).tolist(),
            "deepest_m": float(done.run.depth.max()),
            "contacts_median": float(np.median(done.run.contacts)),
        }
    if row.claims is not None:
        out["claims"] = {k: m._asdict() for k, m in row.claims.measured.items()}
        still = row.claims.still
        out["still_hand"] = None if still is None else still._asdict()
    return out


def _methods_csv(result: Comparison, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        head = ["method", "source", "cannot", "ticks", "tick_median_s", "tick_p99_s",
                "tick_over_asperity", "tangential_rms_n", "band_rms_n"]  # fmt: skip
        named = [f"{name}_{what}" for name in CLAIMS for what in ("value", "holds")]
        writer.writerow([*head, *named])
        for row in result.rows:
            numbers = _row(row)
            cells: list[object] = [row.method.name, row.method.source, row.reason or ""]
            cells += [numbers.get(key, "") for key in head[3:]]
            for name in CLAIMS:
                one = None if row.claims is None else row.claims.measured.get(name)
                cells += ["", ""] if one is None or one.value is None else [one.value, one.holds]
            writer.writerow(cells)


def _traces_csv(result: Comparison, path: Path) -> None:
    rows = figures.done_rows(result)
    parts = ("force_x_n", "force_y_n", "force_z_n", "torque_x_n_m", "torque_y_n_m", "torque_z_n_m")
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["time_s", "x_m", "y_m", "z_m"]
            + [f"{method.name}_{part}" for method, _ in rows for part in parts]
        )
        wrenches = [np.hstack([done.run.force, done.run.torque]) for _, done in rows]
        for i, pose in enumerate(result.poses):
            cells = [f"{i * result.settings.dt:.6g}", *(f"{x:.9g}" for x in pose[:3])]
            for wrench in wrenches:
                cells += [f"{x:.6g}" for x in wrench[i]] if i < len(wrench) else [""] * 6
            writer.writerow(cells)


def write_docs(folder: Path, docs: Path, result: Comparison, command: str) -> None:
    """Write the page into the documentation, with the figures that are in `folder`."""
    images = docs / "images"
    images.mkdir(parents=True, exist_ok=True)
    for name in FIGURES:
        shutil.copyfile(folder / f"{name}.svg", images / f"comparison_{name}.svg")
    where = {name: f"images/comparison_{name}.svg" for name in FIGURES}
    write_whole(docs / "comparison.md", markdown(result, command, where))
