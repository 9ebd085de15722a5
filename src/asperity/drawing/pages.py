"""HTML and Markdown pages, rendered by Jinja from the templates in `templates/`.

An HTML page extends `base.html` and fills its blocks `title` and `main`; `base.html` brings the
style sheet, `page.css`. Values are escaped in templates whose name ends in `.html` and left as they
are in all others.
"""

from __future__ import annotations

import base64
import mimetypes
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape

TEMPLATES = Path(__file__).parent / "templates"


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
    environment.filters["data_uri"] = data_uri
    return environment
