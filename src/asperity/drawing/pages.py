"""HTML and Markdown pages, rendered by Jinja from the templates in `templates/`.

An HTML page extends `base.html` and fills its blocks `title` and `main`; `base.html` brings the
style sheet, `page.css`. Values are escaped in templates whose name ends in `.html` and left as they
are in all others. The functions `data_uri`, `filled`, `inline` and `table_row` are filters of
templates.
"""

from __future__ import annotations

import base64
import mimetypes
import re
import textwrap
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape

TEMPLATES = Path(__file__).parent / "templates"
STYLE = (TEMPLATES / "page.css").read_text("utf-8")
"""The style sheet, for a page that is not made from `base.html`."""


def render(template_name: str, **values: Any) -> str:
    """Return a page rendered from a template.

    Parameters
    ----------
    template_name : str
        File name in `templates/`.
    **values
        Variables of the template.

    Raises
    ------
    jinja2.UndefinedError
        If the template uses a variable that is not among the values.
    """
    return _environment().get_template(template_name).render(**values)


def data_uri(path: Path) -> str:
    """Return a file as a `data:` URI, by which a page contains a picture instead of linking it."""
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"


def filled(text: str, width: int = 110) -> str:
    """Return paragraphs, separated by empty lines, filled anew."""
    parts = [" ".join(part.split()) for part in text.strip().split("\n\n")]
    return "\n\n".join(textwrap.fill(part, width, break_on_hyphens=False) for part in parts)


def inline(text: str) -> Markup:
    """Return HTML of a text with the code, bold and italics of Markdown."""
    out = str(escape(text))
    for mark, tag in ((r"\*\*", "b"), (r"\*", "i"), ("`", "code")):
        out = re.sub(f"{mark}(.+?){mark}", rf"<{tag}>\1</{tag}>", out)
    return Markup(out)


def table_row(cells: Sequence[str]) -> str:
    """Return a row of a Markdown table; a bar in a cell becomes a slash."""
    return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=select_autoescape(["html"], default_for_string=False, default=False),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    for function in (data_uri, filled, inline, table_row):
        environment.filters[function.__name__] = function
    return environment
