"""Make docs/cli.md, the command reference, from the parser: `python tools/cli_reference.py`.

The text around the tables of options is written by hand, in `cli_reference.md.jinja`: there
`{{ command("run") }}` stands for the description and the options of `asperity run`. With `--check`
nothing is written, and the exit code is 1 if docs/cli.md is not up to date.
"""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
import types
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import jinja2

from asperity.cli.main import COMMANDS
from asperity.cli.options import range_of
from asperity.cli.realtime_run import DeviceOptions

TOOLS = Path(__file__).parent
PAGE = TOOLS.parent / "docs" / "cli.md"
_KINDS = {int: "INT", float: "FLOAT", str: "STR", Path: "PATH"}
_LINK = "It also takes the [options of the servo loop](#options-of-the-servo-loop)."


class Option(NamedTuple):
    """One option or positional argument, as the page shows it."""

    usage: str
    default: str
    valid: str
    meaning: str


def commands() -> dict[str, type]:
    """Return the dataclass of each command by the command's name, in the order of the help."""
    out = {}
    for hint in get_args(COMMANDS):
        options, subcommand = get_args(hint)
        out[subcommand.name] = options
    return out


def options_of(options: type, prefix: str = "--") -> Iterator[Option]:
    """Yield the options of a command; not those of the servo loop, which have their own table."""
    hints = get_type_hints(options, include_extras=True)
    meanings = _field_texts(options)
    for field in fields(options):
        kind, metadata = _unwrapped(hints[field.name])
        if kind is DeviceOptions:
            continue
        name = field.name.replace("_", "-")
        if is_dataclass(kind):
            yield from options_of(kind, f"{prefix}{name}.")
            continue
        metavar = next((m.metavar for m in metadata if getattr(m, "metavar", None)), None)
        positional = any("Positional" in repr(m) for m in metadata)
        default = None if field.default is MISSING else field.default
        if positional:
            usage = metavar or name.upper()
        elif kind is bool:
            usage = f"{prefix}no-{name}" if default else f"{prefix}{name}"
        else:
            usage = f"{prefix}{name} {_shown_kind(kind)}"
        valid = range_of(hints[field.name])
        yield Option(
            f"`{usage}`", _shown_default(default), "" if valid is None else str(valid),
            _cell(meanings[field.name]),
        )  # fmt: skip


def described(options: type) -> tuple[str, str]:
    """Return the first line of a command's docstring, and the rest."""
    first, _, rest = inspect.cleandoc(options.__doc__ or "").partition("\n")
    return first, rest.strip()


def page() -> str:
    """Return the text of docs/cli.md."""
    known = commands()
    shown = []

    def command(name: str) -> str:
        shown.append(name)
        first, rest = described(known[name])
        table = _table(options_of(known[name]))
        has_device = any(
            _unwrapped(h)[0] is DeviceOptions
            for h in get_type_hints(known[name], include_extras=True).values()
        )
        parts = [f"## asperity {name}", first, rest, table, _LINK if has_device else ""]
        return "\n\n".join(part for part in parts if part)

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TOOLS), undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )  # fmt: skip
    text = environment.get_template("cli_reference.md.jinja").render(
        command=command,
        summaries=[(name, described(options)[0]) for name, options in known.items()],
        device_options=_table(options_of(DeviceOptions)),
    )
    if shown != list(known):
        raise SystemExit(
            f"cli_reference.md.jinja must show the commands {', '.join(known)} in this order, "
            f"got {', '.join(shown)}"
        )
    return text


def _unwrapped(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a type without `Annotated` and `| None`, and what stood in `Annotated`."""
    metadata = getattr(hint, "__metadata__", ())
    kind = get_args(hint)[0] if metadata else hint
    if get_origin(kind) in (Union, types.UnionType):
        kind = next(part for part in get_args(kind) if part is not type(None))
    return kind, metadata


def _shown_kind(kind: Any) -> str:
    """Return the placeholder of a value of a type."""
    if get_origin(kind) is tuple:
        parts = get_args(kind)
        if parts[-1] is Ellipsis:
            return f"{_shown_kind(parts[0])} ..."
        return " ".join(map(_shown_kind, parts))
    if get_origin(kind) is Literal:
        return "{" + ",".join(get_args(kind)) + "}"
    return _KINDS[kind]


def _shown_default(default: Any) -> str:
    if default is None or isinstance(default, bool) or default == ():
        return ""
    values = default if isinstance(default, tuple) else (default,)
    return "`" + " ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in values) + "`"


def _field_texts(options: type) -> dict[str, str]:
    """Return the docstring that follows each field of a dataclass."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(options))).body[0]
    assert isinstance(tree, ast.ClassDef)
    texts = {}
    for field, text in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            documented = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
            texts[field.target.id] = str(text.value.value) if documented else ""
    return texts


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").rstrip(".")


def _table(options: Iterator[Option]) -> str:
    """Return options as a table; a column that would be empty is left out."""
    rows = list(options)
    if not rows:
        return "No options."
    heads = [
        head
        for i, head in enumerate(("option", "default", "range", "meaning"))
        if any(row[i] for row in rows)
    ]
    kept = [i for i in range(4) if any(row[i] for row in rows)]
    lines = [heads, ["---"] * len(heads), *([row[i] for i in kept] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main(arguments: list[str]) -> int:
    """Write the page, or check it; return the exit code."""
    text = page()
    if arguments == ["--check"]:
        if PAGE.read_text("utf-8") == text:
            return 0
        print(f"{PAGE} is not up to date: run make reference", file=sys.stderr)
        return 1
    PAGE.write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
