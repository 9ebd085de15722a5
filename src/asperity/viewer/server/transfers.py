"""Limits on uploads while viser receives them, before a file is examined.

viser collects the parts of a file until all have come, however many a browser announces. Here a
file that is announced as too large is refused, one that turns out larger than announced is dropped,
and so are more files at a time than a person would upload.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asperity.viewer.server.uploads import MAX_BYTES

if TYPE_CHECKING:
    import viser

AT_ONCE = 4
"""Largest number of uploads at a time."""
_SMALLEST_PART = 1024
"""Smallest average size of a part [bytes]."""


def bound_uploads(server: viser.ViserServer, most: int = MAX_BYTES) -> None:
    """Make a server refuse uploads of more than `most` bytes."""
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
            refuse(client_id, f"{size} bytes in {parts} parts: not a valid upload")
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
            refuse(client_id, "the file is larger than announced; dropped")
            return
        gui._handle_file_transfer_part(client_id, message)

    for kind, bounded, original in (
        (messages.FileTransferStartUpload, start, gui._handle_file_transfer_start),
        (messages.FileTransferPart, part, gui._handle_file_transfer_part),
    ):
        socket.unregister_handler(kind, original)
        socket.register_handler(kind, bounded)
