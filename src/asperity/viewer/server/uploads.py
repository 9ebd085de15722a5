"""Files from a browser: data that is bounded and examined before it is decoded.

Nothing in a file is executed and no other file is opened for it: arrays are read without pickles,
materials of meshes are not followed, and a glTF file with external references is refused. An
archive (3MF) is bounded by its unpacked size and by the triangles of all its placed parts. A file
is stored under a generated name.
"""

from __future__ import annotations

import io
import json
import re
import struct
import tempfile
import zipfile
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Any

from asperity.errors import AsperityError
from asperity.geometry.mesh.files import read_contents
from asperity.texture.files.images import read_pixels

if TYPE_CHECKING:
    import viser


MAX_BYTES = 64 * 2**20
MAX_PIXELS = 2**24
"""Largest image or array: 4096 x 4096."""
MAX_TRIANGLES = 200_000
MAX_UNPACKED = 256 * 2**20
"""Largest size of an archive's contents [bytes]."""
MAX_FILES = 40
"""Largest number of files that a page keeps, as scenes may be read from them again."""
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".npy")
MESH_SUFFIXES = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf")


class Uploads:
    """A folder for uploads, deleted when it is closed."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="asperity-uploads-"))
        self._count = 0

    def image(self, name: str, content: bytes) -> Path:
        """Store an image or array of heights; return its path.

        Raises
        ------
        AsperityError
            The file is invalid; the message names what would be valid.
        """
        suffix = _suffix(name, content, IMAGE_SUFFIXES, "an image")
        pixels = _pixels(name, suffix, content)
        if not 16 <= pixels <= MAX_PIXELS:
            raise AsperityError(f"{_shown(name)} has {pixels} pixels; valid: 16 to {MAX_PIXELS}")
        path = self._kept(suffix, content)
        if suffix != ".npy":
            self._decoded(path, name)
        return path

    def mesh(self, name: str, content: bytes) -> Path:
        """Store a mesh; return its path. Raises as `image` does."""
        suffix = _suffix(name, content, MESH_SUFFIXES, "a mesh")
        _check_triangles(name, _triangles(name, suffix, content))
        path = self._kept(suffix, content)
        if suffix == ".3mf":  # which may place one object many times
            try:
                parts = read_contents(path).parts
                _check_triangles(name, sum(len(part.corners.faces) for part in parts))
            except AsperityError as error:
                path.unlink()
                raise AsperityError(str(error).replace(str(path), _shown(name))) from None
        return path

    def close(self) -> None:
        """Delete all files."""
        rmtree(self._folder, ignore_errors=True)

    def _kept(self, suffix: str, content: bytes) -> Path:
        if self._count >= MAX_FILES:
            raise AsperityError(f"{MAX_FILES} files have been uploaded; open a new page")
        self._count += 1
        path = self._folder / f"upload-{self._count}{suffix}"
        path.write_bytes(content)
        return path

    def _decoded(self, path: Path, name: str) -> None:
        try:
            read_pixels(path)
        except Exception as error:  # readers raise many kinds for damaged files
            path.unlink()
            reason = " ".join(str(error).split())[:160] or type(error).__name__
            reason = reason.replace(str(path), "").strip(" :")
            raise AsperityError(f"{_shown(name)} cannot be read: {reason}") from None


def _shown(name: str) -> str:
    """Return a file's name in a form that is safe to show: it comes from outside."""
    return re.sub(r"[^\w. -]", "_", Path(name).name)[:60] or "the file"


def _check_triangles(name: str, count: int) -> None:
    if count > MAX_TRIANGLES:
        raise AsperityError(
            f"{_shown(name)} has {count} triangles; valid: {MAX_TRIANGLES} at most; "
            "asperity bake makes fewer of them"
        )


def _suffix(name: str, content: bytes, valid: tuple[str, ...], what: str) -> str:
    suffix = Path(name).suffix.lower()
    if suffix not in valid:
        raise AsperityError(f"{_shown(name)} is no {what.split()[-1]}; valid: {', '.join(valid)}")
    if not content:
        raise AsperityError(f"{_shown(name)} is empty")
    if len(content) > MAX_BYTES:
        raise AsperityError(
            f"{_shown(name)} has {len(content) / 2**20:.0f} MB; valid: {MAX_BYTES // 2**20} MB"
        )
    return suffix


