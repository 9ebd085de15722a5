"""`asperity plot`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import command
from asperity.cli.result import print_result


@command
@dataclass
class PlotCommand:
    """Draw the standard figures of a sweep's store, complete or not.

    The metric over one parameter with a quadratic fit in log-log; a map over two parameters; the
    variance that each parameter explains. By default, all figures for which the store has axes.
    """

    store: Annotated[Positional[Path], arg(metavar="STORE")]
    """The Zarr store that `asperity sweep` wrote."""
    view: str | None = None
    """curve, map, or effects. Default: all for which the store has axes."""
    metric: tuple[str, ...] = ()
    """Metrics to draw, a set of figures each. Default: the first in the store."""
    x: str | None = None
    """Parameter on the horizontal axis. Default: spacing, or the axis with most values."""
    y: str | None = None
    """Parameter on the vertical axis of a map. Default: the axis with second most values."""
    colour: str | None = None
    """Parameter shown by the colours of a curve. Default: the axis with most values, up to six."""
    out: Path = Path("out/plot")
    """Folder for the figures."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Draw the figures and print what each shows."""
        from asperity._core.output import result_folder
        from asperity.drawing import figure_style
        from asperity.studies.sweeps.figures import draw
        from asperity.studies.sweeps.store import open_sweep
        from asperity.studies.sweeps.views import choose_views

        data = open_sweep(self.store)
        views = choose_views(
            data, view=self.view, metrics=self.metric, x=self.x, y=self.y, colour=self.colour
        )
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            for view in views:
                figure_style.save(draw(data, view), folder, f"{view.metric}_{view.kind}")
        drawn = "; ".join(
            " ".join([view.metric, view.kind]) + (f" over {view.x}" if view.x else "")
            + (f" and {view.y}" if view.y else "") + (f", {view.colour}" * bool(view.colour))
            for view in views
        )  # fmt: skip
        figures = [f"{view.metric}_{view.kind}" for view in views]
        print_result(f"{self.out}: {drawn}", {"out": self.out, "figures": figures})
