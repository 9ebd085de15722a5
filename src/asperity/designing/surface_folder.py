"""What a designed surface leaves on disk: maps, plate, scene.

`heights.tiff` is the tile to make and `made.tiff` what the process makes of it, 32-bit floats in
metres, the bottom row at v = 0; both repeat. `plate.stl` [mm] is for the machine, `base.obj` the
plate without texture, onto which `asperity bake` puts it back. The scene has the tile as made.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from asperity.designing.candidate import DesignedTile
from asperity.designing.forward import Demand
from asperity.designing.plate_stl import (
    PrintedPlate,
    plate_map,
    plate_triangles,
    write_base,
    write_stl,
)
from asperity.designing.process import ManufactureProcess
from asperity.scene.builtin.probe_plate import probe_plate
from asperity.scene.document import merged, write_toml
from asperity.scene.scene import Scene, read_scene
from asperity.texture.height_field import HeightField

HEIGHTS, MADE, PLATE, BASE = "heights.tiff", "made.tiff", "plate.stl", "base.obj"


def write_map(field: HeightField, path: Path) -> None:
    """Write a tile as TIFF of floats in metres, its lowest place at 0."""
    import tifffile

    samples = (field.samples - field.lowest).astype(np.float32)[::-1]
    pixel = " x ".join(f"{1e6 * size:.9g}" for size in field.pixel_size)
    tifffile.imwrite(
        path, np.ascontiguousarray(samples), compression="zlib",
        description=f"heights in metres; samples {pixel} um apart; repeats; bottom row: v = 0",
    )  # fmt: skip


def write_surface(
    tile: DesignedTile,
    demand: Demand,
    process: ManufactureProcess,
    plate: PrintedPlate,
    number: str,
    folder: Path,
) -> tuple[Scene, dict[str, Any]]:
    """Write one surface into an existing folder; return its scene and what was written.

    Parameters
    ----------
    tile : DesignedTile
    demand : Demand
        Gives the scene its probe, force and speed.
    process, plate
        Give the plate its pixel and size.
    number : str
        Engraved in the plate.
    folder : Path
    """
    write_map(tile.to_make, folder / HEIGHTS)
    write_map(tile.made, folder / MADE)
    heights, strip = plate_map(tile.to_make, process, plate, number)
    triangles = plate_triangles(heights, process.pixel, plate.base)
    write_stl(triangles, folder / PLATE)
    write_base(heights.shape, process.pixel, plate.base, folder / BASE)
    scene = write_probe_scene(tile.made, demand, folder)
    return scene, {
        "number": number,
        "plate_samples": list(heights.shape),
        "strip_rows": strip,
        "triangles": len(triangles),
        "stl_bytes": (folder / PLATE).stat().st_size,
    }


def write_probe_scene(made: HeightField, demand: Demand, folder: Path) -> Scene:
    """Write `scene.xml` and `scene.toml` of a probe over the tile in `made.tiff`; read it back."""
    blank = probe_plate({"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4},
                        diameter=demand.diameter)  # fmt: skip
    texture = {
        "file": MADE, "unit": "m", "pixel_size": [float(p) for p in made.pixel_size],
        "border": "wrap",
    }  # fmt: skip
    document = dict(blank.document)
    document["bodies"] = {"plate": {"texture": texture}}
    document["trajectory"] = merged(
        document["trajectory"], {"speed": demand.speed, "press_force": demand.force}
    )
    (folder / "scene.xml").write_text(blank.xml, "utf-8")
    (folder / "scene.toml").write_text(write_toml(document), "utf-8")
    return read_scene(folder)
