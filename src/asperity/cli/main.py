"""The entry point: parse, check ranges, run one command, return an exit code.

0: success. 1: a fault of asperity. 2: bad input. 130: interrupted.
"""

from __future__ import annotations

import contextlib
import io
import logging
import math
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from asperity import __version__
from asperity.cli.analyse import AnalyseCommand
from asperity.cli.bake import BakeCommand
from asperity.cli.compare import CompareCommand
from asperity.cli.demo import DemoCommand
from asperity.cli.design import DesignCommand
from asperity.cli.devices import DevicesCommand
from asperity.cli.doctor import DoctorCommand
from asperity.cli.experiment import ExperimentCommand
from asperity.cli.export import ExportCommand
from asperity.cli.findings import FindingsCommand
from asperity.cli.fit import FitCommand
from asperity.cli.options import check_ranges
from asperity.cli.plot import PlotCommand
from asperity.cli.predict import PredictCommand
from asperity.cli.record import RecordCommand, ReplayCommand
from asperity.cli.result import set_json
from asperity.cli.run import RunCommand
from asperity.cli.sound import SoundCommand
from asperity.cli.stability import StabilityCommand
from asperity.cli.study import StudyCommand
from asperity.cli.sweep import SweepCommand
from asperity.cli.view import ViewCommand
from asperity.errors import AsperityError, did_you_mean

LogLevel = Literal["debug", "info", "warning", "error"]
_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)
_ONE_INTERRUPTION = 0.5
"""Signals closer together than this count as one [s]."""


COMMANDS = (
    Annotated[DemoCommand, tyro.conf.subcommand("demo")]
    | Annotated[StudyCommand, tyro.conf.subcommand("study")]
    | Annotated[RunCommand, tyro.conf.subcommand("run")]
    | Annotated[RecordCommand, tyro.conf.subcommand("record")]
    | Annotated[ReplayCommand, tyro.conf.subcommand("replay")]
    | Annotated[ViewCommand, tyro.conf.subcommand("view")]
    | Annotated[ExportCommand, tyro.conf.subcommand("export")]
    | Annotated[SoundCommand, tyro.conf.subcommand("sound")]
    | Annotated[StabilityCommand, tyro.conf.subcommand("stability")]
    | Annotated[FindingsCommand, tyro.conf.subcommand("findings")]
    | Annotated[FitCommand, tyro.conf.subcommand("fit")]
    | Annotated[DevicesCommand, tyro.conf.subcommand("devices")]
    | Annotated[SweepCommand, tyro.conf.subcommand("sweep")]
    | Annotated[PlotCommand, tyro.conf.subcommand("plot")]
    | Annotated[BakeCommand, tyro.conf.subcommand("bake")]
    | Annotated[DesignCommand, tyro.conf.subcommand("design")]
    | Annotated[CompareCommand, tyro.conf.subcommand("compare")]
    | Annotated[ExperimentCommand, tyro.conf.subcommand("experiment")]
    | Annotated[AnalyseCommand, tyro.conf.subcommand("analyse")]
    | Annotated[PredictCommand, tyro.conf.subcommand("predict")]
    | Annotated[DoctorCommand, tyro.conf.subcommand("doctor")]
)
"""The commands, in the order of the help."""


