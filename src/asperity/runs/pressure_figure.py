"""Pictures of pressure and shear on a body: frames in a figure, and sequences of images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.image import imsave
from numpy.typing import NDArray
from PIL import Image

from asperity._core.arrays import Array
from asperity._core.output import result_folder, write_json
from asperity.drawing.figure_style import PAGE_WIDTH, save, style
from asperity.errors import AsperityError
from asperity.runs.skin_fields import SkinFields, read_fields

_MAP = "inferno"
_SIGNED = "coolwarm"
_ENLARGED = 4
"""Pixels along the side of a taxel in a coloured image."""
_ARROWS = 14
"""Most arrows along a side of a frame."""
_LONGEST = 1.8
"""Length of the longest, over their distance."""
_SHORTEST = 0.12
"""Shear of the smallest arrow, over the largest."""
_MARGIN = 1.3
"""Side of the part of a grid that a figure shows, over the touched one."""
_SHOWN = 99.0
"""Percentile of the pressed taxels that has the lightest colour in a figure."""


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
    return _frames_figure(fields, fields.pressure, f"{title}: pressure", "pressure [kPa]", frames)


def shear_figure(fields: SkinFields, title: str, frames: int = 6) -> Figure:
    """Return frames of the shear: its size as colour, its direction as arrows.

    Shear is what the other surface does to the skin; an arrow is the mean of a square of taxels.
    Parameters as of `pressure_figure`.
    """
    size = np.hypot(fields.shear[..., 0], fields.shear[..., 1])
    figure = _frames_figure(fields, size, f"{title}: shear", "size of the shear [kPa]", frames)
    chosen = _chosen(fields, frames)
    column, row, mean = _block_means(fields, chosen)
    top = max(float(np.hypot(mean[..., 0], mean[..., 1]).max()), 1e-9)
    for axis, frame in zip(figure.axes, mean / top, strict=False):
        shown = np.hypot(frame[..., 0], frame[..., 1]) > _SHORTEST
        axis.quiver(
            1e3 * column[shown], 1e3 * row[shown], frame[shown, 0], frame[shown, 1],
            color="white", pivot="mid", angles="xy", scale_units="xy", width=0.006, headwidth=3.5,
            headlength=4.0, scale=_ARROWS / (_LONGEST * 1e3 * max(np.ptp(fields.column), 1e-6)),
        )  # fmt: skip
    return figure


def _block_means(
    fields: SkinFields, chosen: NDArray[np.int64]
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Return places (rows, columns) [m] and mean shear (frames, rows, columns, 2) of blocks."""
    side = max(-(-max(fields.shear.shape[1:3]) // _ARROWS), 1)
    rows, columns = (max(count // side, 1) for count in fields.shear.shape[1:3])
    parts = [part[: n * side] for part, n in ((fields.column, columns), (fields.row, rows))]
    column, row = np.meshgrid(*(part.reshape(-1, min(side, len(part))).mean(axis=1)
                                for part in parts))  # fmt: skip
    shear = fields.shear[chosen][:, : rows * side, : columns * side]
    blocks = shear.reshape(len(chosen), rows, shear.shape[1] // rows, columns, -1, 2)
    return column, row, np.asarray(blocks.mean(axis=(2, 4)))


def _chosen(fields: SkinFields, frames: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, len(fields.time) - 1, frames).round().astype(int))


def _pitch(axis: Array) -> float:
    """Return the distance of columns or rows [m]."""
    return float(axis[1] - axis[0]) if len(axis) > 1 else 1e-3


def _frames_figure(
    fields: SkinFields, values: Array, title: str, label: str, frames: int
) -> Figure:
    """Return frames of values (n, rows, columns) [Pa] on one scale of colours."""
    chosen = _chosen(fields, frames)
    touched = values[chosen][values[chosen] > 0.0]
    # A few taxels on steep flanks would leave the rest in the dark.
    top = 1e-3 * float(np.percentile(touched, _SHOWN)) if touched.size else 1e-9
    half = [0.5 * _pitch(axis) for axis in (fields.column, fields.row)]
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
                values[i] * 1e-3, origin="lower", extent=extent, cmap=_MAP, vmin=0.0,
                vmax=top, interpolation="nearest",
            )  # fmt: skip
            axis.set_title(f"{fields.time[i]:.3f} s")
            axis.grid(False)
        _show_touched(axes.flat[0], fields, fields.pressure[chosen], extent)
        for axis in axes.flat[len(chosen) :]:
            axis.set_axis_off()
        for axis in axes[-1]:
            axis.set_xlabel("along columns [mm]")
        for axis in axes[:, 0]:
            axis.set_ylabel("along rows [mm]")
        figure.colorbar(shown, ax=axes, label=label, shrink=0.8, extend="max")
        figure.suptitle(title, x=0.012, ha="left", fontsize=11, fontweight="bold")
    return figure


def _show_touched(axis: Any, fields: SkinFields, pressure: Array, extent: Array) -> None:
    """Show the square part of the grid that is touched in any of the frames, with a margin."""
    _, row, column = np.nonzero(pressure > 0.0)
    if not row.size:
        return
    places = [1e3 * fields.column[np.unique(column)], 1e3 * fields.row[np.unique(row)]]
    half = _MARGIN * max(0.5 * float(np.ptp(along)) for along in places)
    half = max(half, 2e3 * max(_pitch(fields.column), _pitch(fields.row)))
    ends = [0.5 * (along[0] + along[-1]) + half * np.array([-1.0, 1.0]) for along in places]
    axis.set_xlim(*np.clip(ends[0], extent[0], extent[1]))
    axis.set_ylim(*np.clip(ends[1], extent[2], extent[3]))


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
    top = _lightest("largest", largest, fields.pressure)
    with result_folder(Path(folder), overwrite=overwrite) as fresh:
        for i, pressure in enumerate(fields.pressure):
            imsave(fresh / f"{i:04d}.png", taxel_image(pressure, top))
    return len(fields.time)


def traction_images(
    recording: str | Path, folder: str | Path, *, pressure: float | None = None,
    shear: float | None = None, overwrite: bool = False,
) -> int:  # fmt: skip
    """Write every frame as an image of three channels, for tactile sensors' simulators.

    One pixel a taxel, rows upwards. Red is the shear along columns and green that along rows, 128
    for none and 127 more or less at the largest; blue is the pressure, from 0 to 255, 0 too where
    friction on a steep flank makes it negative. What a step of a channel is in Pa stands in
    `scale.json`.

    Parameters
    ----------
    recording : str or Path
        `recording.h5`, or the folder it is in.
    folder : str or Path
        For the images `0000.png` and so on, and for `scale.json`.
    pressure, shear : float, optional
        The largest pressure and shear [Pa], above 0; what is more is cut off. Default: those in
        the recording.
    overwrite : bool
        Whether to replace files in the folder.

    Returns
    -------
    int
        The number of images.

    Raises
    ------
    AsperityError
        The recording has no fields, or a value is not above 0.
    OutputError
        The folder cannot be written.
    """
    fields = read_fields(recording)
    steps = {
        "pressure": _lightest("pressure", pressure, fields.pressure) / 255.0,
        "shear": _lightest("shear", shear, np.abs(fields.shear)) / 127.0,
    }
    with result_folder(Path(folder), overwrite=overwrite) as fresh:
        for i, values in enumerate(zip(fields.shear, fields.pressure, strict=True)):
            levels = np.dstack([128.0 + values[0] / steps["shear"], values[1] / steps["pressure"]])
            levels[..., :2] = np.clip(levels[..., :2], 1.0, 255.0)
            image = np.clip(levels.round(), 0.0, 255.0).astype(np.uint8)
            Image.fromarray(np.ascontiguousarray(image[::-1])).save(fresh / f"{i:04d}.png")
        write_json(
            fresh / "scale.json",
            {
                "red": {"is": "shear along columns", "zero": 128, "step_pa": steps["shear"]},
                "green": {"is": "shear along rows", "zero": 128, "step_pa": steps["shear"]},
                "blue": {"is": "pressure", "zero": 0, "step_pa": steps["pressure"]},
                "time_s": fields.time.tolist(),
            },
        )
    return len(fields.time)


def _lightest(name: str, given: float | None, values: Array) -> float:
    """Return the value of the lightest colour [Pa]: the one given, or the largest there is."""
    if given is None:
        return max(float(values.max(initial=0.0)), 1e-9)
    if not given > 0.0:
        raise AsperityError(f"{name} must be above 0 Pa, got {given!r}")
    return given


def taxel_image(values: Array, largest: float, *, signed: bool = False) -> NDArray[np.uint8]:
    """Return an image (4 rows, 4 columns, 3) of values [Pa] (rows, columns); rows go upwards.

    Black where there is none and light at `largest`; signed values from blue over grey to red.
    """
    part = values[::-1] / largest
    colours = colormaps[_SIGNED](0.5 + 0.5 * part, bytes=True) if signed else colormaps[_MAP](
        np.clip(part, 0.0, 1.0), bytes=True
    )  # fmt: skip
    image = np.asarray(colours)[..., :3]
    return np.asarray(image.repeat(_ENLARGED, axis=0).repeat(_ENLARGED, axis=1))


def write_skin_pictures(folder: Path, name: str) -> None:
    """Write `pressure.png`, `shear.png` and images of each frame of the recording in a folder.

    Those in `pressure/` are coloured; those in `traction/` have three channels.
    """
    fields = read_fields(folder)
    save(pressure_figure(fields, name), folder, "pressure", ("png",))
    save(shear_figure(fields, name), folder, "shear", ("png",))
    pressure_images(folder, folder / "pressure")
    traction_images(folder, folder / "traction")
