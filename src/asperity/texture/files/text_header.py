"""What the lines above a text file's heights say: size, pixels, units, missing values.

The words are those of Gwyddion's ASCII export in its languages (its po files), ESRI's ASCII grid,
JPK, SPIP, Vision and others. A line is `label: value unit`, with a colon, an equals sign, a comma,
or white space.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.text_form import is_heading, is_number
from asperity._core.units import LENGTHS, length_of, named_unit

_LABELS = {
    "width": """width; breite; weite; šířka; anchura; ancho; largeur; larghezza; ширина; 폭; 너비;
        幅; 宽度; 寬度; largura; szélesség; bredd; bredde; szerokość; genişlik; leveys; x-size;
        xsize; x size; size x; x range; x-range; x length; x-length; xlength; scan width;
        scan size x; real width; x scan size; length x; image width; field width; x scale size;
        scan size; scan range; x amplitude""",
    "height": """height; höhe; výška; altura; alto; hauteur; altezza; высота; 높이; 高さ; 高度;
        magasság; höjd; høyde; højde; wysokość; yükseklik; korkeus; y-size; ysize; y size; size y;
        y range; y-range; y length; y-length; ylength; scan height; scan size y; real height;
        y scan size; length y; image height; field height; y amplitude""",
    "unit": """value units; value unit; values unit; jednotky hodnot; unités; unités de valeur;
        unità valore; 값 단위; единицы измерения; единицы значений; werteinheit; werteinheiten;
        einheit; wert-einheiten; unidades; unidades de valor; unidad; unidades do valor;
        値の単位; 值单位; értékegységek; unit; units; z unit; z units; z-unit; z-units; zunit;
        height unit; height units; data unit; data units; value; einheit z; z-einheit; unidade;
        unità; z axis unit; unit z; единица; 単位; 单位; height value unit; enheter""",
    "pixel": """pixel size; pixelsize; pixel_size; pixel spacing; pixelgröße; pixelgrösse; cellsize;
        cell size; xy calibration; lateral resolution; lateral sampling; pixel width and height;
        taille de pixel; taille du pixel; sampling interval; sample spacing; tamaño de píxel;
        sampling; sampling distance; point spacing; pixelabstand; punktabstand;
        dimensione pixel; grid spacing; pixel pitch; pitch; spacing; step size;
        xy-kalibrierung; calibrage xy; étalonnage xy; lateral calibration;
        resolution xy; xy resolution; xyキャリブレーション; xy校准; xy标定""",
    "pixel_x": """pixel size x; x pixel size; x-pixel size; dx; x step; x spacing; x increment;
        x resolution; pixel width; x-step; stepx; step x; xscale; x scale; pixel size (x); xdim;
        spacing x; delta x; x-increment; xinc; pixelbreite; x pitch; pitch x""",
    "pixel_y": """pixel size y; y pixel size; y-pixel size; dy; y step; y spacing; y increment;
        y resolution; pixel height; y-step; stepy; step y; yscale; y scale; pixel size (y); ydim;
        spacing y; delta y; y-increment; yinc; pixelhöhe; y pitch; pitch y""",
    "factor": """height conversion factor (-> m); z factor""",
    "bit": "bit2nm",
    "nodata": "nodata_value; nodata value; nodata; no data value; missing value; novalue",
}
_MEANING = {
    " ".join(label.split()): meaning for meaning, text in _LABELS.items()
    for label in text.split(";")
}  # fmt: skip
_GRID = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize")
"""Labels of ESRI's ASCII grid."""
_POWER = re.compile(r"(?:([\d.]+)\s*[×x*·]\s*)?\b10(?:<sup>|\^)([+-]?\d+)(?:</sup>)?\s*")
"""Powers of ten, as Gwyddion writes them."""
_STEP = re.compile(
    r"pitch|step|spacing|sampling|resolution|auflösung|résolution|pixel|increment|interval|distance"
    r"|\bpas\b|schritt|abstand|krok|passo|\bpaso\b|шаг|intervall|rozestup|afstand|adım|odstęp"
    r"|avstånd|avstand|distan|espa[cç]|intervalo|táv|间距|間距|间隔|間隔|步长|像素|ピッチ|ピクセル|간격|피치"
)
"""Words of labels of lengths that are not those of the whole map."""
_ELSEWHERE = re.compile(
    r"offset|origin|stage|position|cent(?:re|er)|start|shift|versatz|décalage|radius|\btip\b|diameter"
    r"|wavelength|working|cut.?off|vertical|\bm(?:ax|in|ean|edian)|rms|average|rough|rau|peak|valley"
    r"|thickness|noise|objective|\b[sprw][apqvzt]\b"
)
"""Words of labels of lengths that are no size of the map."""
_FACTOR = re.compile(
    r"(?:(?:z|heights?|data|values?|vertical|höhen?|hauteur)?[ _-]*(?:scal(?:e|ing)|conversion|"
    r"multiplication|skalierungs?|umrechnungs?)?[ _-]*(?:factor|faktor|multiplier))|facteur.*|lsb"
)
_FACTOR_PERHAPS = re.compile(
    r"(?:z|heights?|data|values?|vertical)[ _-]*(?:scal(?:e|ing)|resolution|calibration|conversion"
    r"|lsb)|scale|scaling"
)
"""Labels of a factor of the heights, and of what may be one."""
_COUNT = re.compile(r"lsb|counts?|bits?|digits?|levels?|adu|dn|inc(?:rement)?s?|units?")
"""What a factor is per."""
_PER_COUNT = re.compile(r"[\[(]\s*([^\W\d]+)\s*/\s*([^\W\d]+)\s*[\])]")
_WHOLE = frozenset(
    ("size", "image size", "map size", "scan area", "area", "dimensions", "field of view", "fov")
)
"""Labels of the width and the height of a map in one line."""
_TWO = re.compile(
    r"([\d.,]+)\s*([^\W\d]*)\s*(?:[x×*]\s*|(?<=[\d.,])\s+)([\d.,]+)\s*([^\W\d]*)(?:[\s,;].*)?",
    re.IGNORECASE,
)
_UNEQUAL = 2.0
"""Ratio of a pixel's sides from which two lengths are hardly the sizes of a map."""
_NO_LENGTHS = frozenset(
    {"v", "mv", "µv", "uv", "a", "ma", "µa", "na", "pa", "n", "mn", "µn", "nn", "deg", "°", "rad",
     "mrad", "hz", "khz", "px", "pixel", "pixels", "count", "counts", "levels", "a.u.", "au", "%",
     "db", "s", "ms", "kpa", "mpa", "gpa", "w", "wave", "waves", "fringe", "fringes", "λ", "°c",
     "-"}
)  # fmt: skip
"""Units that are no lengths, in lower case."""
_SAMPLE = re.compile(r"p(?:i?x|oint|ts?\b)|sample|step|bildpunkt|punkt", re.IGNORECASE)
"""What a length may be per, and still is one: `10 µm/px`."""
_UNIT_BEHIND = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\W*$")
_OF_A_NUMBER = re.compile(
    r"(?:[:=\t,]\s*[-+\d.e]+\s*[\[(]?[^\W\d]+[\])]?|\s[-+\d.]+\s*[^\W\d]+)\s*$"
)
"""A unit at a line's end that is of the number before it."""
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_AXIS = re.compile(r"(?<![a-zß-ɏ])([xy])(?![a-zß-ɏ])")
"""The axis in a label: with a word of `_STEP` it is that of a pixel."""
_COUNTS = {"ncols": 1, "nrows": 0, "x-pixels": 1, "y-pixels": 0}
"""Labels of numbers of columns (1) and rows (0)."""
_PICTURE = {"horizontal", "vertical", "vertikal", "horizontale", "verticale", "水平", "垂直"}
"""Labels of Keyence's numbers of samples."""
_PAIR = re.compile(r"\s*([^:=\t,;]+?)\s*[:=\t,;][\s:=,;]*(.+?)\s*$")
_SPACED = re.compile(r"\s*([^\W\d][\w ]*?)\s+([+-]?[\d.].*?)\s*$")
_VALUE = re.compile(
    r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)[\s,;]*([^\d\s,;][^,;]*?)?\s*(?:[,;].*)?$"
)


