"""Tables that a module keeps as TOML beside it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any


def table_beside(module: str, name: str) -> dict[str, Any]:
    """Return the TOML file `name` in the folder of a module, given by its `__file__`."""
    return tomllib.loads(Path(module).with_name(name).read_text("utf-8"))
