"""The live page: all panels on one servo client, behind a token if other computers may reach it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from asperity.viewer.drawables.shapes import TRIANGLES
from asperity.viewer.link import LinkRequests
from asperity.viewer.panels.actions import ActionsPanel
from asperity.viewer.panels.controls import ControlsPanel
from asperity.viewer.panels.light import LightPanel
from asperity.viewer.panels.mouse import MousePanel
from asperity.viewer.panels.panel import Panel
from asperity.viewer.panels.plots import PlotsPanel
from asperity.viewer.panels.record import RecordPanel
from asperity.viewer.panels.roughness import RoughnessPanel
from asperity.viewer.panels.scene_view import SceneView
from asperity.viewer.panels.skin import SkinPanel
from asperity.viewer.panels.sound import SoundPanel
from asperity.viewer.panels.status import StatusPanel
from asperity.viewer.panels.stimuli import StimuliPanel
from asperity.viewer.panels.textures import TexturesPanel
from asperity.viewer.panels.time import TimePanel
from asperity.viewer.server.server import LOCAL, OpenServer, Page, serve
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.timeline import Timeline, TimelineClient


@contextmanager
def live_page(
    servo: ServoClient, folder: Path, triangles: int, *, host: str = LOCAL, port: int = 8080,
    at: OpenServer | None = None,
) -> Iterator[Page]:  # fmt: skip
    """Serve the page of a loop until the block ends.

    Parameters
    ----------
    servo : ServoClient
        Started, or to be started: until then the page shows the scene and that the loop starts.
    folder : Path
        Where recordings go.
    triangles : int
        Largest number of triangles shown.
    host, port : str, int
        At any address but the loopback, a token is required; `Page.notice` names what this exposes.
    at : OpenServer, optional
        In place of host and port.
    """
    client, panels = instrument_panels(servo, folder)
    shown: Any = client  # has all attributes of a ServoClient
    timeline = client.timeline
    links = (at.links if at else None) or LinkRequests()

    def made() -> list[Panel]:
        first = live_panels(triangles, timeline=timeline, links=links, folder=folder)
        return [*first, *panels]

    with serve(shown, made, host=host, port=port, links=links, at=at) as page:
        yield page


def live_panels(
    triangles: int = TRIANGLES,
    *,
    timeline: Timeline | None = None,
    links: LinkRequests | None = None,
    folder: Path = Path("out/view"),
) -> list[Panel]:
    """Return the panels that control a running loop, in the order of their tabs.

    The scene comes last: showing another scene takes a while, which the controls need not wait for.

    Parameters
    ----------
    triangles : int
        Largest number of triangles shown.
    timeline : Timeline, optional
        That can be paused.
    links : LinkRequests, optional
        Links that browsers open.
    folder : Path
        Where scenes are saved.
    """
    mouse, view = MousePanel(), SceneView(triangles)
    return [
        StatusPanel(timeline), ActionsPanel(mouse, view, timeline, links, folder), mouse,
        ControlsPanel(), StimuliPanel(), TexturesPanel(view), view, LightPanel(),
    ]  # fmt: skip


def instrument_panels(servo: ServoClient, folder: Path) -> tuple[TimelineClient, list[Panel]]:
    """Return the panels that measure a running loop, and the client to show with them.

    That client's latest snapshot is the timeline's, so the whole page follows the time slider.

    Parameters
    ----------
    servo : ServoClient
    folder : Path
        Where recordings go.

    Returns
    -------
    client : TimelineClient
    panels : list of Panel
        In the order of their tabs; the time panel has to be updated first.
    """
    timeline = Timeline(servo)
    return TimelineClient(servo, timeline), [
        TimePanel(timeline),
        SkinPanel(),
        RoughnessPanel(timeline),
        PlotsPanel(timeline),
        RecordPanel(timeline, folder),
        SoundPanel(timeline),
    ]
