"""The scale that a TIFF states: pixel size as ImageJ, OME and GeoTIFF write it, values as GDAL."""

from __future__ import annotations

import math
import re
from typing import Any

from asperity._core.units import length_of

RESOLUTIONS = (282, 283)
_PIXEL_SCALE, _GEO_KEYS = 33550, 34735
_GDAL = 42112
"""GDAL's tag for what it knows of the values, in XML."""
_MODEL_TYPE, _PROJECTED = 1024, 1


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
    unit = (file.imagej_metadata or {}).get("unit")
    metres = length_of(str(unit).replace("\\u00B5", "µ")) if unit else None
    if metres is None:
        return None
    counts = [file.pages[0].tags[tag].value for tag in RESOLUTIONS]
    pu, pv = (metres * below / above for above, below in counts)
    return pu, pv


def _ome(file: Any) -> tuple[float, float] | None:
    text = file.ome_metadata
    if not text:
        return None
    sizes = []
    for axis in "XY":
        size = re.search(rf'PhysicalSize{axis}="([^"]+)"', text)
        unit = re.search(rf'PhysicalSize{axis}Unit="([^"]+)"', text)
        metres = length_of(unit.group(1)) if unit else 1e-6  # the schema's default
        if size is None or metres is None:
            return None
        sizes.append(float(size.group(1)) * metres)
    return sizes[0], sizes[1]


def _geotiff(file: Any) -> tuple[float, float] | None:
    tags = file.pages[0].tags
    scale, keys = tags.get(_PIXEL_SCALE), tags.get(_GEO_KEYS)
    if scale is None or keys is None:
        return None
    entries = zip(keys.value[4::4], keys.value[7::4], strict=False)
    if dict(entries).get(_MODEL_TYPE) != _PROJECTED:
        return None  # degrees
    return float(scale.value[0]), float(scale.value[1])


def _gdal(page: Any) -> str:
    """Return what GDAL's tag of a page holds, "" without one."""
    tag = page.tags.get(_GDAL)
    if tag is None:
        return ""
    return tag.value.decode("utf-8", "replace") if isinstance(tag.value, bytes) else str(tag.value)


def gdal_unit(page: Any) -> str:
    """Return the unit of the first channel's values as GDAL states it, "" if it states none."""
    found = re.search(r"<Item\b[^>]*name=\"UNITTYPE\"[^>]*>([^<]+)</Item>", _gdal(page))
    return found.group(1).strip() if found else ""


def gdal_scale(page: Any) -> tuple[float, float] | None:
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
