"""Notifications in the browser whose user acted: errors, and the outcome of an action."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from asperity.errors import AsperityError


def attempt(event: Any, what: str, do: Callable[[], Any]) -> bool:
    """Carry out a user's action; show an error in its browser. Return whether it succeeded.

    Parameters
    ----------
    event : viser.GuiEvent
    what : str
        Title of the notification.
    do : callable
        An `AsperityError` that it raises is shown; any other exception is shown and logged.
    """
    try:
        do()
    except AsperityError as error:
        notify(event, what, str(error), "red")
    except Exception as error:  # the user of a control has to see any error
        logging.getLogger(__name__).exception("in the page: %s", what)
        notify(event, what, f"{type(error).__name__}: {' '.join(str(error).split())}", "red")
    else:
        return True
    return False


def notify(event: Any, title: str, text: str, colour: str) -> None:
    """Show a notification in the browser that an event comes from, if it is still there."""
    if event.client is not None:
        event.client.add_notification(title, text, color=colour, auto_close_seconds=12.0)


def from_browser(event: Any) -> bool:
    """Return whether an event comes from a browser, not from the page setting a value."""
    return event.client is not None
