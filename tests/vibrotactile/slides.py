"""Slides by asperity's own contact, to fit vibration models to and to judge them by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import signal

from asperity.scene.builtin.probe_plate import probe_plate
from asperity.studies.baselines.recorded_vibration import enlarge_sample
from asperity.studies.comparison import stimuli
from asperity.vibrotactile.explore import explore
from asperity.vibrotactile.fit import FitSettings, fit
from asperity.vibrotactile.synthesis import Synthesiser

SPEEDS, FORCES = (0.03, 0.08, 0.16, 0.3), (0.4, 1.0)
BETWEEN, HELD_OUT = (0.05, 0.12, 0.22), (0.45, 0.8)
RATE, SECONDS, MASS = 2000.0, 1.5, 0.05
OBLIQUE = float(np.arctan(0.377))
"""Direction in which a path over a random tile does not come back to itself [rad]."""
_DOTS = {"kind": "jittered_dots", "pitch": 2e-3, "height": 4e-4, "diameter": 8e-4, "samples": 32}
_PAPER = {"kind": "rough", "hurst": 0.8, "rms_slope": 0.3}
TEXTURES = {
    "waves": {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4},
    "stiff waves": {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4},
    "dots": _DOTS | {"jitter": 0.0, "periods": 4},
    "jittered dots": _DOTS | {"jitter": 0.5, "periods": 48},
    "P40": _PAPER | {"size": 0.0256, "pixel_size": 2.5e-5, "rolloff": 425e-6},
    "P120": _PAPER | {"size": 0.0192, "pixel_size": 1.5e-5, "rolloff": 115e-6, "cutoff": 5e-5},
}
LENGTHS = {"waves": 2e-3, "stiff waves": 2e-3, "dots": 2e-3, "jittered dots": 2e-3}
"""Wavelengths of what repeats [m]."""


def scene_of(name, seed):
    """Return a tool over an unbounded sample: a ball of 3 mm, 400 N/m (stiff: 4000 N/m)."""
    if name == "stiff waves":
        return enlarge_sample(stimuli.ball_on_plate())
    texture = dict(TEXTURES[name])
    if texture["kind"] != "sinusoid":
        texture["seed"] = seed
    return enlarge_sample(probe_plate(texture))


def slides(name, seed, speeds, forces, metres=0.0, seconds=(SECONDS, SECONDS), apart=True):
    """Return a slide for each speed and force along one line, each from a random start if `apart`.

    Each of `metres`, within the least and the most of `seconds`. Of a random surface, the share of
    power near a frequency scatters between recordings as one over the root of their length: over
    P40 at 30 mm/s by 0.05 (standard deviation) in 1.3 s, which pass 45 peaks, and from 0.16 to 0.38
    in 60 of them. So the slides that judge are longer than those that are fitted.
    """
    scene, rng = scene_of(name, seed), np.random.default_rng(seed)
    direction = OBLIQUE if TEXTURES[name]["kind"] == "rough" else 0.0
    pairs = [([v], [f]) for v in speeds for f in forces] if apart else [(speeds, forces)]
    out = []
    for some_speeds, some_forces in pairs:
        start = (rng.uniform(-5e-3, 5e-3), 0.0, scene.start[2])
        motion = replace(scene.motion, length=10.0, direction=direction, start=start)
        out += explore(
            replace(scene, motion=motion), some_speeds, some_forces, rate=RATE, mass=MASS,
            seconds=[float(np.clip(metres / v, *seconds)) for v in some_speeds],
        )  # fmt: skip
    return out


def share_near(vibration, frequency, rate=RATE):
    """Return the share of power within 25 % of a frequency."""
    f, power = signal.periodogram(vibration - vibration.mean(), rate, "hann")
    return float(power[np.abs(f / frequency - 1.0) < 0.25].sum() / power.sum())


def peak_length(explorations):
    """Return the wavelength [m] at the peak of the spectrum over distance, per octave.

    Of all slides, each of power 1: 40 bands from 50 um to 10 mm, frequencies from 40 to 900 Hz.
    """
    edges = np.geomspace(100.0, 2e4, 41)
    total, count = np.zeros(40), np.zeros(40)
    for one in explorations:
        speed = one.speed.mean()
        f, power = signal.welch(one.vibration / one.vibration.std(), one.rate, nperseg=512)
        inside = (f > 40.0) & (f < 900.0)
        k = f[inside] / speed
        total += np.histogram(k, edges, weights=f[inside] * power[inside])[0]
        count += np.histogram(k, edges)[0]
    best = int(np.argmax(total / np.maximum(count, 1)))
    return float(1.0 / np.sqrt(edges[best] * edges[best + 1]))


def judged(model, held_out, length, seed=1000):
    """Return rows of speed, share in the data, share in the model, RMS ratio.

    A row a speed: means over the slides at that speed, RMS as root mean squares.
    """
    rows: dict[float, list[tuple[float, ...]]] = {}
    for i, one in enumerate(held_out):
        speed, force = float(one.speed.mean()), float(one.force.mean())
        count = int(16.5 * one.rate)
        made = Synthesiser(model, seed=seed + i).block(np.full(count, speed), np.full(count, force))
        made = made[int(0.5 * one.rate) :]
        rows.setdefault(round(speed, 3), []).append(
            (
                share_near(one.vibration, speed / length), share_near(made, speed / length),
                made.std() ** 2, one.vibration.std() ** 2,
            )
        )  # fmt: skip
    means = {speed: np.mean(own, axis=0) for speed, own in rows.items()}
    return np.array([(v, data, own, np.sqrt(a / b)) for v, (data, own, a, b) in means.items()])


def fitted_and_judged(name, seed=1):
    """Return the models of both kinds, each with its rows on slides of another seed."""
    training = slides(name, seed, SPEEDS, FORCES)
    speeds = sorted((*SPEEDS, *BETWEEN))
    apart = TEXTURES[name]["kind"] != "rough"  # what is large and random takes long to begin anew
    held_out = slides(name, 100 + seed, speeds, HELD_OUT, 0.18, (SECONDS, 6.0), apart)
    length = LENGTHS.get(name) or peak_length(training)
    fits = {kind: fit(training, FitSettings(kind=kind)) for kind in ("noise", "harmonic")}
    return {kind: (one, judged(one.model, held_out, length)) for kind, one in fits.items()}
