"""Adapters are found by name, and what is missing is said in one sentence."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest

from beacon_core.errors import ConfigError
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.relaying import CONDUIT_GROUP, NETWORK_GROUP
from beacon_gateway import adapters


def registered(monkeypatch: pytest.MonkeyPatch, **points: str) -> None:
    known = {name: EntryPoint(name, value, "beacon.adapters") for name, value in points.items()}
    monkeypatch.setattr(adapters, "installed", lambda *_: known)


def test_our_own_adapters_are_registered() -> None:
    assert {"fake", "zenoh", "ros_topic", "ros_param"} <= set(adapters.installed())


def test_an_installed_adapter_is_loaded() -> None:
    adapter = adapters.load_adapter("fake")
    assert isinstance(adapter, Adapter)
    assert adapter.name == "fake"


def test_an_unknown_name_suggests_the_near_one() -> None:
    with pytest.raises(ConfigError, match=r"^no adapter 'zeno' is installed; did you mean 'zenoh'"):
        adapters.load_adapter("zeno")


def test_an_unknown_name_lists_what_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    registered(monkeypatch, one="a:b", another="c:d")
    with pytest.raises(ConfigError, match=r"'mqtt' is installed; possible here: another, one$"):
        adapters.load_adapter("mqtt")


def test_with_none_installed_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    registered(monkeypatch)
    with pytest.raises(ConfigError, match=r"install beacon-core with an extra"):
        adapters.load_adapter("zenoh")


def test_a_missing_module_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    registered(monkeypatch, mqtt="no_such_module_at_all:ADAPTER")
    with pytest.raises(
        ConfigError,
        match=r"^the adapter 'mqtt' needs the Python module 'no_such_module_at_all', which is not",
    ):
        adapters.load_adapter("mqtt")


def test_where_an_extra_of_that_name_exists_it_is_the_thing_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points = adapters.installed()

    def load(_: EntryPoint) -> object:
        raise ModuleNotFoundError("No module named 'zenoh'", name="zenoh")

    monkeypatch.setattr(EntryPoint, "load", load)
    assert "zenoh" in points
    with pytest.raises(ConfigError, match=r"run: pip install 'beacon-core\[zenoh\]'$"):
        adapters.load_adapter("zenoh")


def test_an_extra_serves_all_adapters_whose_names_begin_with_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def load(_: EntryPoint) -> object:
        raise ModuleNotFoundError("No module named 'rclpy'", name="rclpy")

    monkeypatch.setattr(EntryPoint, "load", load)
    with pytest.raises(ConfigError, match=r"the network 'ros' .* 'beacon-core\[ros\]'$"):
        adapters.find_installed(NETWORK_GROUP, "ros")
    with pytest.raises(ConfigError, match=r"the conduit 'ros_topic' .* 'beacon-core\[ros\]'$"):
        adapters.find_installed(CONDUIT_GROUP, "ros_topic")


def test_an_adapter_that_fails_when_imported_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    registered(monkeypatch, bad="beacon_core.limits:NO_SUCH_NAME")
    with pytest.raises(ConfigError, match=r"'bad' .*cannot be loaded: AttributeError: "):
        adapters.load_adapter("bad")


def test_something_else_under_that_name_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    registered(monkeypatch, bad="beacon_core.limits:MAX_HINTS")
    with pytest.raises(ConfigError, match=r"is not a beacon_core\.ports\.adapter\.Adapter"):
        adapters.load_adapter("bad")
