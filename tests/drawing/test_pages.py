"""Pages: escaping, Markdown in HTML, tables and filled paragraphs."""

import jinja2
import pytest

from asperity.drawing import pages
from asperity.drawing.pages import data_uri, filled, inline, render, table_row


def test_html_templates_escape_and_markdown_templates_do_not(tmp_path, monkeypatch):
    for name in ("a.html", "a.md"):
        (tmp_path / name).write_text("{{ value }}")
    monkeypatch.setattr(pages, "TEMPLATES", tmp_path)
    pages._environment.cache_clear()
    try:
        assert render("a.html", value="<b> & c") == "&lt;b&gt; &amp; c"
        assert render("a.md", value="<b> & c") == "<b> & c"
        with pytest.raises(jinja2.UndefinedError, match="value"):
            render("a.md")
    finally:
        pages._environment.cache_clear()


def test_code_bold_and_italics_become_html():
    assert inline("**yes**, `k < 1` and *n*") == ("<b>yes</b>, <code>k &lt; 1</code> and <i>n</i>")
    assert inline("2 * 3") == "2 * 3"


def test_a_bar_does_not_split_a_cell():
    assert table_row(["a", "|u''|"]) == "| a | /u''/ |"


def test_paragraphs_are_filled():
    assert filled("one\ntwo\n\nthree four", width=9) == "one two\n\nthree\nfour"


def test_a_picture_is_contained_in_a_page(tmp_path):
    (tmp_path / "a.svg").write_text("<svg/>")
    assert data_uri(tmp_path / "a.svg") == "data:image/svg+xml;base64,PHN2Zy8+"
    assert "<style>\n:root" in render("base.html")