class Header(NamedTuple):
    """What a header states; lengths in metres, None for what it does not say."""

    width: float | None = None
    """Of the whole map."""
    height: float | None = None
    pixel: tuple[float, float] | None = None
    unit: str | None = None
    """Of the heights, as written."""
    scale: float | None = None
    """Metres in one unit; None where `unit` is no length."""
    nodata: float | None = None
    picture: bool = False
    """Whether the first row is the top of a picture or map."""
    notes: tuple[str, ...] = ()
    shape: tuple[int, int] | None = None
    """Rows and columns."""
    follows: bool = False
    """Whether the pixel is in the unit of the heights, which is not said."""
    factor: Factor | None = None

    def of(self, values: Array) -> Header:
        """Return the header with its factor in the unit of these heights, or doubted."""
        if self.factor is None:
            return self
        label, number, metres, word, sure = self.factor
        whole = bool((values == np.round(values))[np.isfinite(values)].all())
        if not (whole or sure):
            return self
        if not (whole and sure):
            kind = "whole numbers" if whole else "no whole numbers"
            doubt = f"is {label!r}, {number:g}, a factor of the heights? They are {kind}, and read"
            note = f"{doubt} without it: unit= or height_range= gives another scale"
            return self._replace(notes=(*self.notes, note))
        unit, scale = (word, metres) if metres else (self.unit or "m", self.scale or 1.0)
        return self._replace(unit=f"{number:g} {unit}", scale=number * scale)


