"""Settings of the documentation: `make docs` builds it into docs/_build/html, without a network."""

from __future__ import annotations

import re
from typing import Any

from asperity import __version__

project = "asperity"
author = "The asperity developers"
project_copyright = "The asperity developers"
release = version = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "**/.ipynb_checkpoints"]
default_role = "code"  # in docstrings, single backticks mean code

html_theme = "furo"
html_title = f"asperity {release}"
html_show_sphinx = False

# The tutorials are run at every build, in the Python that runs Sphinx.
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_merge_streams = True

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "none"  # types and units stand in the docstrings
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

# A bar with an even number of backticks after it stands outside of code.
_BAR = re.compile(r"\|(?=[^`]*(?:`[^`]*`[^`]*)*$)")


def plain_docstring(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Let a docstring be read as it stands.

    An indented paragraph that follows one at the margin is a formula: it becomes a block of plain
    text. Bars in running text, as in `|u''|`, are bars and not substitutions. A colon in the
    docstring of an attribute does not end a type: napoleon looks for one in the first line.
    """
    if what in ("attribute", "data", "property"):
        if lines and lines[0].startswith("Alias for field number"):
            lines.clear()
        lines[:0] = ["..", ""]  # an empty comment
    marked: list[str] = []
    above = ""  # the last line that was not empty
    formula = False
    for i, line in enumerate(lines):
        if line and not line.startswith("    "):
            formula = False
        elif line and i > 0 and not lines[i - 1].strip() and not formula:
            formula = bool(above) and not above.startswith((" ", "-", ".."))
            if formula:
                marked += [".. code-block:: text", ""]
        above = line or above
        marked.append(line if formula else _BAR.sub(r"\\|", line))
    lines[:] = marked


def setup(app: Any) -> None:
    """Register what is above; before napoleon, which rewrites the sections."""
    app.connect("autodoc-process-docstring", plain_docstring, priority=400)
