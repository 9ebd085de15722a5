"""Poses as `rostopic echo` and `ros2 topic echo` print messages: YAML, `---` between them.

Of YAML only what these programs write is read: names, indented names within them, and lists.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from asperity._core.files import reading
from asperity._core.text_form import decoded
from asperity._core.text_table import TextTable
from asperity._core.unpacking import content_of
from asperity.errors import AsperityError
from asperity.scene.pose_json import table_of

YAML_FILES = (".yaml", ".yml")
_HEAD = 4096
_PLACE = re.compile(r"^ *(?:position|translation):\s*$", re.MULTILINE)
_LINE = re.compile(r"( *)([A-Za-z_]\w*):\s*(.*?)\s*")
_ITEM = re.compile(r" *- *(.*?)\s*")
_VALID = "valid: messages of one pose each, --- between them, as `rostopic echo` prints them"


def is_messages(path: Path) -> bool:
    """Return whether a text is of messages with poses, by its beginning."""
    if path.suffix.lower() in YAML_FILES:
        return True
    return _PLACE.search(decoded(content_of(path, _HEAD)) or "") is not None


def yaml_table(path: Path) -> tuple[TextTable, tuple[str, ...]]:
    """Return the rows of messages, a pose each, with the names of their columns, and notes.

    Raises
    ------
    AsperityError
        Lines that these programs do not write, or lists of poses; one line.
    """
    suffix = path.suffix.lower()
    with reading(path, "poses", (suffix,)):
        text = decoded(content_of(path))
        if text is None:
            raise AsperityError(f"{path}: cannot be read as a {suffix} file: no text; {_VALID}")
        records: list[dict[str, Any]] = [{}]
        within: list[tuple[int, dict[str, Any]]] = [(-1, records[0])]
        last: tuple[dict[str, Any], str] | None = None
        for number, line in enumerate(text.splitlines(), 1):
            bare = line.partition(" #")[0].rstrip() if "'" not in line and '"' not in line else line
            if bare in ("---", "..."):
                records += [{}] if records[-1] else []
                within, last = [(-1, records[-1])], None
                continue
            found, item = _LINE.fullmatch(bare), _ITEM.fullmatch(bare)
            if item is not None and last is not None and ":" not in bare:
                owner, name = last
                owner[name] = [*(owner[name] or []), item.group(1)]
            elif found is not None:
                depth, name, value = len(found.group(1)), found.group(2), found.group(3)
                while within[-1][0] >= depth:
                    within.pop()
                owner = within[-1][1]
                owner[name] = _value(value) if value else {}
                last = (owner, name)
                if not value:
                    within.append((depth, owner[name]))
            elif bare.strip() and not bare.lstrip().startswith(("#", "WARNING")):
                raise AsperityError(f"{path}: line {number} is {bare.strip()[:40]!r}; {_VALID}")
        return table_of(path, [record for record in records if record])


def _value(text: str) -> Any:
    """Return a value: a text, or a list of them."""
    if text[0] == "[" and text[-1] == "]":
        return [part.strip() for part in text[1:-1].split(",")]
    return text.strip("'\"") or "-"
