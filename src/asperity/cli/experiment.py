"""`asperity experiment` and `asperity analyse`."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import OmitArgPrefixes, Positional, arg

from asperity.cli.ranges import Between, check_ranges
from asperity.cli.realtime_run import DeviceOptions
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from asperity.psychophysics.design import ExperimentDesign
    from asperity.psychophysics.interfaces.front import Front
    from asperity.psychophysics.session.presenters import Presenter
    from asperity.psychophysics.session.session import SessionOutcome
    from asperity.realtime.servo.process import ServoSpec
    from asperity.scene.scene import Scene


@dataclass
class ExperimentCommand:
    """Run a participant's session of an experiment, or go on with it.

    The same command goes on where a session was interrupted. Every answer is on the disk before
    the next trial begins. Leaves answers.csv, trials.csv, and a recording of every interval.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE.toml")]
    """The experiment; see the documentation of experiments."""
    participant: str | None = None
    """A code, not a name: P07."""
    session: Annotated[int, Between(1, 1000)] = 1
    """Number of the session."""
    device: str | None = None
    """What the participant holds: haply, touch, ...: see `asperity devices`; or simulated."""
    page: bool = False
    """Ask in the live page, in a browser, instead of the terminal. Without --device: the mouse."""
    simulate: bool = False
    """A simulated participant answers. Without --device: in simulated time."""
    check: bool = False
    """Only check the experiment and all its stimuli, and say what there would be."""
    options: OmitArgPrefixes[DeviceOptions] = field(default_factory=DeviceOptions)
    port: Annotated[int, Between(0, 65535)] = 8080
    """Of the page, which is for this computer alone; 0: any that is free."""
    out: Path | None = None
    """Folder of this session. Default: out/experiment/FILE/PARTICIPANT-SESSION."""

    def run(self) -> None:
        """Run the session, and say how far it came."""
        check_ranges(self.options)
        check_ranges(self)
        from asperity.psychophysics.design import read_design
        from asperity.psychophysics.session.session import Session, participant_code

        design = read_design(self.file)
        if self.check:
            self._check(design)
            return
        if self.participant is None:
            raise AsperityError("--participant is missing: a code, such as P07")
        code = participant_code(self.participant)
        self._refuse_mixed()
        place = Path("out/experiment") / self.file.stem / f"{code}-{self.session}"
        with Session(design, self.out or place, code, self.session) as session:
            try:
                outcome = self._go_through(session)
            except KeyboardInterrupt:
                told = f"all {session.answers} answers are kept"
                raise KeyboardInterrupt(f"{told}; the same command goes on") from None
        self._say(outcome)

    def _refuse_mixed(self) -> None:
        if self.page and self.simulate:
            raise AsperityError("give --page or --simulate, not both")
        if self.device is None and not (self.page or self.simulate):
            raise AsperityError(
                "give --device NAME for what the participant holds, --page for the mouse, or "
                "--simulate for nobody"
            )
        if self.device is None and self.options != DeviceOptions():
            raise AsperityError("options of a device need --device")

    def _go_through(self, session: Any) -> SessionOutcome:
        from asperity.psychophysics.interfaces.front import SimulatedFront
        from asperity.psychophysics.interfaces.terminal import TerminalFront
        from asperity.psychophysics.session.presenters import DevicePresenter

        design = session.design
        if self.page:
            return self._in_page(session)
        front: Front = TerminalFront()
        if self.simulate:
            front = SimulatedFront(design, session.participant, session.number)
        if self.device is None:
            return self._with_progress(session, front)
        presenter = DevicePresenter(design.stimuli, functools.partial(self._spec, self.device))
        try:
            outcome: SessionOutcome = session.run(presenter, front)
        finally:
            presenter.close()
        return outcome

    def _with_progress(self, session: Any, front: Front) -> SessionOutcome:
        """Run a session in simulated time, with a bar."""
        from asperity.cli.progress import progress_bars
        from asperity.psychophysics.session.presenters import HeadlessPresenter
        from asperity.simulation.simulation import announce_compiling

        design = session.design
        announce_compiling()
        presenter: Presenter = HeadlessPresenter(design.stimuli, hand=design.presentation.hand)
        with progress_bars() as bars:
            task = bars.add_task(design.name, total=session.progress.most)
            ready = front.ready

            def show(trial: Any, progress: Any) -> None:
                bars.update(task, completed=progress.done)
                ready(trial, progress)

            front.ready = show  # type: ignore[method-assign]
            outcome: SessionOutcome = session.run(presenter, front, sleep=lambda _: None)
        return outcome

    def _in_page(self, session: Any) -> SessionOutcome:
        """Run a session in the page, and tell the experimenter here."""
        import sys

        from asperity.cli.realtime_run import key_values, with_coupling
        from asperity.psychophysics.interfaces.page import (
            Desk,
            PageFront,
            TrialLink,
            panels,
            smooth,
        )
        from asperity.psychophysics.session.presenters import DevicePresenter
        from asperity.realtime.servo.safety import SafetySettings
        from asperity.simulation.simulation import announce_compiling
        from asperity.viewer.server.server import Page, require_viser
        from asperity.viewer.session_config import SessionConfig

        require_viser()
        announce_compiling()
        design, options = session.design, self.options
        scene = with_coupling(design.stimuli.scene(design.all_stimuli()[0]), None)
        show = design.presentation.show
        choice = SessionConfig(
            scene if show else smooth(scene), design.name, self.device or "mouse",
            options=key_values(options.device_option), rate=options.rate_hz,
            passivity=not options.no_passivity,
            mapping={
                "scale": options.scale, "force_scale": options.force_scale,
                "clutch_button": options.clutch_button,
            },
            safety=SafetySettings(max_force=options.max_force_n),
            real_time=options.real_time,
        )  # fmt: skip
        desk = Desk(design)

        def spec(scene: Scene, seconds: float) -> ServoSpec:
            return link.spec(with_coupling(scene, None), seconds)

        with (
            TrialLink(choice, show=show) as link,
            Page(link, panels(desk, choice, show=show), port=self.port, label=design.name) as page,
        ):
            print(f"{page.url}  ({design.name}, {session.participant}; Ctrl-C pauses)", flush=True)
            presenter = DevicePresenter(design.stimuli, spec, on_servo=link.feel)
            front = PageFront(desk, lambda line: print(line, file=sys.stderr, flush=True))
            try:
                outcome: SessionOutcome = session.run(presenter, front)
            finally:
                presenter.close()
        return outcome

    def _spec(self, device: str, scene: Scene, seconds: float) -> ServoSpec:
        from asperity.cli.realtime_run import servo_spec, with_coupling

        return servo_spec(with_coupling(scene, None), device, self.options, seconds, None)

    def _check(self, design: ExperimentDesign) -> None:
        """Make every stimulus, and say what a session would be."""
        from asperity.psychophysics.procedures.procedures import procedure

        marks = design.check_scenes()
        first = procedure(design, "P00", 1)
        trial, most = first.next(), first.most
        assert trial is not None
        shown = design.presentation
        seconds = most * (len(trial.stimuli) * (shown.seconds + shown.pause) - shown.pause)
        adaptive = design.adaptive
        target = getattr(adaptive, "target", None)
        print(
            f"{self.file}: {design.name}, {design.method}; {len(marks)} stimuli made; at most "
            f"{most} trials of {len(trial.stimuli)} intervals, {seconds / 60.0:.3g} min of feeling"
            + (f"; the staircase goes to {100.0 * target:.1f} % right" if target else "")
        )

    def _say(self, outcome: SessionOutcome) -> None:
        if outcome.complete:
            print(f"{outcome.folder}: {outcome.answers} answers; the session is complete")
        else:
            print(
                f"{outcome.folder}: paused after {outcome.answers} answers, of at most "
                f"{outcome.most}; the same command goes on"
            )


