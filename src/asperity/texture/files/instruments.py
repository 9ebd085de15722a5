"""Heights from the files of measuring instruments, through SurfaceTopography."""

from __future__ import annotations

import importlib
import io
import math
import re
import warnings
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from asperity._core.arrays import Mask
from asperity._core.units import length_of
from asperity.errors import SurfaceError
from asperity.texture.files.digital_surf import uncompressed
from asperity.texture.files.matlab import check_mat
from asperity.texture.files.points import profile
from asperity.texture.files.stored import Stored, check_size, refuse

_INSTRUMENTS = """
    000 001 002 003 004 005 al3d apx asc bcr bcrf cur dat datx di ezd frt grd gsf gwy h5 hfm hgt ibw
    jpk lext mat mdt mi mnt nc nid nms oir opd opdx os3d plu plux poir pro qep sdf spm stp sur sxm
    tmd tom top vk3 vk4 vk6 vk7 x3p xlsx xyz zip zmg zon
"""
INSTRUMENT_SUFFIXES = tuple(f".{name}" for name in _INSTRUMENTS.split())
"""Extensions of instruments' files; SurfaceTopography reads all but `.grd`, `.gsf`, `.sxm`."""
_UPWARDS = ("x3p", "sdf", "xyz", "nc", "h5", "mat")
"""Formats whose rows go upwards, by their norms or as arrays do; others are as seen, from the top:
the reader has them such that rows from the top show what the instrument's program does."""
_ARRAYS = ("mat", "h5")
"""Formats of plain arrays, `Z(row, column)`; of all others the first index runs along u."""
_BESIDE = ("x", "y", "xx", "yy", "xi", "yi", "mask", "valid")
"""Names of arrays beside the heights, as `[X, Y] = meshgrid(...)` makes them."""
_DIGITAL_SURF = (".sur", ".pro")
_TURNED = "its Rotation, of the scan in a larger frame, is left out"
_REVISION = "ISO5436 - 2000"


