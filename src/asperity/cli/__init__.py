"""The command line: `asperity COMMAND`."""

from asperity.cli.main import main

__all__ = ["main"]