@dataclass
class Arguments:
    """Render haptic texture: simulate, feel, record and compare textured contact."""

    command: Annotated[COMMANDS, tyro.conf.arg(name="")]
    log_level: LogLevel = "warning"
    """Least severe messages that are printed on stderr."""
    json: bool = False
    """Print the result as JSON, in SI units."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal may lack characters of a message, and a file name may not be decodable.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        with _stopped_by_signals():
            code = _run(arguments)
            if sys.stdout:
                sys.stdout.flush()
        return code
    except KeyboardInterrupt as stop:
        # A command that keeps partial results passes a message.
        print(
            f"asperity: interrupted; {str(stop) or 'nothing unfinished was kept'}", file=sys.stderr
        )
        return 130
    except BrokenPipeError:
        # The reader of stdout is gone. Python flushes once more at exit: into /dev/null.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (AsperityError, OSError, MemoryError) as error:
        logging.getLogger("asperity").debug("traceback of the error:", exc_info=True)
        return _refuse(str(error) or "not enough memory")


def _run(arguments: list[str]) -> int:
    """Parse the arguments and run their command; return the exit code."""
    if arguments == ["--version"]:
        print(f"asperity {__version__}")
        return 0
    parsed = _parse(arguments)
    if isinstance(parsed, int):
        return parsed
    logging.basicConfig(format="asperity: %(message)s")
    logging.getLogger("asperity").setLevel(parsed.log_level.upper())
    set_json(parsed.json)
    check_ranges(parsed.command)
    parsed.command.run()
    return 0


@contextlib.contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """Turn the signals that end a process into `KeyboardInterrupt`, so that the block cleans up.

    Signals in quick succession count as one, so that a second Ctrl-C does not interrupt the
    clean-up.
    """
    last = -math.inf

    def interrupt(*_: object) -> None:
        nonlocal last
        before, last = last, time.monotonic()
        if last - before > _ONE_INTERRUPTION:
            raise KeyboardInterrupt

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    usual = {getattr(signal, name): signal.getsignal(getattr(signal, name)) for name in names}
    # Signals that the caller ignores or handles are left alone; only the main thread may set
    # handlers.
    replaced = [s for s, handler in usual.items() if handler in _DEFAULTS]
    if threading.current_thread() is not threading.main_thread():
        replaced = []
    try:
        for number in replaced:
            signal.signal(number, interrupt)
        yield
    except KeyboardInterrupt:
        raise
    except BaseException:
        # An interruption between two kernels reaches us as Numba's SystemError.
        if last > -math.inf:
            raise KeyboardInterrupt from None
        raise
    finally:
        for number in replaced:
            signal.signal(number, usual[number])


def _parse(arguments: list[str]) -> Arguments | int:
    """Return the parsed arguments, or an exit code if the parser printed help or an error."""
    options = [word.partition("=")[0] for word in arguments if word.startswith("--")]
    for name in {name: None for name in options if options.count(name) > 1}:
        print(f"asperity: {name} is given more than once; the last one counts", file=sys.stderr)
    message = io.StringIO()
    try:
        with contextlib.redirect_stderr(message):
            return tyro.cli(
                Arguments,
                args=_global_first(arguments),
                prog="asperity",
                config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            return 0
        return _refuse(one_line(message.getvalue()))


def _global_first(arguments: list[str]) -> list[str]:
    """Return the arguments with --log-level and --json moved in front of the command."""
    if "--json" in arguments:
        return ["--json", *_global_first([word for word in arguments if word != "--json"])]
    for at, word in enumerate(arguments):
        name, equals, _ = word.partition("=")
        if name == "--log-level":
            end = at + (1 if equals else 2)
            return arguments[at:end] + arguments[:at] + arguments[end:]
    return arguments


def _refuse(reason: str) -> int:
    """Print why the input is refused, in one line; return the exit code."""
    print(f"asperity: error: {' '.join(reason.split())}", file=sys.stderr)
    return 2


_KINDS = {"FLOAT": "a number", "INT": "a whole number"}
_HEADINGS = (
    r"^(Value error|Unrecognized options|Missing argument|Invalid choice|Required options); "
)


def one_line(text: str) -> str:
    """Return the boxed message of tyro as one line: what is wrong, and what would be valid."""
    plain = re.sub(r"\x1b\[[0-9;]*m|[╭╮╰╯│]", " ", text)
    plain = plain.partition("For full helptext")[0]
    parts = [" ".join(part.split()).strip("─ ") for part in re.split(r"[─-]{3,}", plain)]
    message = re.sub(_HEADINGS, "", "; ".join(part for part in parts if part))
    wrong = re.search(r"Error parsing (\S+): .*?Argument helptext: \S+ (\S+)", message)
    value = re.search(r"'([^']*)'\](?:\.| does)|: '([^']*)'", message)
    if wrong and value:
        kind = wrong[2].replace("{None}|", "")
        given = value[1] if value[1] is not None else value[2]
        return f"{wrong[1]} must be {_KINDS.get(kind, kind)}, got {given!r}"
    unknown = re.match(r"Unrecognized options: (.*?)(?:; (.*))?$", message)
    if unknown:
        near = re.match(r"Perhaps you meant: (--[\w.-]+)", unknown[2] or "")
        known = re.match(r"Available subcommands: (.*?)(?:;|$)", unknown[2] or "")
        if known:  # the first word is no command, so what follows it is not at fault
            word = unknown[1].split(",")[0]
            hint = did_you_mean(word, known[1].split(", "))
            return f"no command {word!r}{hint}; one of: {known[1]}"
        hint = f" (did you mean {near[1]}?)" if near else ""
        return f"unknown: {unknown[1]}{hint}"
    return message
