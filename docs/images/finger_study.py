"""Picture of what a soft finger takes of a grating: `python docs/images/finger_study.py`."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.special import jv

from asperity.drawing.figure_style import COLOURS, REPORT_WIDTH, log_scale, style
from asperity.geometry.offsets.analytic import Sinusoid
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import slope_table
from asperity.studies.skin.fingertip import Fingertip

FORCE, AMPLITUDE, PROBE = 0.58, 0.1e-3, 3e-3
SPACINGS = np.geomspace(0.3e-3, 6e-3, 400)


def largest(table):
    return FORCE * np.max(np.abs(table(np.linspace(0.0, table.period, 400))))


fingers = {"soft finger": Fingertip(), "the same without ridges": Fingertip(ridge_amplitude=0.0)}
smooth = fingers["the same without ridges"]
depth = smooth.rest(Sinusoid(1e-12, 1e-3), FORCE)[0].deepest.mean()
z = 2.0 * np.pi / SPACINGS * np.sqrt(2.0 * smooth.semi_axes[0] ** 2 / smooth.semi_axes[2] * depth)
low = FORCE * AMPLITUDE * 2.0 * np.pi / SPACINGS * np.abs(8.0 * jv(2, z) / z**2)

with style():
    figure = Figure(figsize=(REPORT_WIDTH, 3.9), layout="constrained")
    axis = figure.add_subplot()
    probe = [largest(slope_table(Sinusoid(AMPLITUDE, s), PROBE)) for s in SPACINGS[::8]]
    axis.plot(SPACINGS[::8] * 1e3, probe, color=COLOURS[5], lw=1.6, label="rigid probe of 3 mm")
    for (name, finger), colour in zip(fingers.items(), COLOURS, strict=False):
        force = [largest(finger.slope_table(Sinusoid(AMPLITUDE, s), FORCE)) for s in SPACINGS]
        axis.plot(SPACINGS * 1e3, force, color=colour, lw=1.3, label=name)
    wide = SPACINGS > 1e-3
    axis.plot(
        SPACINGS[wide] * 1e3, low[wide], color="#444444", lw=0.9, ls=":",
        label="closed form for low relief",
    )  # fmt: skip
    axis.axvline(smooth.ridge_spacing * 1e3, color="#888888", lw=0.8, ls="--")
    axis.text(
        smooth.ridge_spacing * 1e3 * 1.03, 0.4, "the finger's ridges, every 0.45 mm",
        color="#555555",
    )  # fmt: skip
    axis.set(
        xlabel="spacing of the sinusoid [mm]", ylabel="largest texture force [N]",
        title="A finger averages fine waves away, but for those of its ridges' spacing",
        xlim=(SPACINGS[0] * 1e3, SPACINGS[-1] * 1e3), ylim=(1e-5, 1.0),
    )  # fmt: skip
    log_scale(axis)
    axis.legend(loc="upper left", bbox_to_anchor=(0.3, 0.8))
    figure.savefig(Path(__file__).with_suffix(".png"))
