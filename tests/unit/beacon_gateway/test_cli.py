"""The ``beacon`` command as a whole: what ends it, and with which code."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_gateway import __version__, cli
from beacon_gateway.console.exits import Exit, Fault


class Command:
    """Stands in for a subcommand's module."""

    def __init__(self, ends: Any) -> None:
        self.ends = ends

    def parser(self) -> argparse.ArgumentParser:
        return argparse.ArgumentParser(description="words " * 40)

    def run(self, _: argparse.Namespace) -> int:
        if isinstance(self.ends, BaseException):
            raise self.ends
        return int(self.ends)


def ended(monkeypatch: pytest.MonkeyPatch, ends: Any) -> int:
    monkeypatch.setattr(importlib, "import_module", lambda _: Command(ends))
    return cli.main(["get"])


@pytest.mark.parametrize(
    ("ends", "code", "said"),
    [
        (Exit.OK, 0, ""),
        (Exit.NOT_FOUND, 3, ""),
        (Fault("the port is in use"), 1, "beacon: the port is in use\n"),
        (Fault("no such thing", Exit.NOT_FOUND), 3, "beacon: no such thing\n"),
        (ConfigError("$.a: wrong"), 2, "beacon: $.a: wrong\n"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_whatever_ends_a_command_becomes_an_exit_code_and_a_message_on_stderr(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    ends: Any,
    code: int,
    said: str,
) -> None:
    assert ended(monkeypatch, ends) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == said


def test_a_package_that_is_not_installed_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def missing(_: str) -> None:
        raise ModuleNotFoundError("No module named 'rich'", name="rich")

    monkeypatch.setattr(importlib, "import_module", missing)
    assert cli.main(["watch"]) == 1
    assert capsys.readouterr().err == (
        "beacon: 'beacon watch' needs the Python module 'rich'; "
        "run: pip install 'beacon-core[gateway]'\n"
    )


def test_without_a_command_the_help_is_shown_and_it_is_wrong_usage(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert cli.main([]) == 2
    assert "check-config" in capsys.readouterr().err


def test_an_unknown_command_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(["frob"])
    assert caught.value.code == 2
    assert "invalid choice: 'frob'" in capsys.readouterr().err


def test_the_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"beacon {__version__}\n"


@pytest.mark.parametrize("command", ["", *cli.COMMANDS])
def test_help_tells_the_exit_codes_and_fits_a_terminal(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as caught:
        cli.main([*filter(None, [command]), "--help"])
    assert caught.value.code == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"usage: beacon {command}".rstrip())
    assert "exit codes:" in shown
    assert max(map(len, shown.splitlines())) <= 80


def test_a_reader_that_has_seen_enough_is_no_failure() -> None:
    """As in `beacon --help | head -1`, but with the pipe surely closed."""
    read_end, write_end = os.pipe()
    os.close(read_end)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "beacon_gateway", "check-config"],
            stdout=write_end,
            stderr=subprocess.PIPE,
            timeout=30,
            check=False,
        )
    finally:
        os.close(write_end)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_closed_stdout_in_this_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with (tmp_path / "out").open("w") as out:
        monkeypatch.setattr(sys, "stdout", out)
        assert ended(monkeypatch, BrokenPipeError()) == 0


def test_a_closed_stderr_does_not_change_the_exit_code(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with (tmp_path / "err").open("w") as kept:

        class Closed(io.StringIO):
            def write(self, _: str) -> int:
                raise BrokenPipeError

            def fileno(self) -> int:
                return kept.fileno()

        monkeypatch.setattr(sys, "stderr", Closed())
        assert ended(monkeypatch, Fault("nobody reads this")) == 1


def test_what_the_terminal_cannot_show_is_escaped_not_a_failure() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "beacon_gateway", "get", "--url", "http://ü:1"],
        env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"},
        capture_output=True,
        timeout=30,
        check=False,
    )
    assert b"Traceback" not in done.stderr
    assert b"\\xfc" in done.stderr


def test_the_module_can_be_run() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "beacon_gateway", "--version"],
        capture_output=True,
        text=True,
        timeout=30,
        check=True,
    )
    assert done.stdout == f"beacon {__version__}\n"


def test_what_native_libraries_write_to_stdout_is_kept_apart_from_the_data() -> None:
    program = (
        "import os\n"
        "from beacon_gateway.console.streams import keep_stdout_for_data\n"
        "keep_stdout_for_data()\n"
        "os.write(1, b'a native complaint')\n"
        "print('data \u00e9')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        check=True,
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )
    assert done.stdout.decode() == "data \u00e9\n"
    assert b"a native complaint" in done.stderr
