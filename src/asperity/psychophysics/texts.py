"""What participants read, in their language: `texts.toml`, and an experiment's own file of them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError, did_you_mean
from asperity.scene.document import read_toml, require_keys, require_table

FILE = Path(__file__).with_name("texts.toml")
DEFAULT = "en"
_FIELD = re.compile(r"\{(\w*)\}")


@dataclass(frozen=True)
class Texts:
    """The texts of one language.

    Parameters
    ----------
    language : str
    by_key : mapping
        All texts of `texts.toml`.
    """

    language: str
    by_key: Mapping[str, str]

    def __call__(self, key: str, **fields: Any) -> str:
        """Return a text with its fields filled in."""
        text = self.by_key[key]
        return _FIELD.sub(lambda found: str(fields[found[1]]), text)

    def choices(self, count: int) -> str:
        """Return the numbers 1 to `count` as a choice: "1, 2 or 3"."""
        *first, last = map(str, range(1, count + 1))
        return f"{', '.join(first)} {self('or')} {last}"


@lru_cache(1)
def _own_texts() -> dict[str, dict[str, str]]:
    return tomllib.loads(FILE.read_text("utf-8"))


def read_texts(language: str = DEFAULT, path: Path | None = None) -> Texts:
    """Return the texts of a language.

    Parameters
    ----------
    language : str
        `en`, `de`, `fr`, `es`, or one of the file.
    path : Path, optional
        TOML file with a table for each language, whose texts replace those of asperity. What a
        language lacks is English.

    Raises
    ------
    AsperityError
        There is no such language, or the file has an unknown key or field, or what is no text.
    """
    own = _own_texts()
    if path is not None and not path.is_file():
        raise AsperityError(
            f"texts: no such file: {path}; give a TOML file beside the experiment's"
        )
    given = {} if path is None else read_toml(path)
    for name, table in given.items():
        try:
            _check(name, table, own[DEFAULT])
        except AsperityError as error:
            raise AsperityError(f"{path}: {error}") from None
    known = sorted({*own, *given})
    if language not in known:
        raise AsperityError(
            f"unknown language {language!r}{did_you_mean(language, known)}; valid: "
            f'{", ".join(known)}; texts = "FILE.toml" adds others'
        )
    return Texts(language, own[DEFAULT] | own.get(language, {}) | given.get(language, {}))


def _check(name: str, table: Any, english: Mapping[str, str]) -> None:
    """Raise if a table of texts has unknown keys, or fields that nothing fills."""
    require_table(table, name)
    require_keys(table, name, english)
    for key, text in table.items():
        if not isinstance(text, str):
            raise AsperityError(f"{name}.{key} must be a text, got {text!r}")
        fields = set(_FIELD.findall(english[key]))
        for field in _FIELD.findall(text):
            if field not in fields:
                valid = ", ".join(f"{{{one}}}" for one in sorted(fields)) or "none"
                raise AsperityError(f"{name}.{key} has a field {{{field}}}; valid: {valid}")
