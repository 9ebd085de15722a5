"""The scale that a file of heights states, before anything is chosen for it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from asperity._core.files import reading
from asperity.errors import AsperityError
from asperity.texture.files.images import IMAGE_SUFFIXES, PreviewOnlyError, picture_scale
from asperity.texture.files.loading import load_and_keep


class OwnScale(NamedTuple):
    """The scale of a map as its file has it.

    Attributes
    ----------
    shape : (rows, columns)
    pixel_size : (pu, pv) or None
        [m]
    metres : float or None
        In one unit of its values.
    """

    shape: tuple[int, int]
    pixel_size: tuple[float, float] | None
    metres: float | None


def own_scale(path: Path, array: str | None = None) -> OwnScale | None:
    """Return the scale that a file of heights states; None for a profile, or no image that is read.

    Raises
    ------
    AsperityError
        An image that cannot be read; one line.
    """
    stamp = path.stat() if path.is_file() else None
    return _own_scale(path, array, stamp and (stamp.st_mtime_ns, stamp.st_size))


@lru_cache(maxsize=4)
def _own_scale(path: Path, array: str | None, stamp: object) -> OwnScale | None:
    """Return what `own_scale` does; a file that has changed has another `stamp`."""
    del stamp
    if path.suffix.lower() in IMAGE_SUFFIXES:
        with reading(path, "an image", IMAGE_SUFFIXES):
            try:
                return OwnScale(*picture_scale(path))
            except PreviewOnlyError:
                pass
    try:
        stored = load_and_keep(path, array)
    except AsperityError:  # it is refused when it is read as a texture
        return None
    if stored.values.ndim != 2:
        return None
    rows, columns = stored.values.shape
    return OwnScale((rows, columns), stored.pixel_size, stored.scale)
