"""The page of a gateway that relays, in a real browser."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from beacon_core.relay.values import Qos, TopicType

pytestmark = pytest.mark.system

Look = Callable[..., Any]
Eventually = Callable[[Callable[[], object]], None]

IMAGES = os.environ.get("BEACON_IMAGES", "")
IMAGE = TopicType("sensor_msgs/msg/Image", "RIHS01_" + "ab" * 32)


def panel(page: Any) -> Any:
    return page.locator(".panel.relay")


def test_a_gateway_that_relays_nothing_shows_no_panel(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    page = look(stage.url)
    eventually(lambda: "up" in page.locator("#sources li").nth(1).inner_text())
    assert panel(page).is_hidden()


def test_its_ends_show_their_links_books_and_topics(
    relaying_stage: Any, look: Look, eventually: Eventually
) -> None:
    heard = relaying_stage.site.subscription("/amr_01/camera/image", IMAGE, Qos())
    camera = relaying_stage.robot.publisher("/camera/image", IMAGE, Qos())
    relaying_stage.robot.publisher("/secret", IMAGE, Qos())
    page = look(relaying_stage.stage.url)
    robot, site = (panel(page).locator("#relay > li").nth(number) for number in (0, 1))
    eventually(lambda: "link up" in robot.inner_text())
    eventually(lambda: "live" in site.inner_text())
    for _ in range(5):
        camera.publish(b"x")
    eventually(lambda: len(heard.received()) == 5)
    eventually(lambda: "5" in site.locator("dd").nth(3).inner_text())
    text = robot.inner_text()
    assert "/camera/image \u2192 /amr_01/camera/image" in text
    assert "denied by rule 0: /secret" in text
    assert "sensor_msgs/msg/Image" in site.inner_text()
    assert site.locator("dt").all_inner_texts()[:3] == ["messages/s", "messages", "held"]
    camera.close()
    eventually(lambda: "closed" in robot.inner_text() or "\u2192" not in robot.inner_text())


def test_no_name_of_a_topic_is_more_than_text(
    relaying_stage: Any, look: Look, eventually: Eventually
) -> None:
    hostile = "<img/src=x/onerror=window.hacked=1>"
    relaying_stage.robot.publisher(f"/{hostile}", TopicType(hostile, hostile), Qos())
    page = look(relaying_stage.stage.url)
    eventually(lambda: hostile in panel(page).inner_text())
    assert page.evaluate("window.hacked") is None


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_use_it(
    relaying_stage: Any, look: Look, eventually: Eventually, scheme: str
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    relaying_stage.robot.publisher("/camera/image", IMAGE, Qos())
    relaying_stage.robot.publisher("/secret", IMAGE, Qos())
    page = look(relaying_stage.stage.url, color_scheme=scheme)
    eventually(lambda: "refused" in panel(page).inner_text())
    found = axe.run(page)
    assert found.violations_count == 0, found.generate_report()
    if IMAGES:
        page.screenshot(path=Path(IMAGES) / f"relay-{scheme}.png")
