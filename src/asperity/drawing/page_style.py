"""The style sheet of the HTML pages, for a page that is not made from `templates/base.html`."""

from pathlib import Path

STYLE = (Path(__file__).parent / "templates" / "page.css").read_text("utf-8")
