"""What stands in `scene.toml`: reading, checking and writing it.

An error names the file, the dotted key, what stands there, and what is valid. Which keys a
texture may have follows from the parameters of the function that makes it.
"""

from __future__ import annotations

import difflib
import inspect
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError

SCHEMA = 1
SECTIONS = ("schema", "tool", "bodies", "force", "coupling", "trajectory")
BODY = ("mesh", "texture")
"""What is told of a body."""
PLACING = ("mapping", "offset")
"""Keys of a texture that say how it lies on its body."""

Table = Mapping[str, Any]


def read_toml(path: Path) -> dict[str, Any]:
    """Return what a TOML file holds, or say where it is wrong."""
    if not path.is_file():
        raise AsperityError(f"no such file: {path}; a scene is a folder of scene.xml, scene.toml")
    try:
        with open(path, "rb") as stream:
            return tomllib.load(stream)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise AsperityError(f"{path} is not TOML: {error}") from None


def check_document(document: Table, body_names: Iterable[str]) -> None:
    """Refuse unknown keys, wrong types and unknown bodies in what `scene.toml` holds.

    The values are judged by what is made of them: height fields, force settings, a motion.
    """
    require_keys(document, "", SECTIONS)
    schema = document.get("schema")
    if schema != SCHEMA or isinstance(schema, bool):
        raise AsperityError(f"schema must be {SCHEMA}, got {schema!r}")
    for section in SECTIONS[1:]:
        require_table(document.get(section, {}), section)
    tool = document.get("tool", {})
    require_keys(tool, "tool", ("body",))
    if "body" not in tool:
        raise AsperityError("tool.body is missing: the name of the body that is held")
    names = list(body_names)
    _require_body(tool["body"], "tool.body", names)
    for name, table in document.get("bodies", {}).items():
        _require_body(name, "bodies", names)
        require_table(table, f"bodies.{name}")
        require_keys(table, f"bodies.{name}", BODY)
        for part in BODY:
            require_table(table.get(part, {}), f"bodies.{name}.{part}")


def _require_body(name: Any, key: str, names: list[str]) -> None:
    if name not in names:
        raise AsperityError(
            f"{key} names {name!r}, a body that scene.xml does not have{_hint(name, names)}; "
            f"it has: {', '.join(names)}"
        )


def require_table(value: Any, key: str) -> None:
    """Refuse what is no table."""
    if not isinstance(value, Mapping):
        raise AsperityError(f"{key} must be a table ([{key}]), got {value!r}")


def require_keys(table: Table, where: str, valid: Iterable[str]) -> None:
    """Refuse a key that is not one of `valid`, naming the nearest."""
    known = list(valid)
    for key in table:
        if key not in known:
            dotted = f"{where}.{key}" if where else key
            near = _nearest(key, known)
            hint = f" (did you mean {f'{where}.{near}' if where else near}?)" if near else ""
            raise AsperityError(f"unknown key {dotted}{hint}; valid: {', '.join(known)}")


def _nearest(word: Any, known: list[str]) -> str | None:
    near = difflib.get_close_matches(str(word), known, n=1, cutoff=0.6)
    return near[0] if near else None


def _hint(word: Any, known: list[str]) -> str:
    near = _nearest(word, known)
    return f" (did you mean {near!r}?)" if near else ""


def arguments(table: Table, where: str, makes: Callable[..., Any] | type) -> dict[str, Any]:
    """Return `table` as keyword arguments of what it describes, its keys and types checked.

    Parameters
    ----------
    table : mapping
    where : str
        The dotted key of the table.
    makes : callable
        A function or a dataclass; its annotations say which types are valid.
    """
    valid = {
        name: str(parameter.annotation)
        for name, parameter in inspect.signature(makes).parameters.items()
        if name not in ("cls", "self", "path")
    }
    if isinstance(makes, type) and hasattr(makes, "__dataclass_fields__"):
        valid = {f.name: str(f.type) for f in fields(makes) if f.init}
    require_keys(table, where, valid)
    missing = [
        name
        for name, parameter in inspect.signature(makes).parameters.items()
        if name in valid and parameter.default is inspect.Parameter.empty and name not in table
    ]
    if missing:
        raise AsperityError(f"{where}.{missing[0]} is missing")
    return {key: _typed(value, f"{where}.{key}", valid[key]) for key, value in table.items()}


def _typed(value: Any, key: str, annotation: str) -> Any:
    """Return a value of the TOML as its annotation wants it, or refuse it."""
    kinds = {part.strip() for part in annotation.replace("NDArray", "Sequence").split("|")}
    sequences = any(k.startswith(("tuple", "Sequence", "list")) or "ArrayLike" in k for k in kinds)
    if isinstance(value, bool):
        if "bool" in kinds:
            return value
    elif isinstance(value, int | float):
        if not math.isfinite(value):
            raise AsperityError(f"{key} must be finite, got {value!r}")
        if "float" in kinds:
            return float(value)
        if "int" in kinds and isinstance(value, int):
            return value
    elif isinstance(value, str):
        if kinds & {"str", "Path"} or any(k.startswith("Literal") for k in kinds):
            return value
    elif isinstance(value, list | tuple) and sequences and all(map(_is_number, value)):
        return tuple(float(v) for v in value)
    raise AsperityError(f"{key} must be {_wanted(kinds, sequences)}, got {value!r}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _wanted(kinds: set[str], sequences: bool) -> str:
    words = [
        word
        for kind, word in (("bool", "true or false"), ("float", "a number"), ("str", "a text"))
        if kind in kinds
    ]
    if "int" in kinds and "float" not in kinds:
        words.append("a whole number")
    if sequences:
        words.append("a list of numbers")
    return " or ".join(words) or "something else"


def beside(folder: Path | None, name: str) -> Path:
    """Return the path of a file named in a scene or a study: relative ones lie in its folder."""
    return (folder or Path()) / Path(name).expanduser()


def at(key: str, make: Callable[[], Any]) -> Any:
    """Return `make()`; an error of it names the dotted key that it comes from."""
    try:
        return make()
    except AsperityError as error:
        raise AsperityError(f"{key}: {error}") from None


def write_toml(document: Table) -> str:
    """Return a document of tables, texts, numbers and lists of numbers as TOML."""
    lines: list[str] = []
    _write_table(document, "", lines)
    return "\n".join(lines).strip() + "\n"


def _write_table(table: Table, where: str, lines: list[str]) -> None:
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    if where and (plain or not table):
        lines += ["", f"[{where}]"]
    lines += [f"{_key(key)} = {_value(value)}" for key, value in plain.items() if value is not None]
    for key, value in table.items():
        if isinstance(value, Mapping):
            _write_table(value, f"{where}.{_key(key)}" if where else _key(key), lines)


def _key(name: str) -> str:
    bare = name.replace("-", "").replace("_", "")
    return name if bare.isascii() and bare.isalnum() else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        control = {chr(c): f"\\u{c:04X}" for c in (*range(32), 127)}
        return '"' + "".join(control.get(c, c) for c in escaped) + '"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return repr(value)
