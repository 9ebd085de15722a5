"""A run is recorded, opened as a labelled dataset, looked at, and left as CSV and WAV."""

import tempfile
from pathlib import Path

import numpy as np

import asperity
from asperity.runs.export import sound_of, traces_of, write_csv
from asperity.runs.run_scene import run_scene

folder = Path(tempfile.mkdtemp())
scene = asperity.load_scene("probe-plate").changed(trajectory={"seconds": 0.4})
run_scene(scene, folder / "recording.h5")

with asperity.open_recording(folder) as data:  # an xarray Dataset; nothing is read yet
    for name in ("contact_force", "tool_position", "penetration_depth"):
        print(f"{name} {data[name].dims} [{data[name].attrs['units']}]")
    sliding = data.sel(time=slice(0.2, 0.4))
    along = sliding.contact_force.sel(axis="x")
    print(f"F_x {along.min().item():.2f} to {along.max().item():.2f} N,", data.attrs["scene"])
    depth = sliding.penetration_depth.values
    print(f"depth {np.mean(depth) * 1e3:.2f} mm on average")
    ticks = write_csv(sliding, folder / "slide.csv")
    sound = sound_of(traces_of(sliding))
    sound.write(folder / "slide.wav")
    print(f"{ticks} ticks in slide.csv; slide.wav lasts {sound.samples.size / sound.rate:.2f} s")