class Factor(NamedTuple):
    """A factor of the heights that a header states."""

    label: str
    number: float
    metres: float | None
    """In its unit; None without one."""
    word: str
    """Its unit as written."""
    sure: bool
    """Whether it can be nothing else."""


def read_header(
    lines: Sequence[str], names: Sequence[str] | None, shape: tuple[int, ...]
) -> Header:
    """Return what the lines above some heights say.

    Parameters
    ----------
    lines : sequence of str
    names : sequence of str, optional
        The columns' names, if one of the lines holds them.
    shape : (rows, columns)
        Of the numbers.
    """
    found, lengths, units, factor = _findings(lines)
    notes: list[str] = []
    width, height = found.get("width"), found.get("height")
    if (width is None) != (height is None) and "pixel" not in found and len(lengths) == 2:
        # The width of a scan may be across its length: of both orders the one of square pixels.
        (a, u), (b, v) = lengths
        ratio = (u / shape[1]) / (v / shape[0])
        turned = (v / shape[1]) / (u / shape[0])
        if abs(math.log(turned)) < abs(math.log(ratio)):
            (a, u), (b, v), ratio = *lengths[::-1], turned
        if 1.0 / _UNEQUAL < ratio < _UNEQUAL:
            width, height = u, v
            notes.append(f"{a!r} and {b!r} are taken for width and height of the map")
    elif width is None and height is None and "pixel" not in found and len(lengths) == 2:
        (a, u), (b, v) = lengths
        ratio = (u / shape[1]) / (v / shape[0])
        if u == v and shape[0] != shape[1]:
            found |= {"pixel_x": u, "pixel_y": v}
            notes.append(f"{a!r} and {b!r} are taken for the sides of a pixel")
        elif 1.0 / _UNEQUAL < ratio < _UNEQUAL:
            width, height = u, v
            notes.append(f"{a!r} and {b!r} are taken for width and height of the map")
        else:
            lengths = []
    pixel = found.get("pixel")
    pair = (found.get("pixel_x", pixel), found.get("pixel_y", found.get("pixel_x", pixel)))
    unit, scale = units or (None, None)
    if "factor" in found:
        unit, scale = "m", found["factor"]
    if unit is None and lines:
        unit, scale = _heading(lines, names)
    return Header(
        width, height, None if pair[0] is None else pair, unit, scale, found.get("nodata"),  # type: ignore[arg-type]
        {"width", "height"} <= {*found} or len(lengths) == 2 or "grid" in found, tuple(notes),
        (int(found["rows"]), int(found["columns"])) if {"rows", "columns"} <= {*found} else None,
        "follows" in found and scale is None, factor,
    )  # fmt: skip


