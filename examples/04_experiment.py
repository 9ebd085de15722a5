"""A whole experiment with a simulated participant: trials, journal, threshold, figures."""

import tomllib
from pathlib import Path

from asperity.psychophysics.analysis.analysis import analyse
from asperity.psychophysics.analysis.results import read_results
from asperity.psychophysics.analysis.thresholds import AnalysisOptions
from asperity.psychophysics.design import parse_design
from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.session.presenters import HeadlessPresenter
from asperity.psychophysics.session.session import Session

file = Path(__file__).parent / "experiments" / "relief.toml"
document = tomllib.loads(file.read_text("utf-8"))
document["presentation"]["seconds"] = 0.1  # a person needs seconds; a simulated one does not
document["staircase"]["trials"] = 40
design = parse_design(document)

with Session(design, Path("P01-1"), "P01") as session:
    front = SimulatedInterface(design, "P01")
    outcome = session.run(HeadlessPresenter(design.stimuli), front, sleep=lambda _: None)
print(f"{outcome.answers} answers, complete: {outcome.complete}")

figures = Path("analysis")
figures.mkdir()
told = analyse(read_results(Path("P01-1")), figures, AnalysisOptions(samples=200))
found = told["forced-choice"][0]["psychometric"]
print(f"true threshold {100 * design.simulated.threshold:.0f} %")
print(
    f"found {100 * found['threshold']:.0f} % "
    f"({100 * found['threshold_low']:.0f} to {100 * found['threshold_high']:.0f})"
)
