"""`asperity plot`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


@dataclass
class PlotCommand:
    """Draw the usual views of a sweep's store, complete or not.

    The metric over one parameter, with a quadratic in log-log; the map of two parameters; what
    each parameter alone explains. Which of them, and of what, follows from what the store holds.
    """

    store: Annotated[Positional[Path], arg(metavar="STORE")]
    """What `asperity sweep` wrote."""
    view: str | None = None
    """curve, map, or effects. Default: all that the store has the axes for."""
    metric: tuple[str, ...] = ()
    """Numbers that were kept, a set of figures each. Default: the first."""
    x: str | None = None
    """Parameter along the figure. Default: spacing, or the axis with most values."""
    y: str | None = None
    """Parameter up a map. Default: the axis with most values but one."""
    colour: str | None = None
    """Parameter of a curve's colours. Default: the axis with most values, up to six."""
    out: Path = Path("out/plot")
    """Folder for the figures."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Read, choose, draw."""
        from asperity._core.output import result_folder
        from asperity.drawing import figure_style
        from asperity.studies.sweeps.figures import draw
        from asperity.studies.sweeps.store import open_sweep
        from asperity.studies.sweeps.views import chosen

        data = open_sweep(self.store)
        views = chosen(
            data, view=self.view, metrics=self.metric, x=self.x, y=self.y, colour=self.colour
        )
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            for view in views:
                figure_style.save(draw(data, view), folder, f"{view.metric}_{view.kind}")
        told = "; ".join(
            " ".join([view.metric, view.kind]) + (f" over {view.x}" if view.x else "")
            + (f" and {view.y}" if view.y else "") + (f", {view.colour}" * bool(view.colour))
            for view in views
        )  # fmt: skip
        print(f"{self.out}: {told}")