def _pixels(name: str, suffix: str, content: bytes) -> int:
    """Return the number of pixels in an image's header, without decoding it."""
    try:
        if suffix == ".npy":
            return _samples(content)
        if suffix in (".tif", ".tiff"):
            import tifffile

            with tifffile.TiffFile(io.BytesIO(content)) as file:
                shape = file.pages[0].shape
            return int(shape[0]) * int(shape[1])
        from PIL import Image

        with Image.open(io.BytesIO(content)) as image:
            return int(image.size[0]) * int(image.size[1])
    except AsperityError:
        raise
    except Exception:  # readers raise many kinds for damaged headers
        raise AsperityError(f"{_shown(name)} is not a {suffix} file, or damaged") from None


def _samples(content: bytes) -> int:
    from numpy.lib import format as npy

    file = io.BytesIO(content)
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    if dtype.hasobject:
        raise AsperityError("an array of objects is not an array of heights")
    count = 1
    for length in shape:
        count *= int(length)
    if len(content) - file.tell() < count * dtype.itemsize:
        raise AsperityError("the array is truncated")
    return count


def _triangles(name: str, suffix: str, content: bytes) -> int:
    """Return about how many triangles a mesh has, from its header, without reading it."""
    try:
        if suffix == ".stl":
            if content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:1000]:
                return content.count(b"endfacet")
            return int(struct.unpack("<I", content[80:84])[0])
        if suffix == ".obj":
            return len(re.findall(rb"^f\s", content, flags=re.MULTILINE))
        if suffix == ".ply":
            head = content[: content.index(b"end_header")]
            found = re.search(rb"element\s+face\s+(\d+)", head)
            return int(found.group(1)) if found else 0
        if suffix == ".off":
            return len(re.findall(rb"^\s*[3-9]\s+\d", content, flags=re.MULTILINE))
        if suffix == ".3mf":
            return _triangles_of_3mf(name, content)
        return _triangles_of_gltf(name, content)
    except AsperityError:
        raise
    except (ValueError, IndexError, KeyError, TypeError, struct.error, zipfile.BadZipFile):
        raise AsperityError(f"{_shown(name)} is not a {suffix} file, or damaged") from None


def _triangles_of_3mf(name: str, content: bytes) -> int:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = archive.infolist()
        size = sum(member.file_size for member in members)
        if size > MAX_UNPACKED:
            raise AsperityError(
                f"{_shown(name)} has {size / 2**20:.0f} MB unpacked; "
                f"valid: {MAX_UNPACKED // 2**20} MB"
            )
        models = [archive.read(m) for m in members if m.filename.lower().endswith(".model")]
    return sum(len(re.findall(rb"<(?:\w+:)?triangle\s", model)) for model in models)


def _triangles_of_gltf(name: str, content: bytes) -> int:
    if content[:4] == b"glTF":
        (size,) = struct.unpack("<I", content[12:16])
        content = content[20 : 20 + size]
    tree: dict[str, Any] = json.loads(content)
    for part in (*tree.get("buffers", []), *tree.get("images", [])):
        if not str(part.get("uri", "data:")).startswith("data:"):
            raise AsperityError(f"{_shown(name)} refers to other files; export it as one GLB")
    accessors, count = tree.get("accessors", []), 0
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            at = primitive.get("indices", primitive.get("attributes", {}).get("POSITION"))
            count += int(accessors[at]["count"]) // 3 if at is not None else 0
    return count


AT_ONCE = 4
"""Largest number of uploads at a time."""
_SMALLEST_PART = 1024
"""Smallest average size of a part [bytes]."""


def bound_uploads(server: viser.ViserServer) -> None:
    """Make a server refuse uploads of more than `MAX_BYTES`, before a file is examined.

    viser collects the parts of a file until all have come, however many a browser announces. Here a
    file that is announced as too large is refused, one that turns out larger than announced is
    dropped, and so are more files at a time than a person would upload.
    """
    from viser import _messages as messages

    gui: Any = server.gui
    socket = gui._websock_interface

    def refuse(client_id: int, text: str) -> None:
        client = gui._resolve_client(client_id)
        if client is not None:
            client.add_notification("Upload", text, color="red", auto_close_seconds=12.0)

    def start(client_id: int, message: Any) -> None:
        size, parts = message.size_bytes, message.part_count
        if not 0 <= size <= MAX_BYTES:
            refuse(client_id, f"{size / 2**20:.0f} MB; valid: at most {MAX_BYTES / 2**20:.0f} MB")
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
