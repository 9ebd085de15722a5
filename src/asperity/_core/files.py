"""Reading of users' files: what is wrong with one is said in one line that names it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from asperity.errors import AsperityError


@contextmanager
def reading(
    path: Path,
    contents: str,
    suffixes: Sequence[str],
    *,
    valid: str = "",
    error: type[AsperityError] = AsperityError,
) -> Iterator[str]:
    """Check that `path` is a file of a known kind; turn what its reader raises into one line.

    Parameters
    ----------
    path : Path
    contents : str
        What the file should hold, for messages.
    suffixes : sequence of str
        In lower case; the context is the one that the file has.
    valid : str
        Description of the valid kinds of file; by default the suffixes.
    error : type
        Of the error to raise; an `AsperityError` of the reader is left as it is.
    """

    def refuse(reason: str) -> NoReturn:
        raise error(f"{path}: {reason}") from None

    suffix = path.suffix.lower()
    try:
        if not path.exists():
            refuse("there is no such file")
        if path.is_dir():
            refuse(f"this is a folder; valid: a file of {contents}")
        if suffix not in suffixes:
            refuse(f"unknown kind of file {suffix!r}; valid: {valid or ', '.join(suffixes)}")
        if path.stat().st_size == 0:
            refuse("the file is empty")
        yield suffix
    except AsperityError:
        raise
    except MemoryError:
        refuse("too large for this computer's memory")
    except Exception as caught:  # any exception of a reader on a damaged file
        reason = " ".join(str(caught).split())[:200] or type(caught).__name__
        refuse(f"cannot be read as a {suffix} file: {reason}")
