"""The acceleration as sound: the last seconds as an audio clip, and live."""

from __future__ import annotations

import base64
import html

from asperity.drawing.pages import render
from asperity.errors import AsperityError
from asperity.runs import export
from asperity.viewer.live_sound import LiveSound
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.panels.plots import traces_of_ticks
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import Timeline

_LENGTHS = {"2 s": 2.0, "5 s": 5.0, "10 s": 10.0, "20 s": 20.0}
_RATE = 44100
_WHAT = (
    "The tool's acceleration, its three axes combined; the loudest sample is 1 dB below full "
    "scale. A loop at 1 kHz contains frequencies below 500 Hz, of which small loudspeakers play "
    "little and headphones more."
)
_LIVE = "Played by the computer that runs the loop, not by the browser."
_EVERY = 10


class SoundPanel(Panel):
    """An audio clip of what the timeline shows, and a switch for live sound.

    Parameters
    ----------
    timeline : Timeline
    live : bool
        Whether there is a loop to listen to.
    """

    title = "Record"

    def __init__(self, timeline: Timeline, *, live: bool = True) -> None:
        self._timeline, self._can_be_live = timeline, live
        self._live: LiveSound | None = None

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the controls."""
        self._servo, gui = servo, server.gui
        with gui.add_folder("Sound"):
            self._length = gui.add_dropdown("Length", tuple(_LENGTHS), initial_value="5 s")
            button = gui.add_button("Make a clip of what is shown", icon="wave-sine")
            button.on_click(lambda _: self.make())
            self._audio = gui.add_html("")
            gui.add_markdown(_WHAT)
        if not self._can_be_live:
            return
        with gui.add_folder("Sound, live through this computer"):
            missing = LiveSound.missing()
            self._switch = gui.add_checkbox("Play", False, disabled=bool(missing))
            self._full = gui.add_slider(
                "Full scale [m/s²]", 1.0, 500.0, 1.0, 50.0, disabled=bool(missing),
                hint="Loudest acceleration; larger values are limited smoothly.",
            )  # fmt: skip
            self._message = gui.add_markdown(missing or _LIVE)
        self._switch.on_update(lambda _: self._switched())
        self._full.on_update(lambda _: self._scaled())

    def update(self, frame: Frame) -> None:
        """Show the state of the live sound."""
        live = self._live
        if live is not None and frame.number % _EVERY == 0:
            message = f"Playing at {live.rate:g} Hz, {live.delay * 1e3:.0f} ms behind the loop."
            if live.limited:
                message += f" {live.limited:.0%} of the last second was limited."
            if self._message.content != message:
                self._message.content = message

    def close(self) -> None:
        """End the live sound."""
        live, self._live = self._live, None
        if live is not None:
            live.close()

    def make(self) -> None:
        """Add an audio clip of the shown seconds to the page."""
        ticks = self._timeline.window(_LENGTHS[self._length.value])
        try:
            sound = export.sound_of(traces_of_ticks(ticks), rate=_RATE)
        except AsperityError as error:
            self._audio.content = f"<em>{html.escape(str(error))}</em>"
            return
        seconds = sound.samples.size / sound.rate
        data = base64.b64encode(export.wav_bytes(sound)).decode()
        self._audio.content = render("live_clip.html", data=data, seconds=seconds, gain=sound.gain)

    def _switched(self) -> None:
        self.close()
        if not self._switch.value:
            self._message.content = _LIVE
            return
        try:
            self._live = LiveSound(self._servo, full_scale=float(self._full.value))
        except AsperityError as error:
            self._message.content = f"**{error}**"
            self._switch.value = False

    def _scaled(self) -> None:
        if self._live is not None:
            self._live.full_scale = float(self._full.value)
