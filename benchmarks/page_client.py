"""A tab that nobody looks at: it speaks viser's own protocol over a websocket, and draws nothing.

For tests and benchmarks of the page: it sends what a browser would send, and counts what comes.
"""

from __future__ import annotations

import struct
import threading
import time
from typing import Any

import msgspec
import viser
import zstandard
from viser import _messages as messages
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect


class ScriptedTab:
    """A connection to a page; a context manager.

    Parameters
    ----------
    url : str
        Of the page, http://...
    """

    def __init__(self, url: str) -> None:
        self._socket = connect(
            url.replace("http", "ws", 1), origin=url, max_size=2**27,
            subprotocols=[f"viser-v{viser.__version__}"],
        )  # fmt: skip
        self.updates: list[float] = []
        """When the pose of the tool was told [s]."""
        self.notes: list[tuple[str, str]] = []
        """Notifications: title and text."""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        self.send(
            messages.ViewerCameraMessage(
                (1.0, 0.0, 0.0, 0.0), (10.0, -10.0, 10.0), 0.6, 0.01, 1000.0, 600, 800,
                (0.0, 0.0, 0.0), (0.0, 0.0, 1.0),
            )
        )  # fmt: skip

    def send(self, message: Any) -> None:
        """Send one of viser's messages."""
        self._socket.send(msgspec.msgpack.encode(message.as_serializable_dict()))

    def set(self, handle: Any, value: Any) -> None:
        """Set a control's value, as a click or a key would."""
        self.send(messages.GuiUpdateMessage(handle._impl.uuid, {"value": value}))

    def press(self, handle: Any) -> None:
        """Press a button."""
        self.set(handle, True)

    def drag(self, name: str, position: Any, wxyz: Any = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Drag a gizmo to a place."""
        self.send(
            messages.TransformControlsUpdateMessage(
                name, tuple(map(float, wxyz)), tuple(map(float, position))
            )
        )

    def upload(self, handle: Any, name: str, content: bytes, size: int | None = None) -> None:
        """Drop a file; `size` is what is said of it, by default the truth."""
        uuid, part = f"{time.perf_counter_ns()}", 2**19
        parts = [content[i : i + part] for i in range(0, len(content), part)]
        target = handle._impl.uuid
        self.send(
            messages.FileTransferStartUpload(
                target, uuid, name, "application/octet-stream", len(parts),
                len(content) if size is None else size,
            )
        )  # fmt: skip
        for i, data in enumerate(parts):
            self.send(messages.FileTransferPart(target, uuid, i, data))

    def close(self) -> None:
        """Close the tab."""
        self._socket.close()
        self._thread.join(5.0)

    def __enter__(self) -> ScriptedTab:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self) -> None:
        inflate = zstandard.ZstdDecompressor()
        while True:
            try:
                raw = self._socket.recv()
            except ConnectionClosed:
                return
            size, packed = struct.unpack("<QQ", raw[:16])
            told = msgspec.msgpack.decode(
                inflate.decompress(raw[16 : 16 + packed], max_output_size=size)
            )
            for message in told["messages"]:
                if message["type"] == "SetPositionMessage" and message["name"] == "/tool":
                    self.updates.append(time.perf_counter())
                elif message["type"] == "NotificationShowMessage" or "Notification" in str(
                    message["type"]
                ):
                    props = message.get("props", {})
                    self.notes.append((props.get("title", ""), props.get("body", "")))