def load_instrument(path: Path) -> Stored:
    """Return the default channel of an instrument's file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of MPI, which it can do without
            surfaces = importlib.import_module("SurfaceTopography")
    except ImportError:
        refuse(
            path,
            f"{path.suffix} files need SurfaceTopography, which is not installed; "
            "valid: pip install 'asperity[surfaces]'",
        )
    suffix = path.suffix.lower()
    source: Any = str(path)
    valid = b""
    notes: tuple[str, ...] = ()
    if suffix == ".x3p":
        source, valid, notes = _standard_x3p(path)
    elif suffix == ".mat":
        check_mat(path)
    elif suffix in _DIGITAL_SURF:
        source = uncompressed(path) or source
    elif suffix == ".sdf" and (head := path.read_bytes()[1:4]) == b"BCR":
        # The same before it was a norm (EUR 15178): ISO 25178-71 and it differ in this word alone.
        source = io.BytesIO(path.read_bytes().replace(head, b"ISO", 1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with _opened(path, source, surfaces) as reader:
            stored = _channel(path, reader)
    if valid:
        stored.values[~_bits(path, valid, stored.values.shape)] = np.nan
    return stored._replace(notes=(*stored.notes, *notes))


def _bits(path: Path, data: bytes, shape: tuple[int, ...]) -> Mask:
    """Return which points are valid, of a bit each, the lowest first (ISO 25178-72)."""
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")
    count = math.prod(shape)
    if not count <= bits.size < count + 64:
        refuse(path, f"its valid points are {bits.size} bits; valid: {count}, one a point")
    return bits[:count].reshape(shape).astype(bool)


def _opened(path: Path, source: Any, surfaces: Any) -> Any:
    """Return the reader of a file: one for its suffix, else the one that detects its content."""
    suffix = path.suffix.lower().removeprefix(".")
    suffix = "sur" if f".{suffix}" in _DIGITAL_SURF else suffix
    known = [r.format() for r in surfaces.IO.readers if suffix in (r.file_extensions() or ())]
    # An X3P is a zip, which others take for theirs.
    for form in known if suffix == "x3p" else [*known, None]:
        try:
            reader = surfaces.open_topography(source, format=form)
            if reader.channels:
                return reader
            reader.close()
        except Exception:
            continue
    refuse(
        path,
        f"cannot be read as a {path.suffix.lower()} file: SurfaceTopography finds no "
        "heights in it; valid: the file as the instrument wrote it, or its heights as text",
    )


def _channel(path: Path, reader: Any) -> Stored:
    channel = _with_heights(reader)
    notes: tuple[str, ...] = ()
    check_size(path, *channel.nb_grid_pts)
    sized = channel.physical_sizes is not None
    if len(reader.channels) > 1:
        name = f", {channel.name!r}," if channel.name else ""
        notes = (*notes, f"the default channel{name} of {len(reader.channels)} is read")
    try:
        topography = reader.topography(
            channel_index=channel.index,
            **({} if sized else {"physical_sizes": tuple(map(float, channel.nb_grid_pts))}),
        )
        heights: Any = topography.heights()
    except Exception:
        refuse(path, "damaged, its heights cannot be read; valid: the file as it was written")
    unit = topography.unit if isinstance(topography.unit, str) else None
    metres = length_of(unit) if unit else None
    if unit and metres is None:
        refuse(path, f"its default channel is in {unit!r}; valid: heights, in a unit of length")
    scale = metres if metres is not None else None
    said = () if unit is None else (f"heights in the file's unit, {unit}, are turned into m",)
    notes = (*notes, *(said or ("the file names no unit",)))
    if not topography.is_uniform:
        found = profile(topography.positions(), np.asarray(heights, dtype=np.float64))
        if found is None:
            refuse(path, "its points are not evenly spaced; valid: heights on a grid, or a profile")
        heights = found.values
        steps: tuple[float, float] | None = found.pixel_size
        notes = (*notes, found.note)
    else:
        pu, pv = np.broadcast_to(topography.pixel_size, 2)
        steps = (float(pu), float(pv)) if sized else None
    pixel_size = (steps[0] * metres, steps[1] * metres) if steps and metres else None
    values = np.ma.filled(np.ma.asarray(heights, dtype=np.float64), np.nan)
    values = values if reader.format() in _ARRAYS else values.T
    if values.ndim == 2 and reader.format() not in _UPWARDS:
        values = np.flipud(values)
        notes = (*notes, "its first row is the top of the map")
    return Stored(values, notes, pixel_size, scale, unit or "")


def _with_heights(reader: Any) -> Any:
    """Return the default channel; of arrays the first whose name is not that of places."""
    channels = reader.channels if reader.format() in _ARRAYS else ()
    heights = [c for c in channels if str(c.name).split("/")[-1].casefold() not in _BESIDE]
    return heights[0] if heights else reader.default_channel


def _standard_x3p(path: Path) -> tuple[io.BytesIO, bytes, tuple[str, ...]]:
    """Return an X3P file as SurfaceTopography reads it, which of its points are valid, and notes.

    Its heights are in a binary file then; without bits of valid points those are b"".

    Forensic programs put everything in a folder, write an en dash, leave the offset empty, or
    link with backslashes; and the norm lets heights stand in the XML itself.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = [member.file_size for member in archive.infolist()]
            check_size(path, sum(sizes) // 8)
            members = {
                name.replace("\\", "/"): name for name in archive.namelist()
                if not name.startswith("__MACOSX") and not name.endswith("/")
            }  # fmt: skip
            main = min((n for n in members if n.split("/")[-1].lower() == "main.xml"), key=len)
            folder = main[: -len("main.xml")]
            root = ElementTree.fromstring(archive.read(members[main]))
            mask = (root.findtext(".//{*}ValidPointsLink") or "").strip().replace("\\", "/")
            mask = mask.lstrip("./")
            valid = (
                archive.read(members.get(folder + mask, members.get(mask, mask))) if mask else b""
            )
            turned = root.find(".//{*}Rotation")
            notes = () if turned is None or _is_identity(turned) else (_TURNED,)
            link = _tidied_x3p(path, root)
            if link is None:
                data, points = "bindata/data.bin", _listed(root)
                _link(root, data)
            else:
                data = link.replace("\\", "/").lstrip("./")
                points = archive.read(members.get(folder + data, members.get(data, data)))
    except SurfaceError:
        raise
    except Exception:  # whatever zipfile and the XML parser raise on a damaged file
        refuse(
            path,
            "cannot be read as a .x3p file: damaged, or no zip of main.xml and the heights that "
            "it links to",
        )
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("main.xml", ElementTree.tostring(root, encoding="utf-8"))
        archive.writestr(data, points)
    out.seek(0)
    return out, valid, notes


def _is_identity(rotation: ElementTree.Element) -> bool:
    values = [float(element.text or "nan") for element in rotation]
    return len(values) == 9 and bool(np.allclose(np.reshape(values, (3, 3)), np.eye(3)))


def _listed(root: ElementTree.Element) -> bytes:
    """Return the heights that an X3P's index lists, as 64-bit floats; empty ones are missing."""
    words = [(datum.text or "").strip().rpartition(";")[2] for datum in root.iter("Datum")]
    kind, step = root.find(".//CZ/DataType"), root.find(".//CZ/Increment")
    if kind is None or not words:
        raise KeyError("DataList")
    values = np.array([float(word or "nan") for word in words], dtype="<f8")
    if (kind.text or "").strip() in ("I", "L") and step is not None:
        values *= float(step.text or "1")
    kind.text = "D"
    if step is not None:
        step.text = "1"
    return values.tobytes()


def _link(root: ElementTree.Element, name: str) -> None:
    """Have an X3P's index link to a file of heights, instead of a list of them."""
    record = root.find("Record3")
    assert record is not None
    for listed in record.findall("DataList"):
        record.remove(listed)
    link = ElementTree.SubElement(record, "DataLink")
    ElementTree.SubElement(link, "PointDataLink").text = name


def _tidied_x3p(path: Path, root: ElementTree.Element) -> str | None:
    """Make an X3P's index what SurfaceTopography expects; return the link to its points.

    None if they are listed in the index.
    """

    def text(name: str) -> str:
        element = root.find(f".//{name}")
        return (element.text or "").strip() if element is not None else ""

    for element in root.iter():
        element.tag = element.tag.rsplit("}", 1)[-1]
    revision = root.find(".//Revision")
    if revision is not None and re.fullmatch(r"ISO\s?5436.{0,3}\s*\W*\s*2000", text("Revision")):
        revision.text = _REVISION
    if text("FeatureType") not in ("SUR", ""):
        refuse(
            path, f"its feature type is {text('FeatureType')!r}; valid: SUR, a surface on a grid"
        )
    axis = next((a for a in ("CX", "CY") if text(f"{a}/AxisType") not in ("I", "")), None)
    if axis is not None:
        refuse(path, f"its axis {axis} has a place for each point; valid: even steps (type I)")
    for described in root.findall("Record2"):
        root.remove(described)  # dates and names, often not as the norm has them
    for offset in root.iter("Offset"):
        offset.text = (offset.text or "").strip() or "0"
    for increment in root.iter("Increment"):
        increment.text = (increment.text or "").strip() or "1"
    link = root.find(".//PointDataLink")
    if link is None and root.find(".//DataList") is not None:
        return None
    if link is None or not link.text:
        raise KeyError("PointDataLink")
    original = link.text.strip()
    link.text = original.replace("\\", "/").lstrip("./")
    return original
