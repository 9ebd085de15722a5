"""Buttons that send a dataset to the browser as a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.errors import AsperityError
from asperity.runs import export

if TYPE_CHECKING:
    import viser
    import xarray as xr

LARGEST = 200e6
"""Largest file that is sent through the page [bytes]."""


class Downloads:
    """Buttons for CSV, WAV and PNG, and for the recording itself.

    Parameters
    ----------
    dataset : callable
        Returns the dataset of `open_recording`; raises `AsperityError` if there is none.
    file : callable, optional
        Returns the recording's path.
    """

    def __init__(
        self, dataset: Callable[[], xr.Dataset], *, file: Callable[[], Path | None] | None = None
    ) -> None:
        self._dataset, self._file = dataset, file

    def build(self, server: viser.ViserServer) -> None:
        """Make the buttons."""
        import viser

        gui = server.gui
        made: list[tuple[str, Callable[[], tuple[str, bytes]]]] = [
            ("CSV, units in its header", self._csv),
            ("WAV of the acceleration", self._wav),
            ("PNG of the plots", lambda: self._png("traces")),
            ("PNG of the spectrum", lambda: self._png("spectrum")),
        ]
        if self._file is not None:
            made.append(("recording.h5", self._whole))
        for label, make in made:
            button = gui.add_button(label, icon=viser.Icon.DOWNLOAD)
            button.on_click(_sending(make))

    def _csv(self) -> tuple[str, bytes]:
        data = self._dataset()
        if data.nbytes > LARGEST / 2:
            raise AsperityError("too long for the page; use asperity export")
        return f"{_name(data)}.csv", export.csv_bytes(data)

    def _wav(self) -> tuple[str, bytes]:
        data = self._dataset()
        sound = export.sound_of(export.traces_of(data), source=_name(data))
        return f"{_name(data)}.wav", export.wav_bytes(sound)

    def _png(self, which: str) -> tuple[str, bytes]:
        data = self._dataset()
        figure = export.figures(export.traces_of(data), _name(data))[which]
        return f"{_name(data)}-{which}.png", export.png_bytes(figure)

    def _whole(self) -> tuple[str, bytes]:
        path = self._file() if self._file is not None else None
        if path is None or not path.is_file():
            raise AsperityError("nothing has been recorded yet")
        if path.stat().st_size > LARGEST:
            raise AsperityError(f"too large for the page; it is at {path}")
        return path.name, path.read_bytes()


def _name(data: xr.Dataset) -> str:
    return str(data.attrs.get("scene", "recording"))


def _sending(make: Callable[[], tuple[str, bytes]]) -> Callable[[Any], None]:
    """Return a callback that sends a file to the browser that clicked, or shows why it cannot."""

    def send(event: Any) -> None:
        if event.client is None:
            return
        try:
            name, content = make()
        except (AsperityError, OSError) as error:
            event.client.add_notification("No file", str(error), color="red")
            return
        event.client.send_file_download(name, content, save_immediately=True)

    return send
