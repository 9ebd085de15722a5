"""Pictures of the pressure on a soft body: frames in one figure, and a sequence of images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.image import imsave
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity._core.output import result_folder
from asperity.drawing.figure_style import PAGE_WIDTH, save, style
from asperity.errors import AsperityError
from asperity.runs.skin_fields import SkinFields, read_fields

_MAP = "inferno"
_ENLARGED = 4
"""Pixels along the side of a taxel in an image."""


def pressure_figure(fields: SkinFields, title: str, frames: int = 6) -> Figure:
    """Return frames of the pressure, evenly spaced in time, on one scale of colours.

    Parameters
    ----------
    fields : SkinFields
        Of one frame at least.
    title : str
    frames : int
        Most frames in the figure.
    """
    chosen = np.unique(np.linspace(0, len(fields.time) - 1, frames).round().astype(int))
    top = max(float(fields.pressure[chosen].max()), 1e-9) * 1e-3
    half = [0.5 * (axis[1] - axis[0]) if len(axis) > 1 else 0.5e-3
            for axis in (fields.column, fields.row)]  # fmt: skip
    extent = 1e3 * np.array(
        [fields.column[0] - half[0], fields.column[-1] + half[0],
         fields.row[0] - half[1], fields.row[-1] + half[1]]
    )  # fmt: skip
    with style():
        columns = min(len(chosen), 3)
        rows = -(-len(chosen) // columns)
        figure = Figure(figsize=(PAGE_WIDTH, 0.9 + 2.6 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for axis, i in zip(axes.flat, chosen, strict=False):
            shown = axis.imshow(
                fields.pressure[i] * 1e-3, origin="lower", extent=extent, cmap=_MAP, vmin=0.0,
                vmax=top, interpolation="nearest",
            )  # fmt: skip
            axis.set_title(f"{fields.time[i]:.3f} s")
            axis.grid(False)
        for axis in axes.flat[len(chosen) :]:
            axis.set_axis_off()
        for axis in axes[-1]:
            axis.set_xlabel("along columns [mm]")
        for axis in axes[:, 0]:
            axis.set_ylabel("along rows [mm]")
        figure.colorbar(shown, ax=axes, label="pressure [kPa]", shrink=0.8)
        figure.suptitle(title, x=0.012, ha="left", fontsize=11, fontweight="bold")
    return figure


def pressure_images(
    recording: str | Path, folder: str | Path, *, largest: float | None = None,
    overwrite: bool = False,
) -> int:  # fmt: skip
    """Write an image of every frame of the pressure in a recording; return how many there are.

    `0000.png` and so on: black where there is no pressure, light at the largest. Rows go upwards.

    Parameters
    ----------
    recording : str or Path
        `recording.h5`, or the folder it is in.
    folder : str or Path
        For the images.
    largest : float, optional
        Pressure of the lightest colour [Pa], above 0. Default: the largest in the recording.
    overwrite : bool
        Whether to replace files in the folder.

    Raises
    ------
    AsperityError
        The recording has no fields, or `largest` is not above 0.
    OutputError
        The folder cannot be written.
    """
    fields = read_fields(recording)
    if largest is None:
        largest = max(float(fields.pressure.max(initial=0.0)), 1e-9)
    elif not largest > 0.0:
        raise AsperityError(f"largest must be above 0 Pa, got {largest!r}")
    with result_folder(Path(folder), overwrite=overwrite) as fresh:
        for i, pressure in enumerate(fields.pressure):
            imsave(fresh / f"{i:04d}.png", pressure_image(pressure, largest))
    return len(fields.time)


def pressure_image(pressure: Array, largest: float) -> NDArray[np.uint8]:
    """Return an image (4 rows, 4 columns, 3) of a pressure (rows, columns); rows go upwards.

    Black where there is none, light at `largest` [Pa].
    """
    image = colormaps[_MAP](np.clip(pressure[::-1] / largest, 0.0, 1.0), bytes=True)[..., :3]
    return np.asarray(image.repeat(_ENLARGED, axis=0).repeat(_ENLARGED, axis=1))


def write_pressure(folder: Path, name: str) -> None:
    """Write `pressure.png` and the images in `pressure/` of the recording in a folder."""
    fields = read_fields(folder)
    save(pressure_figure(fields, f"{name}: pressure"), folder, "pressure", ("png",))
    pressure_images(folder, folder / "pressure")
