"""A fitted model, and how well it does, as numbers and words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.drawing.pages import render
from asperity.vibrotactile.distances import Match
from asperity.vibrotactile.fit import Fitted, Held
from asperity.vibrotactile.harmonic import HarmonicModel
from asperity.vibrotactile.model import TextureModel


def summary_of(model: TextureModel, fitted: Fitted | None, held: Sequence[Held]) -> dict[str, Any]:
    """Return what there is to say of a model: how large it is, and what held-out runs say."""
    out: dict[str, Any] = {
        "schema": 1,
        "name": model.name,
        "kind": "harmonic" if isinstance(model, HarmonicModel) else "noise",
        "rate_hz": model.rate,
        "models": len(model.speeds),
        "order": model.order,
        "moving_average": int(model.ma.shape[1]),
        "friction": model.friction,
        "largest_speed_m_s": float(model.speeds.max()),
        "largest_force_n": float(model.forces.max()),
    }
    if isinstance(model, HarmonicModel):
        out |= {"periods_m": model.periods.tolist(), "lines": len(model.harmonics)}
    if fitted is not None:
        out |= {
            "lost": list(fitted.lost),
            "fitted": fitted.recorded,
            "stretches": len(fitted.stretches),
            "left_out": fitted.dropped,
            "seconds": sum(s.vibration.size for s in fitted.stretches) / model.rate,
            "criterion": fitted.scores.tolist(),
        }
    return out | {"held_out": [_one(one) for one in held], "median": _medians(held)}


def _one(one: Held) -> dict[str, Any]:
    return {
        "run": one.stretch.exploration.name,
        "from_s": one.stretch.begin / one.stretch.exploration.rate,
        "to_s": one.stretch.end / one.stretch.exploration.rate,
        "speed_m_s": one.stretch.speed,
        "force_n": one.stretch.force,
        "rms_m_s2": float(np.std(one.stretch.vibration)),
        "made_rms_m_s2": float(np.std(one.made)),
        **{
            comparison: getattr(one, comparison)._asdict()
            for comparison in ("match", "itself", "noise")
        },
    }


def _medians(held: Sequence[Held]) -> dict[str, dict[str, float]]:
    if not held:
        return {}
    return {
        comparison: {
            name: float(np.median([getattr(getattr(one, comparison), name) for one in held]))
            for name in Match._fields
        }
        for comparison in ("match", "itself", "noise")
    }


def in_words(summary: dict[str, Any]) -> str:
    """Return the summary as lines for a reader."""
    return render("model_words.txt", **summary).rstrip("\n")


def stroking(model: TextureModel) -> tuple[Array, Array]:
    """Return speeds [m/s] and forces [N] of a hand that strokes to and fro for 4 s, once a second.

    The speed is that of a sine that reaches the model's largest; the force half its largest.
    """
    time = np.arange(int(4.0 * model.rate)) / model.rate
    speed = np.abs(np.sin(np.pi * time)) * float(model.speeds.max())
    return speed, np.full(time.size, 0.5 * float(model.forces.max()))
