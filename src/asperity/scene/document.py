"""The contents of `scene.toml`, the scene's *document*: read, checked and written.

Errors name the file, the dotted key, its value, and what would be valid. The keys that a texture
may have are the parameters of the function that creates it.
"""

from __future__ import annotations

import inspect
import sys
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError, did_you_mean, require_choice

SCHEMA = 1
SECTIONS = ("schema", "tool", "bodies", "force", "coupling", "trajectory")
PARTS = ("mesh", "texture")
"""Tables of a body."""
SOFT = ("skin", "elastic")
"""Tables of a body that make it soft."""
SURFACE = ("texture", "friction", "stiffness")
"""Keys of a geom, and of a body, that say what its surface feels like."""
PLACING = ("mapping", "offset")
"""Keys of a map that place it on its body."""

Table = Mapping[str, Any]


def read_toml(path: Path) -> dict[str, Any]:
    """Return the contents of a TOML file.

    Raises
    ------
    AsperityError
        There is no such file, or it is not valid TOML.
    """
    if not path.is_file():
        raise AsperityError(f"no such file: {path}; a scene is a folder of scene.xml, scene.toml")
    try:
        data = path.read_bytes()
        marked = data.startswith((b"\xff\xfe", b"\xfe\xff"))
        return tomllib.loads(data.decode("utf-16" if marked else "utf-8-sig"))
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise AsperityError(
            f"{path} is not TOML: line {line} is no text in UTF-8; valid: saved as UTF-8"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise AsperityError(f"{path} is not TOML: {error}") from None


def check_document(document: Table, body_names: Iterable[str]) -> None:
    """Raise `AsperityError` for unknown keys, wrong types and unknown bodies in a document.

    Values are checked later, by the height fields, settings and motions that they describe.
    """
    require_keys(document, "", SECTIONS)
    schema = document.get("schema")
    if schema != SCHEMA or isinstance(schema, bool):
        raise AsperityError(f"schema must be {SCHEMA}, got {schema!r}")
    for section in SECTIONS[1:]:
        require_table(document.get(section, {}), section)
    tool = document.get("tool", {})
    require_keys(tool, "tool", ("body", "skin"))
    require_table(tool.get("skin", {}), "tool.skin")
    if "body" not in tool:
        raise AsperityError("tool.body is missing: the name of the body that is held")
    names = list(body_names)
    _require_body(tool["body"], "tool.body", names)
    for name, table in document.get("bodies", {}).items():
        _require_body(name, "bodies", names)
        require_table(table, f"bodies.{name}")
        require_keys(table, f"bodies.{name}", ("mesh", *SURFACE, "materials", "geoms", *SOFT))
        for part in (*PARTS, "materials", "geoms", *SOFT):
            require_table(table.get(part, {}), f"bodies.{name}.{part}")
        for material, texture in table.get("materials", {}).items():
            require_table(texture, f"bodies.{name}.materials.{material}")
        for geom, surface in table.get("geoms", {}).items():
            key = f"bodies.{name}.geoms.{geom}"
            require_table(surface, key)
            require_keys(surface, key, SURFACE)
            require_table(surface.get("texture", {}), f"{key}.texture")


def _require_body(name: Any, key: str, names: list[str]) -> None:
    if name not in names:
        known = shortened(names, 150) or "none"
        raise AsperityError(
            f"{key} names {name!r}, no body with a geom that can be touched (of URDF: <collision>)"
            f"{did_you_mean(name, names)}; those that can be touched: {known}"
        )


def require_table(value: Any, key: str) -> None:
    """Raise `AsperityError` if a value is not a table."""
    if not isinstance(value, Mapping):
        raise AsperityError(f"{key} must be a table ([{key}]), got {value!r}")


def require_keys(table: Table, where: str, valid: Iterable[str]) -> None:
    """Raise `AsperityError` for a key that is not one of `valid`, suggesting the nearest."""
    known = list(valid)
    for key in table:
        if key not in known:
            dotted = f"{where}.{key}" if where else key
            hint = did_you_mean(key, known, f"{where}.{{}}" if where else "{}")
            raise AsperityError(f"unknown key {dotted}{hint}; valid: {shortened(known, 180)}")


def shortened(words: Iterable[str], most: int) -> str:
    """Return words with commas, in so many letters at most."""
    text = ", ".join(words)
    return text if len(text) <= most else f"{text[:most].rpartition(',')[0]}, ..."


def arguments(table: Table, where: str, makes: Callable[..., Any] | type) -> dict[str, Any]:
    """Return a table as keyword arguments, with keys and types checked.

    Parameters
    ----------
    table : mapping
    where : str
        Dotted key of the table.
    makes : callable
        The function or dataclass that takes the arguments; its annotations define the valid types.
    """
    parameters = {
        name: parameter
        for name, parameter in inspect.signature(makes).parameters.items()
        if name not in ("cls", "self", "path")
    }
    require_keys(table, where, parameters)
    for name, parameter in parameters.items():
        if parameter.default is inspect.Parameter.empty and name not in table:
            kinds, sequences = _kinds(str(parameter.annotation))
            wanted = _wanted(kinds, sequences)
            raise AsperityError(f"{where}.{name} is missing" + f"; valid: {wanted}" * bool(wanted))
    return {
        key: _typed(value, f"{where}.{key}", str(parameters[key].annotation))
        for key, value in table.items()
    }


def parse_options(
    table: Table, key: str, makes: Callable[..., Any], source: str, placing: Iterable[str]
) -> dict[str, Any]:
    """Return the arguments of `makes` in a table; errors list all keys that it may have.

    Those are also `source`, which chose what makes it, and the keys of `placing`.
    """
    names = [n for n in inspect.signature(makes).parameters if n != "path"]
    require_keys(table, key, [source, *names, *placing])
    return arguments({k: v for k, v in table.items() if k in names}, key, makes)


def placing_of(table: Table, key: str) -> dict[str, Any]:
    """Return the arguments of `Surface` in a map's table that place it on its body."""
    return arguments({k: v for k, v in table.items() if k in PLACING}, key, _placing)


def _placing(mapping: str = "planar", offset: tuple[float, float] = (0.0, 0.0)) -> None:
    """Define the keys that place a map, and their types."""


def make_by_kind(
    what: str, makers: Mapping[str, Callable[..., Any]], table: Table, key: str,
    placing: Iterable[str],
) -> Any:  # fmt: skip
    """Return what the maker named by a table's `kind` makes of its other keys."""
    kind = table["kind"]
    at(f"{key}.kind", lambda: require_choice(what, kind, makers))
    given = parse_options(table, key, makers[kind], "kind", placing)
    return at(key, lambda: makers[kind](**given))


def find_file(table: Table, key: str, folder: Path | None) -> Path:
    """Return the path of a table's `file`, which has to exist; relative names lie in a folder."""
    if not isinstance(table["file"], str):
        raise AsperityError(f"{key}.file must be a text, got {table['file']!r}")
    path = beside(folder, table["file"])
    if not path.exists():
        raise AsperityError(f"{key}.file: no such file: {path}")
    return path


def merged(old: Table, new: Table) -> dict[str, Any]:
    """Return a deep copy of `old` updated with `new`; a value of None removes its key."""
    out = {k: merged(v, {}) if isinstance(v, Mapping) else v for k, v in old.items()}
    for key, value in new.items():
        if value is None:
            out.pop(key, None)
        elif isinstance(value, Mapping):
            old_value = out.get(key)
            out[key] = merged(old_value if isinstance(old_value, Mapping) else {}, value)
        else:
            out[key] = value
    return out


def tables_with_files(document: Table) -> list[Any]:
    """Return the tables of a document that name a file: meshes, maps, trajectory."""
    bodies = document.get("bodies", {}).values()
    owners = [owner for body in bodies for owner in (body, *body.get("geoms", {}).values())]
    tables = [owner.get(part) for owner in owners for part in (*PARTS, *SURFACE[1:])]
    tables += [table for body in bodies for table in body.get("materials", {}).values()]
    tables.append(document.get("trajectory"))
    return [table for table in tables if isinstance(table, Mapping) and "file" in table]


def _typed(value: Any, key: str, annotation: str) -> Any:
    """Return a value of the TOML converted to its annotated type, or raise `AsperityError`."""
    kinds, sequences = _kinds(annotation)
    if isinstance(value, bool):
        if "bool" in kinds:
            return value
    elif isinstance(value, int | float):
        if not _is_number(value):  # whole numbers may be larger than floats
            raise AsperityError(f"{key} must be finite, got {str(value)[:20]}")
        if "float" in kinds:
            return float(value)
        if "int" in kinds and isinstance(value, int):
            return value
    elif isinstance(value, str):
        if kinds & {"str", "Path"} or any(k.startswith("Literal") for k in kinds):
            return value
    elif isinstance(value, list | tuple) and sequences and all(map(_is_number, value)):
        return tuple(float(v) for v in value)
    wanted = _wanted(kinds, sequences) or "something else"
    raise AsperityError(f"{key} must be {wanted}, got {value!r}")


def _kinds(annotation: str) -> tuple[set[str], bool]:
    """Return the types of an annotation, and whether a list of numbers is among them."""
    kinds = {part.strip() for part in annotation.replace("NDArray", "Sequence").split("|")}
    sequences = any(k.startswith(("tuple", "Sequence", "list")) or "ArrayLike" in k for k in kinds)
    return kinds, sequences


def _is_number(value: Any) -> bool:
    known = isinstance(value, int | float) and not isinstance(value, bool)
    return known and abs(value) <= sys.float_info.max


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
    return " or ".join(words)


def beside(folder: Path | None, name: str) -> Path:
    """Return the path of a file named in a document; relative names lie in the given folder.

    Backslashes are those of Windows where there is no such file.
    """
    path = (folder or Path()) / Path(name).expanduser()
    return path if "\\" not in name or path.exists() else beside(folder, name.replace("\\", "/"))


def at(key: str, make: Callable[[], Any]) -> Any:
    """Return `make()`, with the dotted key prepended to its `AsperityError`."""
    try:
        return make()
    except AsperityError as error:
        raise AsperityError(f"{key}: {error}") from None


def write_toml(document: Table) -> str:
    """Return a document as TOML; keys whose value is None are left out."""
    import tomlkit  # slow to import

    return tomlkit.dumps(_without_none(document))


def _without_none(table: Table) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in table.items()
        if value is not None
    }
