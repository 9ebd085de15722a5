"""Parsing and exit codes: 0 well, 1 our fault, 2 bad input, 130 interrupted."""

from __future__ import annotations

import contextlib
import io
import logging
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from asperity import __version__
from asperity.cli.demo import Demo
from asperity.cli.doctor import Doctor
from asperity.cli.sound import SoundCommand
from asperity.cli.study import Study
from asperity.errors import AsperityError

LogLevel = Literal["debug", "info", "warning", "error"]


@dataclass
class Arguments:
    """asperity: texture forces through a probe, and the perceptual studies behind them."""

    command: (
        Annotated[Demo, tyro.conf.subcommand("demo")]
        | Annotated[Study, tyro.conf.subcommand("study")]
        | Annotated[SoundCommand, tyro.conf.subcommand("sound")]
        | Annotated[Doctor, tyro.conf.subcommand("doctor")]
    )
    log_level: LogLevel = "warning"
    """How much to say on stderr."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments == ["--version"]:
        print(f"asperity {__version__}")
        return 0
    parsed = _parse(arguments)
    if isinstance(parsed, int):
        return parsed
    logging.basicConfig(level=parsed.log_level.upper(), format="asperity: %(message)s")
    try:
        parsed.command.run()
    except AsperityError as error:
        return _refuse(str(error))
    except KeyboardInterrupt:
        print("asperity: interrupted; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    return 0


def _parse(arguments: list[str]) -> Arguments | int:
    """Return the parsed arguments, or the exit code of a parser that has had its say."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(
                Arguments,
                args=_global_first(arguments),
                prog="asperity",
                config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            return 0
        return _refuse(_one_line(said.getvalue()))


def _global_first(arguments: list[str]) -> list[str]:
    """Return the arguments with --log-level, which any command takes, in front of the command."""
    if "--log-level" not in arguments:
        return arguments
    at = arguments.index("--log-level")
    return arguments[at : at + 2] + arguments[:at] + arguments[at + 2 :]


def _one_line(text: str) -> str:
    """Return a parser's boxed message as one line."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    plain = re.sub(r"[╭╮╰╯│─]", " ", plain)
    return re.sub(r"\s+", " ", plain).replace("Parsing error", "").strip()


def _refuse(reason: str) -> int:
    print(f"asperity: error: {' '.join(reason.split())}", file=sys.stderr)
    return 2
