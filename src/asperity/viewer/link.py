"""A link that reproduces a built-in scene with the present settings, and saving them as a scene.

Opening a link changes nothing by itself: the page asks first. Otherwise any page of the web could
change a running loop by leading a browser here. Nor does it open files.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

from asperity.errors import AsperityError
from asperity.realtime.servo.parameters import LiveParameters
from asperity.scene.builtin import SCENES, load_scene
from asperity.scene.scene import Scene
from asperity.viewer.changes import on_coupling
from asperity.viewer.session_config import SessionConfig

_LONGEST = 8000
"""Longest query that is taken [characters]."""


def scene_as_felt(config: SessionConfig, parameters: LiveParameters) -> Scene:
    """Return a session's scene with the present stiffness, friction and coupling."""
    stiffness = "stiffness" if parameters.is_direct else "object_stiffness"
    coupling = {k: v for k, v in parameters.plain()["coupling"].items() if v is not None}
    force = {stiffness: parameters.stiffness, "friction": parameters.friction}
    return config.scene.changed(force=force, coupling=coupling)


def query_of(config: SessionConfig, parameters: LiveParameters) -> str:
    """Return the query of a link to the present scene and settings.

    Raises
    ------
    AsperityError
        The scene is not a built-in one, or has files.
    """
    if config.source not in SCENES:
        raise AsperityError("a link reproduces built-in scenes only; use Save scene")
    own = on_coupling(load_scene(config.source)).document
    settings = _difference(own, scene_as_felt(config, parameters).document)
    if "file" in _keys(settings):
        raise AsperityError("a link cannot carry files; use Save scene")
    query = {"scene": config.source, "rate": f"{parameters.rate:g}"}
    if settings:
        query["settings"] = json.dumps(settings, separators=(",", ":"))
    return urlencode(query)


def linked(config: SessionConfig, query: str) -> SessionConfig:
    """Return the session that a link asks for; AsperityError if it is not a valid one."""
    given = {name: values[-1] for name, values in parse_qs(query).items()}
    name = given.get("scene", "")
    if name not in SCENES:
        raise AsperityError(
            f"the link names no built-in scene: {name!r}; valid: {', '.join(SCENES)}"
        )
    try:
        rate = float(given.get("rate", config.rate))
        settings = json.loads(given.get("settings", "{}"))
    except ValueError:
        raise AsperityError("the link is damaged: its settings cannot be read") from None
    if not isinstance(settings, dict) or "file" in _keys(settings):
        raise AsperityError("the link is damaged, or names files, which a link may not")
    scene = on_coupling(load_scene(name))
    if settings:
        scene = scene.changed(**settings)
    return replace(config, scene=scene, source=name, rate=rate)


class LinkRequests:
    """Notes which link a browser has opened, for the page to ask about."""

    def __init__(self) -> None:
        self._query = ""

    def watching(self, check: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Return a check of requests that also notes their links; see `access.guarded`."""

        def watched(connection: Any, request: Any) -> Any:
            answer = check(connection, request)
            query = urlsplit(request.path).query
            if answer is None and len(query) < _LONGEST and "scene" in parse_qs(query):
                self._query = query
            return answer

        return watched

    def take(self) -> str:
        """Return the query of the link that was opened last, once; else ""."""
        query, self._query = self._query, ""
        return query


def _difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `Scene.changed` makes the document `new` of `old`."""
    out: dict[str, Any] = {}
    for key in {**old, **new}:
        before, after = old.get(key), new.get(key)
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            inner = _difference(before, after)
            if inner:
                out[key] = inner
        elif before != after:
            out[key] = after
    return out


def _keys(table: Any) -> set[str]:
    if isinstance(table, Mapping):
        return set(table).union(*(_keys(value) for value in table.values()))
    if isinstance(table, list | tuple):
        return set().union(*(_keys(value) for value in table))
    return set()