def _findings(
    lines: Sequence[str],
) -> tuple[
    dict[str, float], list[tuple[str, float]], tuple[str, float | None] | None, Factor | None
]:
    """Return values by meaning [m], lengths by label, the unit of the values, and their factor."""
    factor = None
    found: dict[str, float] = {}
    lengths: list[tuple[str, float]] = []
    bare_sizes: dict[str, float] = {}
    units: tuple[str, float | None] | None = None
    for label, text in _pairs(lines):
        bare = " ".join(re.sub(r"\[.*?\]|(?<!-> m)\(.*?\)$", "", label.casefold()).split())
        named = named_unit(label, LENGTHS)
        plain = bare.removesuffix(named[0].casefold() if named else "").replace("_", " ").strip()
        spaced = _CAMEL.sub(" ", label).casefold().replace("-", " ")
        known = (label.casefold(), bare, plain, plain.replace("-", " "), spaced)
        meaning = next(filter(None, map(_MEANING.get, known)), None)
        two = _two_lengths(label, text) if meaning in ("width", "pixel") or bare in _WHOLE else None
        if two is not None:
            keys = ("pixel_x", "pixel_y") if meaning == "pixel" else ("width", "height")
            found |= dict(zip(keys, two, strict=True))
            continue
        value = _VALUE.fullmatch(text)
        if value is None:
            other = meaning is None and units is None and not _AXIS.search(bare)
            if meaning == "unit" or (other and length_of(text)):
                units = (text.strip("[]() "), length_of(text.strip("[]() ")))
            continue
        number = float(value.group(1).replace(",", "."))
        word, _, each = (value.group(2) or "").strip("[]() ").partition("/")
        if per := _PER_COUNT.search(label):
            word, each = per.groups()
        metres = length_of(word) if word else (named[1] if named else None)
        sure = _FACTOR.fullmatch(plain) is not None
        if meaning is None and (sure or _FACTOR_PERHAPS.fullmatch(plain)):
            sure = sure or _COUNT.fullmatch(each.strip().casefold()) is not None
            word = word or (named[0] if named else "")
            factor = Factor(label, number, metres, word, sure) if number not in (0, 1) else None
            continue
        if each and not _SAMPLE.match(each.strip()):
            continue  # a speed
        if meaning == "unit" and metres is not None:
            units = (text, number * metres)
            continue
        if bare in _GRID or bare in _PICTURE:
            found["grid"] = 1.0
        if bare in _COUNTS and 0.0 < number < 1e6:
            found[("rows", "columns")[_COUNTS[bare]]] = number
        axes = {*_AXIS.findall(bare)}
        if meaning is None and metres is not None and _STEP.search(bare) and len(axes) == 1:
            meaning = f"pixel_{axes.pop()}"
        elif meaning is None and metres is not None and each and not axes:
            upwards = "z" in bare.split() or _ELSEWHERE.search(bare)
            meaning = None if upwards else "pixel"  # a length per sample
        if meaning in ("nodata", "factor"):
            found[meaning] = number
        elif meaning == "bit":  # SPIP: lengths without a unit are nm
            found["factor"] = number * 1e-9
            found |= {name: 1e-9 * size for name, size in bare_sizes.items()}
        elif meaning == "pixel" or meaning in ("pixel_x", "pixel_y"):
            if metres is not None or bare in ("cellsize", "dx", "dy"):
                found.setdefault(meaning, number * (metres or 1.0))
            if metres is None and bare == "cellsize":
                found["follows"] = 1.0
        elif metres is not None and number > 0.0:
            if meaning or not (_STEP.search(bare) or _ELSEWHERE.search(bare)):
                lengths.append((label, number * metres))
            if meaning in ("width", "height"):
                found.setdefault(meaning, number * metres)
        elif meaning in ("width", "height"):
            bare_sizes[meaning] = number
    return found, lengths, units, factor


def _two_lengths(label: str, text: str) -> tuple[float, float] | None:
    """Return the two lengths [m] of `640 x 480 µm`, None for other texts."""
    two = _TWO.fullmatch(text)
    if two is None:
        return None
    a, word_a, b, word_b = two.groups()
    named = named_unit(label, LENGTHS)
    unit_b = length_of(word_b) if word_b else (named[1] if named else None)
    unit_a = length_of(word_a) if word_a else unit_b
    try:
        u, v = float(a.replace(",", ".")), float(b.replace(",", "."))
    except ValueError:
        return None
    return (u * unit_a, v * unit_b) if unit_a and unit_b and min(u, v) > 0.0 else None


def _pairs(lines: Sequence[str]) -> Iterator[tuple[str, str]]:
    for line, below in pairwise(lines):
        names, values = (re.split(r"\s*[\t,;]\s*", one.strip()) for one in (line, below))
        if 1 < len(names) == len(values) and is_heading(line) and all(map(is_number, values)):
            yield from zip(names, values, strict=True)
    for line in lines:
        bare = line.replace('"', "").rstrip(" ,;\t")  # spreadsheets fill lines with empty cells
        line = _POWER.sub(lambda m: f"{m.group(1) or 1}e{m.group(2)} ", bare)
        match, spaced = _PAIR.fullmatch(line), _SPACED.fullmatch(line)
        if match is None or (spaced and spaced.group(1).casefold() in (*_GRID, "nodata_value")):
            match = spaced  # the comma may be a decimal one
        if match:
            yield match.group(1).strip(), match.group(2)


def _heading(lines: Sequence[str], names: Sequence[str] | None) -> tuple[str | None, float | None]:
    """Return the unit in the heading of a matrix: in the last line, or one for all columns."""
    named = None if _OF_A_NUMBER.search(lines[-1]) else named_unit(lines[-1], LENGTHS)
    if named is None and names:
        units = {named_unit(name, LENGTHS) for name in names}
        named = units.pop() if len(units) == 1 else None
    behind = _UNIT_BEHIND.search(lines[-1])
    if named is None and behind and behind.group(1).casefold() in _NO_LENGTHS:
        return behind.group(1), None
    return named or (None, None)
