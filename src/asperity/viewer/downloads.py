"""Buttons that send a dataset to the browser as a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.errors import AsperityError
from asperity.runs import export
from asperity.viewer.notify import attempt

if TYPE_CHECKING:
    import xarray as xr

LARGEST = 200e6
"""Largest file that is sent through the page [bytes]."""


def add_downloads(
    gui: Any, dataset: Callable[[], xr.Dataset], *, file: Callable[[], Path | None] | None = None
) -> None:
    """Add buttons for CSV, WAV and PNG, and for the recording itself.

    Parameters
    ----------
    gui : viser.GuiApi
    dataset : callable
        Returns the dataset of `open_recording`; raises `AsperityError` if there is none.
    file : callable, optional
        Returns the recording's path.
    """

    def add(label: str, make: Callable[[], tuple[str, bytes]]) -> None:
        button = gui.add_button(label, icon="download")
        button.on_click(lambda event: attempt(event, "No file", lambda: _send(event, *make())))

    add("CSV, units in its header", lambda: _csv(dataset()))
    add("WAV of the acceleration", lambda: _wav(dataset()))
    add("PNG of the plots", lambda: _png(dataset(), "traces"))
    add("PNG of the spectrum", lambda: _png(dataset(), "spectrum"))
    if file is not None:
        add("recording.h5", lambda: _whole(file()))


def _csv(data: xr.Dataset) -> tuple[str, bytes]:
    if data.nbytes > LARGEST / 2:
        raise AsperityError("too long for the page; use asperity export")
    return f"{_name(data)}.csv", export.csv_bytes(data)


def _wav(data: xr.Dataset) -> tuple[str, bytes]:
    sound = export.sound_of(export.traces_of(data), source=_name(data))
    return f"{_name(data)}.wav", export.wav_bytes(sound)


def _png(data: xr.Dataset, which: str) -> tuple[str, bytes]:
    figure = export.figures(export.traces_of(data), _name(data))[which]
    return f"{_name(data)}-{which}.png", export.png_bytes(figure)


def _whole(path: Path | None) -> tuple[str, bytes]:
    if path is None or not path.is_file():
        raise AsperityError("nothing has been recorded yet")
    if path.stat().st_size > LARGEST:
        raise AsperityError(f"too large for the page; it is at {path}")
    return path.name, path.read_bytes()


def _name(data: xr.Dataset) -> str:
    return str(data.attrs.get("scene", "recording"))


def _send(event: Any, name: str, content: bytes) -> None:
    if event.client is not None:
        event.client.send_file_download(name, content, save_immediately=True)
