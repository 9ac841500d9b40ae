"""The ``beacon`` command: picks the subcommand, and turns whatever ends it into an exit code."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from beacon_core.errors import ConfigError
from beacon_gateway import __version__
from beacon_gateway.console.exits import EXIT_CODES, Exit, Fault
from beacon_gateway.console.streams import keep_stdout_for_data

__all__ = ["COMMANDS", "main"]

COMMANDS: Mapping[str, str] = {
    "run": "run the gateway",
    "announce": "announce one or several entities until stopped",
    "watch": "show a running gateway's entities live",
    "get": "show one entity, or list all",
    "demo": "run a gateway with a small simulated fleet",
    "token": "make an API token, or a client's secret",
    "check-config": "check a configuration and show what it means",
    "doctor": "explain an empty view: look at each source's carrier",
    "relay": "carry topics of any type from one network to another",
}
"""Each subcommand with its line in the help; a module in ``commands`` of that name runs it."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run ``beacon``; returns the exit code. ``argv`` is without the program's name."""
    if argv is None:
        keep_stdout_for_data()
    for stream in (sys.stdout, sys.stderr):
        # What robots say may not exist in the terminal's character set.
        getattr(stream, "reconfigure", _nothing)(errors="backslashreplace")
    try:
        code = _dispatch(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader has seen enough, as in `beacon get | head -1`. Python must find nothing left
        # to flush at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Exit.OK
    except Fault as fault:
        return _say(str(fault), fault.code)
    except ConfigError as error:
        return _say(str(error), Exit.USAGE)
    except KeyboardInterrupt:
        return Exit.INTERRUPTED
    return code


def _dispatch(argv: Sequence[str]) -> int:
    top = _parser()
    arguments = top.parse_args(argv)
    if arguments.command is None:
        top.print_help(sys.stderr)
        return Exit.USAGE
    command = _load(arguments.command)
    parser: argparse.ArgumentParser = command.parser()
    parser.prog = f"beacon {arguments.command}"
    parser.description = textwrap.fill(parser.description or "", 80)
    parser.epilog = EXIT_CODES
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    code: int = command.run(parser.parse_args(arguments.rest))
    return code


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, COMMANDS)) + 2
    listed = "\n".join(f"  {name:{width}}{summary}" for name, summary in COMMANDS.items())
    parser = argparse.ArgumentParser(
        prog="beacon",
        usage="beacon [-h] [--version] COMMAND ...",
        description="Discovery beacons for robots: announce, collect and serve them.",
        epilog=f"commands:\n{listed}\n\n"
        f"'beacon COMMAND --help' says more about one.\n\n{EXIT_CODES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"beacon {__version__}")
    parser.add_argument(
        "command", nargs="?", choices=COMMANDS, metavar="COMMAND", help=argparse.SUPPRESS
    )
    parser.add_argument("rest", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    return parser


def _load(name: str) -> Any:
    """The module of one subcommand: the others need not be imported, nor be importable."""
    try:
        return importlib.import_module(f"beacon_gateway.commands.{name.replace('-', '_')}")
    except ModuleNotFoundError as error:
        raise Fault(
            f"'beacon {name}' needs the Python module {error.name!r}; "
            "run: pip install 'beacon-core[gateway]'"
        ) from error


def _say(message: str, code: Exit) -> int:
    try:
        sys.stderr.write(f"beacon: {message}\n")
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    return code


def _nothing(**_: object) -> None:
    pass
