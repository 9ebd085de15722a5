"""Errors and news, said in the page to the one who asked."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from asperity.errors import AsperityError


def attempt(event: Any, what: str, do: Callable[[], Any]) -> bool:
    """Do what a control asks for; say in that browser what came of it. Return whether it went well.

    Parameters
    ----------
    event : viser.GuiEvent
    what : str
        What is being done, in a few words.
    do : callable
        What it raises as `AsperityError` is shown; anything else is shown and logged.
    """
    try:
        do()
    except AsperityError as error:
        tell(event, what, str(error), "red")
    except Exception as error:  # a control must not leave its user without an answer
        logging.getLogger(__name__).exception("in the page: %s", what)
        tell(event, what, f"{type(error).__name__}: {' '.join(str(error).split())}", "red")
    else:
        return True
    return False


def tell(event: Any, title: str, text: str, colour: str) -> None:
    """Show a notification in the browser that an event comes from, if it is still there."""
    if event.client is not None:
        event.client.add_notification(title, text, color=colour, auto_close_seconds=12.0)


def is_asked(event: Any) -> bool:
    """Return whether a browser asked, and not the page itself, which sets values as well."""
    return event.client is not None
