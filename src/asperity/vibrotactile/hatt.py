"""Model files of the Penn Haptic Texture Toolkit, read and written.

Culbertson, Lopez Delgado & Kuchenbecker (2014), "One hundred data-driven haptic texture models and
open-source methods for rendering on 3D objects". Their files may be used for non-profit research
and not be passed on, so none comes with asperity. `docs/vibration.md` lists what of the format a
source confirms. A file is data: document types, and so entities, are refused.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import (
    Element,
    ParseError,
    SubElement,
    TreeBuilder,
    XMLParser,
    indent,
    parse,
    tostring,
)

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.output import write_whole
from asperity.errors import AsperityError
from asperity.vibrotactile.harmonic import HarmonicModel, as_noise
from asperity.vibrotactile.lsf import coefficients_of
from asperity.vibrotactile.model import HIGHEST_ORDER, MOST_MODELS, TextureModel

_LARGEST = 64 * 2**20
"""Of a file [bytes]; those of the toolkit are below one megabyte."""
_DEEPEST = 16
_UNITS = {"AccelUnits": "m/s^2", "SpeedUnits": "mm/s", "ForceUnits": "N"}


def read_hatt(path: str | Path) -> TextureModel:
    """Return the texture model in an XML file of the toolkit, or one that `write_hatt` wrote.

    Raises
    ------
    AsperityError
        There is no such file, or it is no such model; the message names what is wrong and where.
    """
    path = Path(path)
    if not path.is_file():
        raise AsperityError(f"no such texture model: {path}; give an .xml of HaTT or asperity fit")
    if path.stat().st_size > _LARGEST:
        raise AsperityError(f"{path} is larger than {_LARGEST >> 20} MiB: no texture model")
    try:
        root = parse(path, XMLParser(target=_Builder())).getroot()
        if root.tag != "modelSet":
            raise AsperityError(f"no texture model: <{root.tag}> instead of <modelSet>")
        return _model(root, path.stem)
    except AsperityError as error:
        raise AsperityError(f"{path}: {error}") from None
    except (ParseError, ValueError, LookupError) as error:
        raise AsperityError(f"{path} is not XML: {error}") from None


class _Builder(TreeBuilder):
    """Builds the tree of a file; refuses document types, and so entities, and deep nesting."""

    _depth = 0

    def doctype(self, *_: object) -> NoReturn:
        raise AsperityError("it declares a document type; a texture model must not")

    def start(self, tag: str, attrs: dict[str, str], /) -> Element:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise AsperityError(f"no texture model: <{tag}> stands {self._depth} deep")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        return super().end(tag)


def _model(root: Element, stem: str) -> TextureModel:
    for tag, unit in _UNITS.items():
        text = root.findtext(tag)
        if text is not None and text.strip() != unit:
            raise AsperityError(f"<{tag}> is {text.strip()!r}; valid: {unit!r}")
    n = _count(root, "numMod", 3, MOST_MODELS)
    p = _count(root, "numARCoeff", 1, HIGHEST_ORDER)
    q = _count(root, "numMACoeff", 0, HIGHEST_ORDER, default=0)
    speeds = _values(root, "speedList", n) * 1e-3
    forces = _values(root, "forceList", n)
    triangles = _triangles(root, n)
    models = root.findall("model")
    if len(models) != n:
        raise AsperityError(f"{len(models)} <model> where <numMod> is {n}")
    ar, ma = np.empty((n, p)), np.empty((n, q))
    variance, gain = np.empty(n), np.ones(n)
    for i, model in enumerate(models):
        where = f"model {i + 1}: "
        ar[i] = _values(model, "ARlsf", p, where)
        if q:
            ma[i] = _values(model, "MAlsf", q, where)
            gain[i] = _number(model, "gain", where)
        variance[i] = _number(model, "var", where)
        for tag, listed in (("speedMod", speeds[i] * 1e3), ("forceMod", forces[i])):
            own = _number(model, tag, where)
            if abs(own - listed) > 1e-5 * max(1.0, abs(listed)):
                raise AsperityError(f"{where}<{tag}> is {own:g}, but its list has {listed:g}")
    return TextureModel(
        name=(root.findtext("material") or stem).strip() or stem,
        rate=_number(root, "SampleRate"), speeds=speeds, forces=forces, ar=ar, ma=ma, gain=gain,
        variance=variance, friction=_number(root, "mu", default=0.0), triangles=triangles,
    )  # fmt: skip


def _number(parent: Element, tag: str, where: str = "", default: float | None = None) -> float:
    text = parent.findtext(tag)
    if text is None:
        if default is not None:
            return default
        raise AsperityError(f"{where}<{tag}> is missing")
    return _finite(text, f"{where}<{tag}>")


def _finite(text: str, what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise AsperityError(f"{what} must be a finite number, got {text.strip()[:40]!r}")
    return value


def _count(parent: Element, tag: str, low: int, high: int, *, default: float | None = None) -> int:
    value = _number(parent, tag, default=default)
    if value != int(value) or not low <= value <= high:
        raise AsperityError(f"<{tag}> must be a whole number from {low} to {high}, got {value:g}")
    return int(value)


def _values(parent: Element, tag: str, count: int, where: str = "") -> Array:
    holder = parent.find(tag)
    if holder is None:
        raise AsperityError(f"{where}<{tag}> is missing")
    texts = [value.text or "" for value in holder.findall("value")]
    if len(texts) != count:
        raise AsperityError(f"{where}<{tag}> holds {len(texts)} values; valid: {count}")
    return np.array(
        [_finite(text, f"{where}<{tag}>, value {i},") for i, text in enumerate(texts, 1)]
    )


def _triangles(root: Element, n: int) -> Indices | None:
    """Return the triangles, counted from 0, or None where the file has none."""
    found = root.findall("tri")
    count = _number(root, "numTri", default=float(len(found)))
    if count != len(found):
        raise AsperityError(f"{len(found)} <tri> where <numTri> is {count:g}")
    out = np.empty((len(found), 3), np.int64)
    for i, tri in enumerate(found):
        values = [value.text or "" for value in tri.findall("value")]
        try:
            corners = [int(value) for value in values]
        except ValueError:
            corners = []
        if len(corners) != 3 or not all(1 <= corner <= n for corner in corners):
            raise AsperityError(
                f"<tri> {i + 1} must hold 3 whole numbers from 1 to {n}, got {values!r}"
            )
        out[i] = np.array(corners) - 1
    return out if len(found) else None


def write_hatt(model: TextureModel, path: str | Path) -> tuple[str, ...]:
    """Write a texture model as an XML file of the toolkit, every number to its last digit.

    The format has no lines: those of a `HarmonicModel` become resonances of the noise.

    Returns
    -------
    tuple of str
        What the file loses, a line each; empty if it loses nothing.
    """
    notes: tuple[str, ...] = ()
    if isinstance(model, HarmonicModel):
        model, share = as_noise(model)
        notes = ("between models HaTT mixes the variance of the excitation, not the RMS",)
        if share > 0.0:
            notes = (
                f"HaTT's format has no periods: {100.0 * share:.0f} % of the power, which follows "
                "the position, becomes noise",
                *notes,
            )
    root = Element("modelSet", texture="0")

    def put(parent: Element, tag: str, value: float | int | str) -> None:
        SubElement(parent, tag).text = value if isinstance(value, str) else repr(value)

    def put_list(parent: Element, tag: str, values: Array | Indices) -> None:
        holder = SubElement(parent, tag, type="array")
        for value in values.tolist():
            put(holder, "value", value)

    put(root, "material", "".join(c for c in model.name if c.isprintable()) or "texture")
    for tag, unit in _UNITS.items():
        put(root, tag, unit)
    put(root, "SampleRate", float(model.rate))
    put(root, "mu", float(model.friction))
    triangles = model.mesh.triangles
    put(root, "numMod", len(model.speeds))
    put(root, "numTri", len(triangles))
    put(root, "maxSpeed", float(model.speeds.max() * 1e3))
    put(root, "maxForce", float(model.forces.max()))
    put_list(root, "speedList", model.speeds * 1e3)
    put_list(root, "forceList", model.forces)
    for triangle in triangles:
        put_list(root, "tri", triangle + 1)
    put(root, "numARCoeff", model.order)
    put(root, "numMACoeff", int(model.ma.shape[1]))
    for i in range(len(model.speeds)):
        one = SubElement(root, "model")
        put(one, "modNum", i + 1)
        put_list(one, "ARcoeff", coefficients_of(model.ar[i]))
        put_list(one, "ARlsf", model.ar[i])
        if model.ma.shape[1]:
            put_list(one, "MAcoeff", coefficients_of(model.ma[i]))
            put_list(one, "MAlsf", model.ma[i])
        put(one, "var", float(model.variance[i]))
        put(one, "gain", float(model.gain[i]))
        put(one, "speedMod", float(model.speeds[i] * 1e3))
        put(one, "forceMod", float(model.forces[i]))
    indent(root, "   ")
    text = tostring(root, encoding="unicode")
    write_whole(Path(path), f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n')
    return notes
