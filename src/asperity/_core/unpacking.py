"""Files that gzip or zip has packed: the one place where they are unpacked."""

from __future__ import annotations

import atexit
import gzip
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from shutil import rmtree
from tempfile import mkdtemp

from asperity.errors import AsperityError

MOST_UNPACKED = 2**28
"""Bytes that a packed file may have, unpacked."""
_GZIP = b"\x1f\x8b"
_PACKERS = (".gz", ".zip")
_UNZIPPED: dict[tuple[Path, int, int], Path] = {}
"""Folders of what zips held, by path, time and size of the zip."""


def content_of(path: Path, most: int | None = None) -> bytes:
    """Return the bytes of a file, or the first `most` of them; unpacked if gzip packed them.

    Raises
    ------
    AsperityError
        A packed file that is damaged, or larger than `MOST_UNPACKED` when unpacked.
    """
    with path.open("rb") as file:
        if file.read(2) != _GZIP:
            file.seek(0)
            return file.read() if most is None else file.read(most)
    why = f"has more than {MOST_UNPACKED >> 20} MiB"
    try:
        with gzip.open(path) as packed:
            data = packed.read(MOST_UNPACKED + 1 if most is None else most)
        if len(data) <= MOST_UNPACKED:
            return data
    except EOFError:
        why = "is cut short"
    except (OSError, zlib.error):
        raise AsperityError(f"{path}: it is damaged: gzip cannot unpack it") from None
    raise AsperityError(f"{path}: unpacked it {why}; valid: a file that is not packed")


def unzipped(path: Path) -> Path:
    """Return a folder with the files that a zip holds, which lasts as long as this process.

    Raises
    ------
    AsperityError
        A zip of more than `MOST_UNPACKED` bytes, or with names of files outside of itself.
    """
    status = path.stat()
    key = (path.absolute(), status.st_mtime_ns, status.st_size)
    if key in _UNZIPPED:
        return _UNZIPPED[key]
    with zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
        size = sum(member.file_size for member in members)
        if size > MOST_UNPACKED:
            raise AsperityError(
                f"{path}: unpacked it has {size >> 20} MiB; valid: {MOST_UNPACKED >> 20} at most, "
                "or a file that is not packed"
            )
        for member in members:
            name = PurePosixPath(member.filename.replace("\\", "/"))
            if name.is_absolute() or ".." in name.parts or ":" in member.filename:
                raise AsperityError(
                    f"{path}: it holds {member.filename[:80]!r}; valid: names of files within it"
                )
        folder = Path(mkdtemp(prefix="asperity-"))
        atexit.register(rmtree, folder, ignore_errors=True)
        for member in members:
            archive.extract(member, folder)  # no more bytes than its head states
    _UNZIPPED[key] = folder
    return folder


def suffix_of(path: Path, packed: Sequence[str] = ()) -> str:
    """Return the suffix of a file in lower case; behind it `.gz` is left out of those `packed`."""
    suffix = path.suffix.lower()
    if suffix != ".gz":
        return suffix
    inner = Path(path.stem).suffix.lower()
    return inner if inner in packed else suffix


def stem_and_ending(path: Path) -> tuple[str, str]:
    """Return a file's name in two parts: the last has the suffix, of packed ones that before too.

    >>> stem_and_ending(Path("part.stl.gz"))
    ('part', '.stl.gz')
    """
    ending = path.suffix
    if ending.lower() in _PACKERS:
        ending = Path(path.stem).suffix + ending
    return path.name.removesuffix(ending), ending
