"""``beacon doctor``: why a view is empty, as far as it can be seen from here."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import attrs
from rich.text import Text

from beacon_core.errors import ConfigError
from beacon_core.ports.examination import Finding, Level
from beacon_gateway.commands.check_config import plain_problems
from beacon_gateway.commands.run import read_config
from beacon_gateway.config import Config, LogLevel
from beacon_gateway.console import tally
from beacon_gateway.console.checkup import Checkup, check_up
from beacon_gateway.console.client import Absent, GatewayClient, Unreachable
from beacon_gateway.console.exits import Exit
from beacon_gateway.console.flags import seconds
from beacon_gateway.console.logs import set_up_logging
from beacon_gateway.console.terminal import cell, console, write_json
from beacon_gateway.vendor import BEACON

__all__ = ["parser", "run"]

_STYLES = {Level.OK: "green", Level.NOTE: "yellow", Level.PROBLEM: "bold red"}
_MARK_WIDTH = max(map(len, Level)) + 2
_INDENT = "  "

_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1", "": "127.0.0.1"}  # noqa: S104 - not ours
"""Where to ask a gateway that serves on every address."""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Explain an empty view: look at the carrier of each configured source for a "
        "few seconds, and ask a running gateway what it has counted. Changes nothing. The exit "
        "code is 1 if a problem was found."
    )
    made.add_argument("-c", "--config", type=Path, metavar="FILE", help="without: the default")
    made.add_argument("--url", help="the running gateway (default: as configured)")
    made.add_argument(
        "--seconds", type=seconds, default=5.0, metavar="S", help="look so long (default: 5)"
    )
    made.add_argument("--json", action="store_true", help="print one JSON document instead")
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code."""
    set_up_logging(LogLevel.WARNING)
    try:
        loaded = read_config(arguments.config)
    except ConfigError as error:
        if not arguments.json:
            raise
        write_json({"ok": False, "problems": plain_problems(error)})
        return Exit.USAGE
    for correction in loaded.corrections:
        sys.stderr.write(f"warning: {correction}\n")
    gateway = _Gateway(loaded.config, arguments.url)
    checkups = []
    for checkup in check_up(loaded.config, arguments.seconds):
        checkups.append(checkup)
        if not arguments.json:
            _show(f"{checkup.name} ({checkup.adapter})", checkup.findings)
    counted = gateway.findings()
    problems = [
        finding
        for group in (*(one.findings for one in checkups), counted)
        for finding in group
        if finding.level is Level.PROBLEM
    ]
    if arguments.json:
        write_json(_document(checkups, gateway.url, counted, problems))
    else:
        _show(f"gateway at {gateway.url}", counted)
        _print(cell(_verdict(problems), _STYLES[Level.PROBLEM if problems else Level.OK]))
    return Exit.FAILED if problems else Exit.OK


class _Gateway:
    """A running gateway, asked before everything else and after it."""

    def __init__(self, config: Config, url: str | None) -> None:
        self._config = config
        self.url = url or _configured_url(config)
        self._before = self._ask()

    def findings(self) -> list[Finding]:
        """What its counters say."""
        after = self._ask()
        if isinstance(after, Finding):
            return [after]
        before = after if isinstance(self._before, Finding) else self._before
        found = list(tally.findings(before, after, self._config.sources))
        if not self._config.allow_new_entities:
            what = "allow_new_entities is false: nobody is shown but the configured entities"
            advice = "list the others under entities, or set it to true"
            found.append(Finding(Level.NOTE, what, advice))
        return found

    def _ask(self) -> dict[str, Any] | Finding:
        try:
            with GatewayClient(self.url) as client:
                answer = client.get("/health")
        except Unreachable as error:
            what, _, advice = str(error).partition("; ")
            level = Level.NOTE if isinstance(error, Absent) else Level.PROBLEM
            return Finding(level, what, advice)
        if answer.ok and BEACON in answer.body:
            return answer.body
        what = f"what answers at {self.url} is no beacon gateway"
        return Finding(Level.PROBLEM, what, "name the right address with --url")


def _configured_url(config: Config) -> str:
    host = _EVERYWHERE.get(config.http.host, config.http.host)
    scheme = "http" if config.http.tls is None else "https"
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{config.http.port}"


def _verdict(problems: list[Finding]) -> str:
    if not problems:
        return "Nothing was found that keeps hints from being heard."
    count = "One problem was" if len(problems) == 1 else f"{len(problems)} problems were"
    return f"{count} found{'' if len(problems) == 1 else '; the first'}: {problems[0].what}."


def _document(
    checkups: list[Checkup], url: str, counted: list[Finding], problems: list[Finding]
) -> dict[str, object]:
    return {
        "ok": not problems,
        "verdict": _verdict(problems),
        "sources": [attrs.asdict(one) for one in checkups],
        "gateway": {"url": url, "findings": [attrs.asdict(one) for one in counted]},
    }


def _show(heading: str, found: Iterable[Finding]) -> None:
    _print(cell(heading, "bold"))
    for one in found:
        mark = cell(f"{one.level:{_MARK_WIDTH}}", _STYLES[one.level])
        _print(Text(_INDENT) + mark + cell(one.what))
        if one.advice:
            _print(Text(" " * (len(_INDENT) + _MARK_WIDTH)) + cell(one.advice))
    _print(Text())


def _print(line: Text) -> None:
    # Not wrapped: what is one line here can be searched for, and copied.
    console().print(line, soft_wrap=True)
