"""Contents of a file of heights by its kind, before a scale is chosen for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path

from asperity._core.files import reading
from asperity._core.spreadsheets import SHEETS
from asperity._core.text_form import decoded
from asperity._core.unpacking import content_of, suffix_of
from asperity.errors import SurfaceError
from asperity.texture.files.arrays import ARRAY_SUFFIXES, load_npy, load_npz
from asperity.texture.files.gwyddion_field import load_field
from asperity.texture.files.images import IMAGE_SUFFIXES, PreviewOnlyError, read_image
from asperity.texture.files.instruments import INSTRUMENT_SUFFIXES, load_instrument
from asperity.texture.files.nanonis import load_scan
from asperity.texture.files.stored import Stored, refuse
from asperity.texture.files.surfer import load_grid
from asperity.texture.files.text import load_text

TEXT_SUFFIXES = ARRAY_SUFFIXES[2:]
_EITHER = (".asc", ".dat", ".xyz")
"""Suffixes of text and of instruments' files."""
PACKED = (".npy", *TEXT_SUFFIXES, *_EITHER)
"""Suffixes that may have `.gz` behind them."""
_KNOWN = (
    f"an image ({', '.join(IMAGE_SUFFIXES)}); an array or text "
    f"({', '.join(ARRAY_SUFFIXES)}); an instrument's file (.x3p, .sdf, .sur, "
    ".gwy, .tmd and others)"
)
_Key = tuple[Path, str | None, tuple[int, int]]
_KEPT: ContextVar[dict[_Key, Stored] | None] = ContextVar("_KEPT", default=None)
"""Contents by path, array and stamp, until they are read again, within `contents_kept`."""


@contextmanager
def contents_kept() -> Iterator[None]:
    """Keep what `load_and_keep` reads within the context for the next `load_stored` of it."""
    token = _KEPT.set({})
    try:
        yield
    finally:
        _KEPT.reset(token)


def load_stored(
    path: Path,
    array: str | None = None,
    colour: str | None = None,
    pixels: tuple[float, float] | None = None,
) -> Stored:
    """Return the contents of the file at `path`, whatever its format; see `read_heights`.

    They are the caller's to change.
    """
    suffix = suffix_of(path, PACKED)
    if array is not None and suffix != ".npz":
        refuse(path, "array= chooses among the arrays of an .npz file; leave it out")
    if colour is not None and suffix not in IMAGE_SUFFIXES:
        refuse(path, "colour= states what the colours of an image mean; leave it out")
    waiting = _KEPT.get()
    kept = waiting.pop((path, array, _stamp(path)), None) if waiting else None
    # A pixel size is that of a map of points which lie on no grid.
    if kept is not None and not (pixels and any("no grid" in note for note in kept.notes)):
        return kept
    known = [*_LOADERS]
    with reading(path, "heights", known, valid=_KNOWN, packed=PACKED, error=SurfaceError):
        load = _LOADERS[suffix]
        if suffix == ".npz":
            load = partial(load_npz, array=array)
        elif suffix in IMAGE_SUFFIXES:
            load = partial(read_image, colour=colour)
        elif suffix in TEXT_SUFFIXES or (suffix in _EITHER and _is_text(path)):
            load = partial(load_text, pixel_size=pixels[0] if pixels else None)
        try:
            return load(path)
        except PreviewOnlyError:
            return load_instrument(path)
        except SurfaceError:
            if suffix not in SHEETS:
                raise
        return load_text(path, pixels[0] if pixels else None)


def load_and_keep(path: Path, array: str | None) -> Stored:
    """Return the contents of a file, kept within `contents_kept`."""
    stored, known = load_stored(path, array), _KEPT.get()
    if known is not None:
        known[path, array, _stamp(path)] = stored
    return stored


def _stamp(path: Path) -> tuple[int, int]:
    """Return what changes if a file does; zeros of one that is not there."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size


def _is_text(path: Path) -> bool:
    return decoded(content_of(path, 4096)) is not None


_LOADERS: dict[str, Callable[[Path], Stored]] = {
    **dict.fromkeys((*INSTRUMENT_SUFFIXES, *SHEETS), load_instrument),
    **dict.fromkeys(IMAGE_SUFFIXES, read_image),
    ".npy": load_npy,
    ".npz": load_npz,
    **dict.fromkeys(TEXT_SUFFIXES, load_text),
    ".grd": load_grid,
    ".sxm": load_scan,
    ".gsf": load_field,
}
