"""Vibration models in files of asperity's own: what HaTT's format cannot hold.

JSON, in SI units, every number to its last digit. `schema` counts the versions; files of HaTT's
format, which `asperity fit` wrote before and still writes beside, are read as well.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity._core.output import write_whole
from asperity.errors import AsperityError
from asperity.vibrotactile.harmonic import MOST_LINES, HarmonicModel
from asperity.vibrotactile.hatt import read_hatt
from asperity.vibrotactile.model import HIGHEST_ORDER, MOST_MODELS, TextureModel

FORMAT = "asperity vibration model"
SCHEMA = 2
"""Version of the files that are written; files of versions up to it are read.

In files of version 1, the noise beside lines passes no high-pass filter behind its AR filter.
"""
_LARGEST = 64 * 2**20
"""Of a file [bytes]."""


def write_model(model: TextureModel, path: str | Path) -> None:
    """Write a vibration model as a JSON file (`.json`) that `read_model` reads."""
    path = Path(path)
    if path.suffix != ".json":
        raise AsperityError(f"{path}: a vibration model is written as .json; HaTT's by write_hatt")
    out: dict[str, Any] = {
        "format": FORMAT, "schema": SCHEMA,
        "kind": "harmonic" if isinstance(model, HarmonicModel) else "noise",
        "name": model.name, "rate_hz": model.rate, "friction": model.friction,
        "speeds_m_s": model.speeds.tolist(), "forces_n": model.forces.tolist(),
        "ar_lsf": model.ar.tolist(), "variance": model.variance.tolist(),
        "triangles": model.mesh.triangles.tolist(),
    }  # fmt: skip
    if isinstance(model, HarmonicModel):
        out |= {
            "high_pass_hz": model.high_pass, "noise_high_pass_hz": model.noise_high_pass,
            "slowest_m_s": model.slowest, "lightest_n": model.lightest,
            "periods_m": model.periods.tolist(), "harmonics": model.harmonics.tolist(),
            "lines_real": model.lines.real.tolist(), "lines_imaginary": model.lines.imag.tolist(),
        }  # fmt: skip
    else:
        out |= {"ma_lsf": model.ma.tolist(), "gain": model.gain.tolist()}
    write_whole(path, json.dumps(out, allow_nan=False, ensure_ascii=False) + "\n")


def read_model(path: str | Path) -> TextureModel:
    """Return the vibration model in a `.json` of `write_model`, or in an `.xml` of HaTT's format.

    Raises
    ------
    AsperityError
        There is no such file, or it is no such model; the message names what is wrong and where.
    """
    path = Path(path)
    if path.suffix.lower() != ".json":
        return read_hatt(path)
    if not path.is_file():
        raise AsperityError(f"no such texture model: {path}; give a .json or .xml of asperity fit")
    if path.stat().st_size > _LARGEST:
        raise AsperityError(f"{path} is larger than {_LARGEST >> 20} MiB: no vibration model")
    try:
        content = json.loads(path.read_text("utf-8"), parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        raise AsperityError(f"{path} is not JSON: {str(error)[:120]}") from None
    except AsperityError as error:
        raise AsperityError(f"{path}: {error}") from None
    try:
        return _model(content)
    except AsperityError as error:
        raise AsperityError(f"{path}: {error}") from None


def _refused(word: str) -> NoReturn:
    raise AsperityError(f"its numbers must be finite, got {word}")


def _model(content: Any) -> TextureModel:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise AsperityError(f"no vibration model: its format is not {FORMAT!r}")
    schema = content.get("schema")
    if not isinstance(schema, int) or not 1 <= schema <= SCHEMA:
        raise AsperityError(f"schema must be 1 to {SCHEMA}, got {schema!r}; newer asperity?")
    kind = content.get("kind")
    if kind not in ("harmonic", "noise"):
        raise AsperityError(f"kind must be 'harmonic' or 'noise', got {kind!r}")
    speeds = _array(content, "speeds_m_s", (None,))
    n = speeds.size
    if n > MOST_MODELS:
        raise AsperityError(f"{n} models; valid: {MOST_MODELS} at most")
    ar = _array(content, "ar_lsf", (n, None))
    if ar.shape[1] > HIGHEST_ORDER:
        raise AsperityError(f"{ar.shape[1]} AR coefficients; valid: {HIGHEST_ORDER} at most")
    common: dict[str, Any] = {
        "name": str(content.get("name", "texture")), "rate": _number(content, "rate_hz"),
        "friction": _number(content, "friction"), "speeds": speeds,
        "forces": _array(content, "forces_n", (n,)), "ar": ar,
        "variance": _array(content, "variance", (n,)),
        "triangles": _whole(content, "triangles", (None, 3)),
    }  # fmt: skip
    if kind == "noise":
        return TextureModel(
            **common, ma=_array(content, "ma_lsf", (n, None)), gain=_array(content, "gain", (n,))
        )
    harmonics = _whole(content, "harmonics", (None, 2))
    h = len(harmonics)
    if h > MOST_LINES:
        raise AsperityError(f"{h} lines; valid: {MOST_LINES} at most")
    real, imaginary = (_array(content, f"lines_{part}", (n, h)) for part in ("real", "imaginary"))
    return HarmonicModel(
        **common, periods=_array(content, "periods_m", (None,)), harmonics=harmonics,
        lines=real + 1j * imaginary, high_pass=_number(content, "high_pass_hz"),
        noise_high_pass=_number(content, "noise_high_pass_hz") if schema > 1 else 0.0,
        slowest=_number(content, "slowest_m_s"), lightest=_number(content, "lightest_n"),
    )  # fmt: skip


def _number(content: dict[str, Any], key: str) -> float:
    value = content.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise AsperityError(f"{key} must be a finite number, got {str(value)[:40]!r}")
    return float(value)


def _array(content: dict[str, Any], key: str, shape: tuple[int | None, ...]) -> Array:
    """Return an array of a shape, in which None is any length."""
    if key not in content:
        raise AsperityError(f"{key} is missing")
    try:
        array = np.asarray(content[key], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise AsperityError(f"{key} must hold numbers in rows of one length") from None
    if array.size == 0 and len(shape) == 2:
        array = array.reshape(shape[0] or 0, shape[1] or 0)
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        wanted = " x ".join("any" if want is None else str(want) for want in shape)
        raise AsperityError(f"{key} must be {wanted} finite numbers, got shape {array.shape}")
    return array


def _whole(content: dict[str, Any], key: str, shape: tuple[int | None, ...]) -> Indices:
    array = _array(content, key, shape)
    if (array != np.floor(array)).any() or np.abs(array).max(initial=0.0) > 1e6:
        raise AsperityError(f"{key} must hold whole numbers")
    return np.asarray(array, dtype=np.int64)
