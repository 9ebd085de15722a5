"""Three probes on a wavy plate: how deep they reach, and what the hand that drags them feels."""

import numpy as np

from asperity.dynamics.dragged_hand.hand import Hand, drag
from asperity.geometry.offsets.analytic import Sinusoid
from asperity.runs.vibration_metrics import evaluate
from asperity.studies.otaduy_lin_2004.force_models import otaduy_lin

plate = Sinusoid(amplitude=0.1e-3, spacing=1.5e-3)  # SI units throughout: [m]
for diameter in (2e-3, 3e-3, 4e-3):
    path = plate.tracer(diameter)(np.linspace(0.0, plate.period, 1001))  # the offset surface
    force = otaduy_lin.texture_force(plate, diameter, normal_force=0.58)  # Eqs 4-6: F_u [N]
    motion = drag(force, Hand(), speed=0.083)  # Eq. 7
    depth, band = np.ptp(path.height) * 1e6, evaluate("band_rms", motion)
    print(f"D = {diameter:g} m: {depth:.0f} um; max u'' {motion.largest:.2f}, band {band:.2f} m/s2")
