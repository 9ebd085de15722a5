"""Seeds and fingerprints: hashes of content, the same on every machine; and dotted keys."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

_SEEDS = 2**31 - 1


def hash_content(*parts: Any) -> str:
    """Return the SHA-256 of numbers, texts, lists and tables, regardless of the order of keys."""
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def seed_of(*parts: Any) -> int:
    """Return a seed, 0 to 2^31 - 2, that depends on the content of `parts` alone."""
    return int(hash_content(*parts)[:16], 16) % _SEEDS


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of all files in a folder."""
    if not path.is_dir():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    files = sorted(file for file in path.rglob("*") if file.is_file())
    return hash_content([[file.relative_to(path).as_posix(), hash_file(file)] for file in files])


def flatten(table: Mapping[str, Any], leaf: Iterable[str] = (), where: str = "") -> dict[str, Any]:
    """Return nested tables as one with dotted keys.

    A table with one of the keys `leaf` is kept as a value.
    """
    out: dict[str, Any] = {}
    words = set(leaf)
    for name, value in table.items():
        key = f"{where}.{name}" if where else name
        if isinstance(value, Mapping) and value and not words & set(value):
            out |= flatten(value, words, key)
        else:
            out[key] = value
    return out


def nest(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table with dotted keys as nested tables."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        *path, name = key.split(".")
        place = out
        for part in path:
            place = place.setdefault(part, {})
        place[name] = value
    return out
