"""Figures are as wide as pages show them, and their text is large enough there."""

import ast
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import asperity
from asperity.drawing.figure_style import (
    PAGE_WIDTH,
    SMALLEST,
    colour_and_marker,
    log_scale,
    save,
    style,
)
from figure_text import smallest_text

SOURCES = Path(asperity.__file__).parent


def calls(path):
    return [node for node in ast.walk(ast.parse(path.read_text("utf-8")))
            if isinstance(node, ast.Call)]  # fmt: skip


def drawing_files():
    return [
        path
        for path in sorted(SOURCES.rglob("*.py"))
        if "figure_style import" in path.read_text("utf-8")
    ]


def numbers(node):
    """Return the numbers in an expression, on either side of a condition or in a call."""
    return [
        part.value
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and isinstance(part.value, int | float)
    ]


@pytest.mark.parametrize("path", drawing_files(), ids=lambda path: path.stem)
def test_no_text_is_made_smaller_and_no_figure_wider_than_the_page(path):
    for call in calls(path):
        for keyword in call.keywords:
            value = keyword.value
            if keyword.arg in ("fontsize", "labelsize"):
                assert min(numbers(value), default=SMALLEST) >= SMALLEST, f"line {call.lineno}"
            if keyword.arg == "figsize" and isinstance(value, ast.Tuple):
                assert max(numbers(value.elts[0]), default=0.0) <= PAGE_WIDTH, f"line {call.lineno}"


def test_every_text_of_a_plain_figure_is_large_enough():
    with style():
        figure = Figure(figsize=(PAGE_WIDTH, 3.0))
        axis = figure.subplots()
        axis.plot([1.0, 1e6], [1e-3, 1e3], label="a line")
        log_scale(axis)
        axis.set(xlabel="time [s]", ylabel="force [N]", title="A figure")
        axis.legend(title="lines")
    points, text = smallest_text(figure)
    assert points >= SMALLEST, text


def test_scripts_count_as_small():
    with style():
        figure = Figure()
        figure.text(0.5, 0.5, "F$_n$ of 1 N")
    assert smallest_text(figure)[0] == pytest.approx(0.7 * 9.5)


def test_a_figure_is_saved_alike_twice(tmp_path):
    written = []
    for name in ("a", "b"):
        with style():
            figure = Figure(figsize=(4.0, 3.0))
            figure.subplots().plot(np.arange(5.0))
        svg, png = save(figure, tmp_path, name, ("svg", "png"))
        written.append(svg.read_bytes())
        assert png.stat().st_size > 1000
    assert written[0] == written[1]


def test_thirty_six_series_are_told_apart():
    assert len({colour_and_marker(i) for i in range(36)}) == 36
