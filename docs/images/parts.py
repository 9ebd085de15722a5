"""Picture of the parts that the paper leaves out: `python docs/images/parts.py`."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from asperity.drawing.figure_style import COLOURS, log_scale, style
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.dragged_hand.normal_motion import NormalProbe, drag_lifting
from asperity.geometry.offsets.dots import DotPlate
from asperity.runs.vibration_metrics import detection_threshold_db
from asperity.studies.skin.channels import CHANNELS, envelope_db, threshold_db
from asperity.studies.skin.pressed_finger import PressedFinger
from asperity.studies.skin.transmission import FINGERTIP, PALM, transmissibility

FORCE, SPEED, PIXEL = 0.58, 0.083, 0.1e-3


def lift_off(axis, force):
    plate = DotPlate(2e-3, columns=12)
    path = plate.tracer(3e-3)(np.arange(1600) * plate.period / 1600)
    run = drag_lifting(
        path.height, path.slope, plate.period, Hand(), NormalProbe(), normal_force=FORCE,
        speed=SPEED, length=11e-3,
    )  # fmt: skip
    place = run.motion.place * 1e3
    place = place - place[0]
    phase = (run.motion.place % plate.period) / plate.period * 1600
    axis.fill_between(
        place, 0, np.interp(phase, np.arange(1600), path.height) * 1e3, color="#dddddd",
        label="path that never leaves the dots",
    )  # fmt: skip
    axis.plot(place, run.height * 1e3, color=COLOURS[0], lw=1.2, label="probe")
    axis.set(ylabel="height [mm]", title="A probe that moves along the normal")
    axis.legend(loc="upper right", ncols=2)
    axis.set_ylim(-0.15, 0.95)
    force.fill_between(place, 0, run.contact_force, color=COLOURS[1], lw=0)
    force.axhline(FORCE, color="#555555", lw=0.8, ls=":")
    force.set(xlabel="place [mm]", ylabel="contact [N]", ylim=(0, None))


def skin(axis):
    finger, plate = PressedFinger(), DotPlate(2e-3, jitter=0.5)
    x = np.arange(-8e-3, 8e-3 + PIXEL / 2, PIXEL)
    pressure = finger.pressure(plate.heights(x[None, :] + 0.03, x[:, None]), PIXEL, FORCE)
    image = axis.imshow(pressure * 1e-3, extent=(-8, 8, -8, 8), cmap="magma", origin="lower")
    axis.set(title="A finger with skin: pressure over dots", xlabel="[mm]", ylabel="[mm]")
    axis.grid(False)
    axis.figure.colorbar(image, ax=axis, label="pressure [kPa]")


with style():
    figure = Figure(figsize=(10.6, 6.2))
    grid = figure.add_gridspec(4, 2, width_ratios=(1.35, 1.0))
    lift_off(figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0]))
    f = np.geomspace(1.0, 1000.0, 300)
    gain = figure.add_subplot(grid[2:, 0])
    for tissue, name, colour in ((FINGERTIP, "fingertip", 0), (PALM, "palm", 1)):
        label = f"{name}, {tissue.natural_frequency:g} Hz"
        gain.plot(f, np.abs(transmissibility(f, tissue)), color=COLOURS[colour], label=label)
    gain.set(title="Transmission from grip to skin", xlabel="frequency [Hz]", ylabel="gain")
    gain.set_xlim(1, 1000)
    log_scale(gain)
    gain.legend(loc="lower left")
    skin(figure.add_subplot(grid[:2, 1]))
    axis = figure.add_subplot(grid[2:, 1])
    for i, channel in enumerate(CHANNELS):
        axis.plot(f, threshold_db(channel, f), color=COLOURS[i], lw=1.2, label=channel.upper())
    audible = f[f >= 10.0]
    published = detection_threshold_db(audible) - detection_threshold_db(250.0) + envelope_db(250.0)
    axis.plot(audible, published, color="black", lw=1.0, ls="--", label="MPEG's curve")
    axis.set(title="Channels by threshold", xlabel="frequency [Hz]", ylabel="dB re 1 um",
             ylim=(-25, 45), xlim=(1, 1000))  # fmt: skip
    log_scale(axis, y=False)
    axis.legend(ncols=2, loc="lower left")
    figure.tight_layout(h_pad=0.6, w_pad=1.5)
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=100)
