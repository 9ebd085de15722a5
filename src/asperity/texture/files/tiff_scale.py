"""The scale that a TIFF states, of pixels and values: by ImageJ, OME, GeoTIFF and GDAL."""

from __future__ import annotations

import html
import math
import re
from typing import Any, NamedTuple

from asperity._core.units import length_of

RESOLUTIONS = (282, 283)
_PIXEL_SCALE, _TRANSFORM, _GEO_KEYS = 33550, 34264, 34735
_GDAL = 42112
"""GDAL's tag for what it knows of the values, in XML."""
_MODEL_TYPE, _PROJECTED, _LINEAR_UNIT = 1024, 1, 3076
_LINEAR = {None: 1.0, 9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0, 9036: 1000.0}
"""Metres in a unit of a projection, by EPSG's number; without one it is metres."""


class ValueScale(NamedTuple):
    """Values are `factor` times what is stored, plus `offset`."""

    factor: float
    offset: float
    unit: str
    """"" where none is stated."""
    by: str
    """Which program's words state it."""


def tiff_pixel_size(file: Any) -> tuple[float, float] | None:
    """Return the pixel size [m] that an open `tifffile.TiffFile` states, None if it states none.

    The resolution in dots per inch is no size: programs write 72 or 96 without knowing.
    """
    try:
        size = _imagej(file) or _ome(file) or _geotiff(file)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, ZeroDivisionError):
        return None  # damaged, or not as the programs write it
    good = size is not None and all(math.isfinite(side) and side > 0.0 for side in size)
    return size if good else None


def _imagej(file: Any) -> tuple[float, float] | None:
    head = file.imagej_metadata or {}
    unit = _imagej_unit(head, "unit")
    units = length_of(unit), length_of(_imagej_unit(head, "yunit") or unit)
    if None in units:
        return None
    counts = [file.pages[0].tags[tag].value for tag in RESOLUTIONS]
    pu, pv = (
        (metres or 0.0) * below / above
        for metres, (above, below) in zip(units, counts, strict=True)
    )
    return pu, pv


def _imagej_unit(head: dict[str, Any], key: str) -> str:
    return str(head.get(key, "")).replace("\\u00B5", "µ")


def _ome(file: Any) -> tuple[float, float] | None:
    text = file.ome_metadata
    if not text:
        return None
    sizes = []
    for axis in "XY":
        size = re.search(rf'PhysicalSize{axis}="([^"]+)"', text)
        unit = re.search(rf'PhysicalSize{axis}Unit="([^"]+)"', text)
        word = html.unescape(unit.group(1)) if unit else "um"  # the schema's default
        metres = length_of(word)
        if size is None or metres is None:
            return None
        sizes.append(float(size.group(1)) * metres)
    return sizes[0], sizes[1]


def _geotiff(file: Any) -> tuple[float, float] | None:
    tags = file.pages[0].tags
    scale, turned, keys = (tags.get(tag) for tag in (_PIXEL_SCALE, _TRANSFORM, _GEO_KEYS))
    if keys is None or (scale is None and turned is None):
        return None
    entries = dict(zip(keys.value[4::4], keys.value[7::4], strict=False))
    metres = _LINEAR.get(entries.get(_LINEAR_UNIT))
    if entries.get(_MODEL_TYPE) != _PROJECTED or metres is None:
        return None  # degrees, or another unit
    if scale is not None:
        return float(scale.value[0]) * metres, abs(float(scale.value[1])) * metres
    rows = [turned.value[k : k + 2] for k in (0, 4)]  # a rotation, and the sides of a pixel
    return math.hypot(rows[0][0], rows[1][0]) * metres, math.hypot(*(r[1] for r in rows)) * metres


def is_south_up(file: Any) -> bool:
    """Return whether the rows of a GeoTIFF go from the south to the north."""
    tags = file.pages[0].tags
    scale, turned = tags.get(_PIXEL_SCALE), tags.get(_TRANSFORM)
    if tags.get(_GEO_KEYS) is None:
        return False
    try:
        if scale is not None:
            return float(scale.value[1]) < 0.0
        across, _, _, _, _, up = (float(x) for x in turned.value[:6])
    except (AttributeError, TypeError, ValueError):
        return False
    return across > 0.0 and up > 0.0


def value_scale(file: Any) -> ValueScale | None:
    """Return what the values of an open TIFF's first channel are, None if it does not state it."""
    page = file.pages[0]
    stated, unit = _gdal_scale(page), _gdal_unit(page)
    if stated is not None or unit:
        return ValueScale(*(stated or (1.0, 0.0)), unit, "GDAL")
    head = file.imagej_metadata or {}
    unit = _imagej_unit(head, "vunit")
    unit = "" if unit.casefold() in ("", "gray value", "<none>") else unit
    try:
        offset, factor = (float(head[key]) for key in ("c0", "c1"))
        straight = int(head.get("cf", -1)) == 0 and "c2" not in head
    except (KeyError, TypeError, ValueError):
        return ValueScale(1.0, 0.0, unit, "ImageJ") if unit and "cf" not in head else None
    if not straight or factor == 0.0 or not math.isfinite(offset + factor):
        return None
    return ValueScale(factor, offset, unit, "ImageJ")


def _gdal(page: Any) -> str:
    """Return what GDAL's tag of a page holds, "" without one."""
    tag = page.tags.get(_GDAL)
    if tag is None:
        return ""
    return tag.value.decode("utf-8", "replace") if isinstance(tag.value, bytes) else str(tag.value)


def _gdal_unit(page: Any) -> str:
    """Return the unit of the first channel's values as GDAL states it, "" if it states none."""
    found = re.search(r"<Item\b[^>]*name=\"UNITTYPE\"[^>]*>([^<]+)</Item>", _gdal(page))
    return found.group(1).strip() if found else ""


def _gdal_scale(page: Any) -> tuple[float, float] | None:
    """Return factor and offset of the first channel's values as GDAL states them, else None."""
    text = _gdal(page)
    if not text:
        return None
    found = {"SCALE": 1.0, "OFFSET": 0.0}
    for item in re.findall(r"<Item\b([^>]*)>([^<]*)</Item>", text):
        name = re.search(r'name="(SCALE|OFFSET)"', item[0])
        sample = re.search(r'sample="(\d+)"', item[0])
        if name is None or (sample is not None and int(sample.group(1)) != 0):
            continue
        try:
            found[name.group(1)] = float(item[1])
        except ValueError:
            return None
    scale, offset = found["SCALE"], found["OFFSET"]
    good = math.isfinite(scale) and math.isfinite(offset) and scale != 0.0
    return (scale, offset) if good and (scale, offset) != (1.0, 0.0) else None
