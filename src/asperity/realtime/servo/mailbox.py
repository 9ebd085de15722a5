"""Parameters on their way down to the loop: whole, and only between ticks.

A shared file with room for one text. The sender writes the text and then its number; the loop looks
at the number after each tick, which costs less than a microsecond, and takes the text when it has
changed. The loop never answers here. It also learns here that it shall stop.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from asperity.errors import AsperityError
from asperity.realtime.shared_file import SharedFile

ROOM = 16_000
"""Bytes of text, at most."""
_NUMBER, _LENGTH, _STOP, _GO = 0, 8, 9, 10
_HEADER = 16


class Mailbox:
    """Both ends: `send` and `stop` above, `news` and `must_stop` below.

    Parameters
    ----------
    path : Path
    create : bool
        Make the file. Default: open the one there is.
    """

    def __init__(self, path: Path, *, create: bool = False) -> None:
        self._file = SharedFile(path, 8 * _HEADER + ROOM if create else None)
        self._header = self._file.array(np.int64, _HEADER, 0)
        self._text = self._file.array(np.uint8, ROOM, 8 * _HEADER)
        self._seen = 0

    def send(self, parameters: Mapping[str, Any]) -> None:
        """Let the loop have parameters; what it has not taken yet is replaced."""
        text = json.dumps(parameters).encode()
        if len(text) > ROOM:
            raise AsperityError(f"parameters of {len(text)} bytes; there is room for {ROOM}")
        number = int(self._header[_NUMBER])
        # Odd: being written.
        self._header[_NUMBER] = number + 1
        self._header[_LENGTH] = len(text)
        self._text[: len(text)] = np.frombuffer(text, np.uint8)
        self._header[_NUMBER] = number + 2

    def news(self) -> dict[str, Any] | None:
        """Return parameters that were not seen yet, or None. Never waits."""
        number = int(self._header[_NUMBER])
        if number == self._seen or number % 2:
            return None
        text = self._text[: int(self._header[_LENGTH])].tobytes()
        if int(self._header[_NUMBER]) != number:
            return None
        self._seen = number
        taken: dict[str, Any] = json.loads(text)
        return taken

    def stop(self) -> None:
        """Let the loop stop."""
        self._header[_STOP] = 1

    def go(self) -> None:
        """Let a loop that is held begin."""
        self._header[_GO] = 1

    @property
    def may_go(self) -> bool:
        """Whether a loop that is held may begin."""
        return bool(self._header[_GO])

    @property
    def must_stop(self) -> bool:
        """Whether the loop shall stop."""
        return bool(self._header[_STOP])