@dataclass
class AnalyseCommand:
    """Analyse the sessions of an experiment: thresholds, magnitudes or scales, with figures."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Of a session, or one with folders of sessions in it."""
    function: str = "weibull"
    """logistic, normal, weibull: the psychometric function."""
    samples: Annotated[int, Between(100, 100000)] = 1000
    """Of the bootstrap: of intervals of magnitudes and scales, and of a function's deviance."""
    confidence: Annotated[float, Between(0.5, 0.999)] = 0.95
    """Of the intervals."""
    seed: Annotated[int, Between(0, 2**31 - 1)] = 0
    """Of the bootstrap."""
    out: Path | None = None
    """Folder for the results. Default: FOLDER/analysis."""
    overwrite: bool = False
    """Replace an earlier analysis."""

    def run(self) -> None:
        """Analyse, write, and say the main numbers."""
        check_ranges(self)
        from asperity._core.output import result_folder
        from asperity.psychophysics.analysis.analysis import Options, analyse
        from asperity.psychophysics.analysis.psychometric import FUNCTIONS
        from asperity.psychophysics.analysis.results import read_results

        require_choice("--function", self.function, FUNCTIONS)
        results = read_results(self.folder)
        options = Options(self.function, self.samples, self.confidence, self.seed)
        out = self.out or self.folder / "analysis"
        with result_folder(out, overwrite=self.overwrite) as folder:
            told = analyse(results, folder, options)
        print(f"{out}: {told['experiment']}, {told['method']}, {len(results)} sessions")
        for line in _lines(told):
            print(f"  {line}")


def _lines(told: dict[str, Any]) -> list[str]:
    """Return the main numbers of an analysis."""
    lines = [
        f"{session['name']}: not complete, {session['answers']} answers"
        for session in told["sessions"]
        if not session["complete"]
    ]
    for one in told.get("forced-choice", ()):
        found = one.get("psychometric")
        if found is None:
            lines.append(f"{one['session']}: {one['not_fitted']}")
            continue
        doubt = "; AT THE END OF THE RANGE: nothing was found" if found["at_bound"] else ""
        lines.append(
            f"{one['session']}: threshold {found['threshold']:.4g} "
            f"({found['threshold_low']:.4g} to {found['threshold_high']:.4g}), "
            f"{one['trials']} trials, deviance p {found['deviance_p']:.2g}{doubt}"
        )
    if "magnitude" in told:
        quadratic, power = told["magnitude"]["quadratic"], told["magnitude"]["power_law"]
        if power:
            lines.append(
                f"slope in log-log {power['slope']:.3g} ({power['low']:.3g} to {power['high']:.3g})"
            )
        if quadratic:
            peak = f", peak at {quadratic['peak']:.4g}" if quadratic["peak"] else ""
            lines.append(f"quadratic: R² {quadratic['r_squared']:.3f}{peak}")
    for method in ("pairs", "ranking"):
        if method in told:
            scale = told[method]["scales"][0]
            ranked = sorted(zip(scale["values"], told[method]["stimuli"], strict=True))[::-1]
            lines.append("most first: " + ", ".join(f"{name} ({v:.2f})" for v, name in ranked))
    return lines
