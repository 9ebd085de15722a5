"""The instruments of the page: time, plots, roughness, recording and sound, on one timeline."""

from __future__ import annotations

from pathlib import Path

from asperity.viewer.panels.panel import Panel
from asperity.viewer.panels.plots import PlotsPanel
from asperity.viewer.panels.record import RecordPanel
from asperity.viewer.panels.roughness import RoughnessPanel
from asperity.viewer.panels.sound import SoundPanel
from asperity.viewer.panels.time import TimePanel
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import ShownLink, Timeline


def instruments(link: ServoClient, folder: Path) -> tuple[ShownLink, list[Panel]]:
    """Return the instruments of a running link, and the link that the page is to show with them.

    That link's latest moment is the one of the timeline, so that all of the page goes where the
    slider is. The panels come in the order of their tabs; that of the time has to be updated
    first.

    Parameters
    ----------
    link : Link
    folder : Path
        Where recordings go.
    """
    timeline = Timeline(link)
    return ShownLink(link, timeline), [
        TimePanel(timeline),
        RoughnessPanel(timeline),
        PlotsPanel(timeline),
        RecordPanel(timeline, folder),
        SoundPanel(timeline),
    ]
