"""`asperity experiment`."""

from __future__ import annotations

import dataclasses
import functools
import sys
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command
from asperity.cli.realtime_run import DeviceOptions
from asperity.cli.result import announce, print_result, wants_json
from asperity.errors import AsperityError

if TYPE_CHECKING:
    from asperity.psychophysics.design import ExperimentDesign
    from asperity.psychophysics.interfaces.protocol import ParticipantInterface, Progress
    from asperity.psychophysics.session.session import Session, SessionOutcome
    from asperity.psychophysics.session.trials import Trial
    from asperity.realtime.servo.process import ServoSpec
    from asperity.scene.scene import Scene


@command
@dataclass
class ExperimentCommand:
    """Run one participant's session of an experiment, or resume it.

    The same command resumes a session that was interrupted. Every answer is saved to disk before
    the next trial begins. Writes answers.csv, trials.csv, and a recording of every interval.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE.toml")]
    """The experiment; see the documentation, Experiments."""
    participant: str | None = None
    """Code of the participant, not a name: P07."""
    session: Annotated[int, Range(1, 1000)] = 1
    """Number of the session."""
    language: str | None = None
    """Language of the participant: en, de, fr, es, or one of the experiment's own. Default: that of
    the experiment."""
    device: str | None = None
    """Device that the participant holds: simulated, haply, touch, ...: see `asperity devices`."""
    page: bool = False
    """Ask in a page in the browser instead of the terminal. Without --device, the mouse moves the
    tool."""
    simulate: bool = False
    """Let a simulated participant answer. Without --device, in simulated time."""
    check: bool = False
    """Check the experiment and all its stimuli, and print what a session would contain."""
    options: Annotated[DeviceOptions, arg(name="")] = field(default_factory=DeviceOptions)
    port: Annotated[int, Range(0, 65535)] = 8080
    """Port of the page, which only this computer can open; 0: any free port."""
    out: Path | None = None
    """Folder of this session. Default: out/experiment/FILE/PARTICIPANT-SESSION."""

    def run(self) -> None:
        """Run the session, and print how far it came."""
        from asperity.psychophysics.design import read_design
        from asperity.psychophysics.session.session import Session, participant_code

        design = read_design(self.file, self.language)
        if self.check:
            self._check(design)
            return
        if self.participant is None:
            raise AsperityError("--participant is missing: give a code, such as P07")
        code = participant_code(self.participant)
        self._refuse_mixed()
        place = Path("out/experiment") / self.file.stem / f"{code}-{self.session}"
        with Session(design, self.out or place, code, self.session) as session:
            try:
                outcome = self._run(session)
            except KeyboardInterrupt:
                raise KeyboardInterrupt(
                    f"all {session.answers} answers are kept; the same command resumes"
                ) from None
        self._print(outcome)

    def _refuse_mixed(self) -> None:
        """Refuse options that contradict each other."""
        if self.page and self.simulate:
            raise AsperityError("give --page or --simulate, not both")
        if self.device is None and not (self.page or self.simulate):
            raise AsperityError(
                "give --device NAME for the participant's device, --page for the mouse, or "
                "--simulate for a simulated participant"
            )
        if self.device is None and self.options != DeviceOptions():
            raise AsperityError("options of the servo loop need --device NAME")

    def _run(self, session: Session) -> SessionOutcome:
        """Run a session with the front end and the presenter that the options choose."""
        from asperity.psychophysics.interfaces.protocol import SimulatedInterface
        from asperity.psychophysics.interfaces.terminal import TerminalInterface
        from asperity.psychophysics.session.presenters import DevicePresenter

        if self.page:
            return self._run_in_page(session)
        if self.device is None:
            return self._run_simulated(session)
        front: ParticipantInterface = TerminalInterface(write=sys.stderr if wants_json() else None)
        if self.simulate:
            front = SimulatedInterface(session.design, session.participant, session.number)
        spec = functools.partial(self._spec, self.device)
        with closing(DevicePresenter(session.design.stimuli, spec)) as presenter:
            return session.run(presenter, front)

    def _run_simulated(self, session: Session) -> SessionOutcome:
        """Run a session in simulated time, with a progress bar."""
        from asperity.cli.progress import progress_bars
        from asperity.psychophysics.interfaces.protocol import SimulatedInterface
        from asperity.psychophysics.session.presenters import HeadlessPresenter
        from asperity.simulation.tool_contact import announce_compiling

        design = session.design
        announce_compiling()
        with progress_bars() as bars:
            task = bars.add_task(design.name, total=session.progress.most)

            class Participant(SimulatedInterface):
                def ready(self, trial: Trial, progress: Progress) -> None:
                    bars.update(task, completed=progress.done)

            presenter = HeadlessPresenter(design.stimuli, hand=design.presentation.hand)
            front = Participant(design, session.participant, session.number)
            return session.run(presenter, front, sleep=lambda _: None)

    def _run_in_page(self, session: Session) -> SessionOutcome:
        """Run a session in the page; print the answers on stderr for the experimenter."""
        from asperity.cli.realtime_run import parse_device_options, with_coupling
        from asperity.psychophysics.interfaces.page import (
            PageInterface,
            ParticipantPanel,
            TrialClient,
            panels,
        )
        from asperity.psychophysics.session.presenters import DevicePresenter
        from asperity.simulation.tool_contact import announce_compiling
        from asperity.viewer.server.server import Page, require_viser
        from asperity.viewer.session_config import SessionConfig

        require_viser()
        announce_compiling()
        design, options = session.design, self.options
        scene = with_coupling(design.stimuli.scene(design.all_stimuli()[0]), None)
        show = design.presentation.show
        config = SessionConfig(
            scene if show else scene.smooth(), design.name, self.device or "mouse",
            options=parse_device_options(options.device_option), **options.session(),
        )  # fmt: skip
        desk = ParticipantPanel(design)

        def spec(scene: Scene, seconds: float) -> ServoSpec:
            return link.spec(with_coupling(scene, None), seconds)

        with (
            TrialClient(config, show=show) as link,
            Page(link, panels(desk, config, show=show), port=self.port, label=design.name) as page,
        ):
            announce(f"{page.url}  ({design.name}, {session.participant}; Ctrl-C pauses)")
            front = PageInterface(desk, lambda line: print(line, file=sys.stderr, flush=True))
            with closing(DevicePresenter(design.stimuli, spec, on_servo=link.feel)) as presenter:
                return session.run(presenter, front)

    def _spec(self, device: str, scene: Scene, seconds: float) -> ServoSpec:
        """Return the servo process of one interval."""
        from asperity.cli.realtime_run import servo_spec, with_coupling

        return servo_spec(with_coupling(scene, None), device, self.options, seconds, None)

    def _check(self, design: ExperimentDesign) -> None:
        """Make every stimulus, and print what a session would contain."""
        from asperity.psychophysics.expected import expected_lines, steps_of_adjustments
        from asperity.psychophysics.procedures.procedures import procedure

        digests = design.check_scenes()
        first = procedure(design, "P01", 1)
        trial, most = first.next(), first.most
        assert trial is not None
        shown = design.presentation
        what, presented = "trials", float(most)
        if design.kind == "adjust":
            steps = steps_of_adjustments(design)
            what, presented = f"adjustments of about {steps:.0f} steps", most * steps
        seconds = presented * (len(trial.stimuli) * (shown.seconds + shown.pause) - shown.pause)
        every = design.session.break_every
        breaks = (most - 1) // every if every else 0
        count = len(trial.stimuli)
        adaptive = design.adaptive
        target = getattr(adaptive, "target", None)
        line = (
            f"{self.file}: {design.name}, {design.method}; {len(digests)} stimuli are valid; "
            f"at most {most} {what} of {count} interval{'s' * (count > 1)}, "
            f"{seconds / 60.0:.3g} min of exploration"
            + (f", {breaks} breaks of at least {design.session.break_seconds:g} s" * bool(breaks))
            + (f"; the staircase converges to {100.0 * target:.1f} % correct" if target else "")
        )
        expected = expected_lines(design)
        facts = {
            "name": design.name, "method": design.method, "stimuli": len(digests),
            "most_trials": most, "intervals": count, "exploration_s": seconds, "breaks": breaks,
            "converges_to": target, "expected": expected,
        }  # fmt: skip
        print_result([line, *(f"  {one}" for one in expected)], facts)

    def _print(self, outcome: SessionOutcome) -> None:
        line = (
            f"{outcome.folder}: {outcome.answers} answers; the session is complete; "
            f"next: asperity analyse {outcome.folder}"
        )
        if not outcome.complete:
            line = (
                f"{outcome.folder}: paused after {outcome.done} of at most {outcome.most} "
                f"{outcome.unit}; the same command resumes"
            )
        print_result(line, dataclasses.asdict(outcome))
