"""The configuration: the embedded default, every key, every mistake with its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core.errors import ConfigError
from beacon_core.ports.adapter import Adapter, Malformed
from beacon_core.skew import SkewPolicy
from beacon_gateway.config import (
    HttpConfig,
    LogLevel,
    SourceConfig,
    default_config,
    load_config,
    parse_config,
    read_manifest,
)
from beacon_gateway.tree import entities as tree
from beacon_gateway.tree.entities import App, Area, Component, Function, RosBinding
from beacon_gateway.tree.manifest import Manifest


@attrs.frozen
class Options:
    mode: str = attrs.field(
        default="router", validator=attrs.validators.in_(("router", "client", "peer"))
    )
    listen: tuple[str, ...] = ()


def lookup(name: str) -> Adapter:
    if name not in ("radio", "zenoh"):
        raise ConfigError(f"no adapter {name!r} is installed")

    def nothing(*_: object) -> Any:
        raise NotImplementedError

    return Adapter(name, Options, lambda _: Malformed(""), nothing, nothing, default_ttl_s=15.0)


def problems(document: object) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        parse_config(document, lookup)
    return str(caught.value).splitlines()


def source(**given: object) -> dict[str, object]:
    return {"sources": {"robots": {"adapter": "radio", **given}}}


def test_without_a_file_the_gateway_is_its_own_router_for_this_machine() -> None:
    config = default_config(lookup).config
    assert config.http == HttpConfig("127.0.0.1", 8080)
    assert list(config.sources) == ["zenoh"]
    assert config.sources["zenoh"].options == Options("router", ("tcp/127.0.0.1:7447",))
    assert config.allow_new_entities


def test_the_embedded_default_suits_the_real_adapter() -> None:
    assert default_config().corrections == ()


def test_an_empty_file_and_a_file_without_sources_keep_the_default() -> None:
    assert parse_config(None, lookup) == default_config(lookup)
    config = parse_config({"http": {"port": 0}}, lookup).config
    assert config.http.port == 0
    assert list(config.sources) == ["zenoh"]


def test_every_key_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "gateway.yaml"
    path.write_text(
        """
        http: {host: 0.0.0.0, port: 80}
        vendor_name: Acme
        log_level: debug
        allow_new_entities: false
        sources:
          robots:
            adapter: radio
            ttl_s: 2
            expiry_s: 60
            max_hints: 5
            source_rate: 10
            global_rate: 20
            skew_policy: arrival
            options: {mode: client, listen: [a, b]}
          plant: {adapter: radio}
        entities:
          areas: [{id: hall, name: Hall}]
          components: [{id: ecu, name: ECU}]
          apps: [{id: app, name: App, component_id: ecu, ros_node: /arm/app}]
          functions: [{id: drive, name: Drive, hosts: [app]}]
        """
    )
    loaded = load_config(path, lookup)
    assert loaded.corrections == ()
    config = loaded.config
    assert config.http == HttpConfig("0.0.0.0", 80)  # noqa: S104 - nothing is opened
    assert (config.vendor_name, config.log_level) == ("Acme", LogLevel.DEBUG)
    assert not config.allow_new_entities
    assert config.sources["robots"] == SourceConfig(
        adapter="radio",
        ttl_s=2.0,
        expiry_s=60.0,
        max_hints=5,
        source_rate=10.0,
        global_rate=20.0,
        skew_policy=SkewPolicy.ARRIVAL,
        options=Options("client", ("a", "b")),
    )
    known = config.entities.tree()
    assert known.areas == {"hall": Area("hall", "Hall")}
    assert known.components == {"ecu": Component("ecu", "ECU")}
    assert known.apps == {"app": App("app", "App", "ecu", ros_binding=RosBinding("arm/app"))}
    assert known.functions == {"drive": Function("drive", "Drive", ("app",))}


def test_the_adapter_says_the_ttl_where_the_file_does_not() -> None:
    assert parse_config(source(), lookup).config.sources["robots"].ttl_s == 15.0
    assert parse_config(source(ttl_s=3), lookup).config.sources["robots"].ttl_s == 3.0


@pytest.mark.parametrize("name", ["driver", "/", "/arm/", "/1", "/a b", "/a\n", "//a", "~/a", "/ä"])
def test_a_ros_node_is_given_by_its_full_name(name: str) -> None:
    document = {"entities": {"apps": [{"id": "a", "ros_node": name}]}}
    assert problems(document) == [
        f"$.entities.apps[0].ros_node: found {name!a}; give a node's full name, such as /arm/driver"
    ]


@pytest.mark.parametrize("name", ["/driver", "/arm_1/left/_driver2"])
def test_a_node_may_be_in_any_namespace(name: str) -> None:
    document = {"entities": {"apps": [{"id": "a", "ros_node": name}, {"id": "b", "ros_node": ""}]}}
    apps = parse_config(document, lookup).config.entities.tree().apps
    assert apps["a"].ros_binding == RosBinding(name[1:])
    assert apps["b"].ros_binding is None


def test_every_problem_is_reported_at_once_with_its_path() -> None:
    document = {
        "htp": {},
        "http": {"port": 70000, "prot": 1},
        "log_level": "loud",
        "sources": {
            "a": {"adapter": "carrier-pigeon"},
            "b": {"adapter": "radio", "options": {"mod": "router", "mode": "ruter", "listen": "x"}},
            "c": {"adapter": "radio", "ttl": 1, "skew_policy": "atuo"},
            "d": None,
            "e": "zenoh",
            "f": {"adapter": 5},
        },
        "entities": {"apps": [{"name": "no id"}, {"id": "a b"}, {"id": "a", "component_id": "!"}]},
    }
    an_id = "give an id: 1 to 256 characters of A-Z a-z 0-9 _ -"
    policies = "stamp, arrival, auto; did you mean 'auto'?"
    assert problems(document) == [
        "$.htp: unknown key; did you mean 'http'?",
        "$.http.prot: unknown key; did you mean 'port'?",
        "$.http.port: found the number 70000; give a port, 0 to 65535 (0: any free one)",
        "$.sources.a.adapter: no adapter 'carrier-pigeon' is installed",
        "$.sources.b.options.mod: unknown key; did you mean 'mode'?",
        "$.sources.b.options.listen: found the text 'x'; give a list",
        "$.sources.b.options.mode: 'mode' must be in ('router', 'client', 'peer') (got 'ruter')",
        "$.sources.c.ttl: unknown key; did you mean 'ttl_s'?",
        f"$.sources.c.skew_policy: found the text 'atuo'; give one of {policies}",
        "$.sources.d.adapter: missing; give the name of an installed adapter",
        "$.sources.e: found the text 'zenoh'; give keys with values",
        "$.sources.f.adapter: found the number 5; give the name of an installed adapter",
        "$.entities.apps[0].id: missing; give an id",
        f"$.entities.apps[1].id: found 'a b'; {an_id}",
        f"$.entities.apps[2].component_id: found '!'; {an_id}",
        "$.log_level: found the text 'loud'; give one of debug, info, warning, error",
    ]


@pytest.mark.parametrize(
    ("key", "given", "used"),
    [
        ("ttl_s", 0.0, 0.1),
        ("ttl_s", -5, 0.1),
        ("expiry_s", 0.5, 1.0),
        ("max_hints", 0, 1),
        ("source_rate", 0.2, 1.0),
        ("global_rate", 0, 1.0),
    ],
)
def test_a_value_out_of_range_is_corrected_with_a_warning(
    key: str, given: float, used: float
) -> None:
    loaded = parse_config(source(**{"ttl_s": 0.2, key: given}), lookup)
    assert getattr(loaded.config.sources["robots"], key) == used
    (correction,) = loaded.corrections
    assert correction.path == f"$.sources.robots.{key}"
    assert correction.message.endswith(f"is too small; using {used}")


def test_an_expiry_not_above_the_ttl_becomes_ten_times_the_ttl_with_a_warning() -> None:
    loaded = parse_config(source(ttl_s=20, expiry_s=20), lookup)
    assert loaded.config.sources["robots"].expiry_s == 200.0
    assert [str(correction) for correction in loaded.corrections] == [
        "$.sources.robots.expiry_s: 20.0 is not above ttl_s (20.0); using 200.0"
    ]


@pytest.mark.parametrize("key", ["ttl_s", "expiry_s", "source_rate", "global_rate"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_nan_and_infinity_are_refused(key: str, value: float) -> None:
    assert problems(source(**{key: value})) == [
        f"$.sources.robots.{key}: found the number {value}; give a finite number"
    ]


def test_no_source_at_all_is_refused() -> None:
    (problem,) = problems({"sources": {}})
    assert problem.startswith("$.sources: found no source; give at least one")


def test_a_source_needs_a_name_that_can_stand_in_answers() -> None:
    (problem,) = problems({"sources": {"my robots": {"adapter": "radio"}}})
    assert problem.startswith("$.sources: found a source named 'my robots'; give a name of")


def test_a_list_of_sources_is_told_that_they_go_by_name() -> None:
    assert problems({"sources": [{"adapter": "radio"}]}) == [
        "$.sources: found a list of 1; give sources by name, such as {robots: {adapter: zenoh}}"
    ]


def test_an_id_given_twice_is_refused() -> None:
    assert problems({"entities": {"apps": [{"id": "a"}, {"id": "b"}, {"id": "a"}]}}) == [
        "$.entities.apps: given more than once: a; give each id once"
    ]


def test_the_document_must_be_keys_with_values() -> None:
    assert problems(["http"]) == ["$: found a list of 1; give keys with values"]


def test_a_manifest_is_looked_for_beside_the_configuration(tmp_path: Path) -> None:
    (tmp_path / "plant.yaml").write_text("manifest_version: '1.0'\napps: [{id: a, nme: A}]\n")
    (tmp_path / "gateway.yaml").write_text("manifest: plant.yaml\nentities: {apps: [{id: b}]}\n")
    loaded = load_config(tmp_path / "gateway.yaml", lookup)
    assert loaded.config.manifest == str(tmp_path / "plant.yaml")
    (correction,) = loaded.corrections
    assert str(correction) == (
        f"$.manifest: {tmp_path}/plant.yaml: $.apps[0].nme: unknown key; left out; "
        "did you mean 'name'?"
    )
    assert set(read_manifest(loaded.config).tree.apps) == {"a", "b"}


def test_what_is_wrong_with_the_manifest_is_told_with_what_is_wrong_here(tmp_path: Path) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text("apps: [{id: a, is_located_on: ecu}]\n")
    assert problems({"manifest": str(path), "log_level": "loud"})[:2] == [
        f'$.manifest: {path}: $.manifest_version: R001: found nothing; give "1.0"',
        f"$.manifest: {path}: $.apps[0].is_located_on: R007: component ecu is not in this manifest",
    ]


def test_a_manifest_that_is_not_there_is_one_sentence() -> None:
    assert problems({"manifest": "/no/where.yaml"}) == [
        "$.manifest: /no/where.yaml: No such file or directory"
    ]


def test_a_strict_manifest_has_no_doubts(tmp_path: Path) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text("manifest_version: '1.0'\napps: [{id: a, depends_on: [b]}]\n")
    (correction,) = parse_config({"manifest": str(path)}, lookup).corrections
    assert correction.message.endswith("R008: b is not in this manifest")
    (problem,) = problems({"manifest": str(path), "strict_manifest": True})
    assert problem == f"$.manifest: {correction.message}"


def test_an_id_is_given_in_the_manifest_or_in_entities_and_not_in_both(tmp_path: Path) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text("manifest_version: '1.0'\nareas: [{id: a}]\n")
    document = {"manifest": str(path), "entities": {"apps": [{"id": "a"}]}}
    assert problems(document) == [f"$.entities: a: in {path} too; give each id once"]


def test_a_manifest_that_was_spoilt_after_it_was_read_is_refused_with_its_name(
    tmp_path: Path,
) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text("manifest_version: '1.0'\n")
    config = parse_config({"manifest": str(path)}, lookup).config
    path.write_text("manifest_version: '2.0'\n")
    with pytest.raises(ConfigError, match=r"plant\.yaml: 1 problem\n  \$\.manifest_version: R001"):
        read_manifest(config)


def test_entities_are_a_small_manifest() -> None:
    entities = {
        "areas": [{"id": "hall", "name": "Hall"}],
        "components": [{"id": "ecu", "name": "ECU"}],
        "apps": [{"id": "app", "component_id": "ecu", "ros_node": "/arm/app"}, {"id": "b"}],
        "functions": [{"id": "drive", "hosts": ["app"]}],
    }
    manifest = read_manifest(parse_config({"entities": entities}, lookup).config)
    assert manifest == Manifest(
        tree.Tree(
            {"hall": tree.Area("hall", "Hall")},
            {"ecu": tree.Component("ecu", "ECU")},
            {
                "app": tree.App("app", component_id="ecu", ros_binding=tree.RosBinding("arm/app")),
                "b": tree.App("b"),
            },
            {"drive": tree.Function("drive", hosts=("app",))},
        )
    )
