"""``beacon check-config``: what a configuration means, or everything wrong with it."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import attrs
import cattrs
import yaml

from beacon_core.errors import ConfigError
from beacon_gateway.access.exposure import check_exposure
from beacon_gateway.commands.run import read_config
from beacon_gateway.config import Config
from beacon_gateway.console.exits import Exit
from beacon_gateway.console.terminal import printable, write_json
from beacon_gateway.problems import DocumentError, Problem

__all__ = ["parser", "plain_problems", "run"]

_NOT_SHOWN = "(given, not shown)"


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Check a configuration without starting anything. Prints 'ok' and the "
        "configuration with every default filled in; or every problem, each with its place."
    )
    made.add_argument("file", nargs="?", type=Path, metavar="FILE", help="without: the default")
    made.add_argument("--json", action="store_true", help="print one JSON document instead")
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code."""
    try:
        loaded = read_config(arguments.file)
    except ConfigError as error:
        if not arguments.json:
            raise
        write_json({"ok": False, "problems": plain_problems(error)})
        return Exit.USAGE
    effective = _plain(loaded.config)
    doubts = (*loaded.corrections, *_doubts(loaded.config))
    if arguments.json:
        warnings = [_plain_problem(doubt) for doubt in doubts]
        write_json({"ok": True, "warnings": warnings, "config": effective})
        return Exit.OK
    for doubt in doubts:
        sys.stderr.write(f"warning: {doubt}\n")
    text = yaml.safe_dump(effective, sort_keys=False, allow_unicode=True)
    sys.stdout.write("# ok\n" + "".join(f"{printable(line)}\n" for line in text.splitlines()))
    return Exit.OK


def plain_problems(error: ConfigError) -> list[dict[str, str]]:
    """Everything that is wrong, as JSON would say it."""
    cause = error if isinstance(error, DocumentError) else error.__cause__
    if isinstance(cause, DocumentError):
        return [_plain_problem(problem) for problem in cause.problems]
    return [{"path": "$", "message": str(error)}]


def _doubts(config: Config) -> list[Problem]:
    """What ``beacon run`` would warn of or refuse, unless it is told otherwise."""
    try:
        warning = check_exposure(config.http)
    except ConfigError as error:
        warning = str(error).partition(": ")[2]
    return [Problem("$.http.host", warning)] if warning else []


def _plain_problem(problem: Problem) -> dict[str, str]:
    return {"path": problem.path, "message": problem.message}


def _plain(config: Config) -> Any:
    """As JSON would say it: texts, numbers, lists and mappings only."""
    plain = json.loads(json.dumps(cattrs.unstructure(config), default=str))
    for name, source in config.sources.items():
        plain["sources"][name]["options"] |= dict.fromkeys(_secrets(source.options), _NOT_SHOWN)
    return plain


def _secrets(options: Any) -> list[str]:
    """What the adapter keeps out of its options' repr: passwords and the like, where given."""
    fields = attrs.fields(type(options))
    return [field.name for field in fields if not field.repr and getattr(options, field.name)]
