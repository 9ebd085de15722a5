"""A bound on what viser takes into memory of an upload, before it is looked at.

viser gathers the parts of a file until all are there, however many a browser says there are. Here
a file that says it is too large is not begun, one that turns out larger than it said is dropped,
and so are more files at a time than a person could drop.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asperity.viewer.server.uploads import MOST_BYTES

if TYPE_CHECKING:
    import viser

AT_ONCE = 4
"""Uploads that are under way at the same time, at most."""
_SMALLEST_PART = 1024
"""Bytes of a part, on average, at least."""


def bound_uploads(server: viser.ViserServer, most: int = MOST_BYTES) -> None:
    """Have a server refuse uploads of more than `most` bytes."""
    from viser import _messages as messages

    gui: Any = server.gui
    socket = gui._websock_interface

    def refuse(client_id: int, text: str) -> None:
        client = gui._resolve_client(client_id)
        if client is not None:
            client.add_notification("Upload", text, color="red", auto_close_seconds=12.0)

    def start(client_id: int, message: Any) -> None:
        size, parts = message.size_bytes, message.part_count
        if not 0 <= size <= most:
            refuse(client_id, f"{size / 2**20:.0f} MB; valid: at most {most / 2**20:.0f} MB")
        elif not 0 <= parts <= 1 + size // _SMALLEST_PART:
            refuse(client_id, f"{size} bytes in {parts} parts are no upload")
        elif len(gui._current_file_upload_states) >= AT_ONCE:
            refuse(client_id, f"{AT_ONCE} uploads are under way; wait for one of them")
        else:
            gui._handle_file_transfer_start(client_id, message)

    def part(client_id: int, message: Any) -> None:
        state = gui._current_file_upload_states.get(message.transfer_uuid)
        if state is None:
            return
        if state["transferred_bytes"] + len(message.content) > state["total_bytes"]:
            gui._current_file_upload_states.pop(message.transfer_uuid, None)
            refuse(client_id, "more came than was said; dropped")
            return
        gui._handle_file_transfer_part(client_id, message)

    for kind, ours, theirs in (
        (messages.FileTransferStartUpload, start, gui._handle_file_transfer_start),
        (messages.FileTransferPart, part, gui._handle_file_transfer_part),
    ):
        socket.unregister_handler(kind, theirs)
        socket.register_handler(kind, ours)
