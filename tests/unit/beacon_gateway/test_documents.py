"""YAML files: read, or one sentence why not."""

from __future__ import annotations

from pathlib import Path

import pytest

from beacon_core.errors import ConfigError
from beacon_gateway.documents import read_yaml


def refusal(path: Path, content: bytes) -> str:
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        read_yaml(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


def test_a_document_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("a: {b: [1, 2.5, x], ü: yes}\nbase: &base {x: 1}\nmore: {<<: *base, x: 2}\n")
    assert read_yaml(path) == {
        "a": {"b": [1, 2.5, "x"], "ü": True},
        "base": {"x": 1},
        "more": {"x": 2},
    }


def test_an_empty_file_is_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("# only a comment\n")
    assert read_yaml(path) is None


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: No such file or directory$"):
        read_yaml(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a: 1\nb: 2\na: 3\n", "line 3, column 1: the key 'a' is already given in line 1"),
        (b"a: [1\nb: 2\n", "line 2, column 2: expected ',' or ']', but got ':'"),
        (b"a: \xff\n", "not UTF-8 text (byte 3)"),
        (b"a: \x00\n", "not YAML: unacceptable character #x0000: special characters are not"),
        (b"a: 2024-99-99\n", "not YAML: month must be in 1..12"),
        (b"a: !!python/name:os.system\n", "line 1, column 4: could not determine a constructor"),
        (b"{[1]: 2}\n", "line 1, column 2: found unhashable key"),
        (b"[" * 5000, "not YAML: maximum recursion depth exceeded"),
    ],
)
def test_what_is_not_yaml_is_one_sentence_with_the_line(
    tmp_path: Path, content: bytes, message: str
) -> None:
    assert refusal(tmp_path / "a.yaml", content).startswith(message)
