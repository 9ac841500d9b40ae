"""The page of a gateway that tells strangers nothing: what a person sees who has no token, or gives
one, or a wrong one, or whose token does not count any more.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.system

Look = Callable[..., Any]

IMAGES = os.environ.get("BEACON_IMAGES", "")


def give(page: Any, token: str) -> None:
    page.get_by_label("Access token").fill(token)
    page.keyboard.press("Enter")


def row(page: Any, name: str) -> Any:
    return page.locator("#canvas .row:visible", has_text=name)


def kept(page: Any) -> str | None:
    found: str | None = page.evaluate("sessionStorage.getItem('token')")
    return found


@pytest.fixture
def page(locked_stage: Any, look: Look) -> Any:
    """Opened by a stranger, who is asked for a token."""
    locked_stage.stage.announce("arm", display_name="Gripper arm")
    opened = look(locked_stage.stage.url, faults_expected=True)
    opened.get_by_text("This gateway asks for an access token.").wait_for()
    return opened


def test_a_stranger_sees_the_page_with_nothing_in_it_and_is_asked_for_a_token(page: Any) -> None:
    assert page.locator("#link").inner_text() == "Not connected"
    assert page.locator("#canvas .row:visible").count() == 0
    assert page.evaluate("document.activeElement.id") == "token"
    assert not page.get_by_role("button", name="Try now").is_visible()
    assert "arm" not in page.content()
    for claim in ("No beacon has been heard yet.", "Not heard", "Store fill"):
        assert not page.get_by_text(claim, exact=True).is_visible()


def test_a_token_opens_all_of_it_until_the_tab_is_closed(locked_stage: Any, page: Any) -> None:
    give(page, f"  {locked_stage.token} ")
    row(page, "Gripper arm").wait_for()
    page.locator("#banner").wait_for(state="hidden")
    assert page.locator("#link").inner_text() == "Live"
    page.locator("#sources", has_text="zenoh").wait_for()  # fetched, not streamed
    assert page.locator("#token").input_value() == ""
    assert locked_stage.token not in page.url
    page.reload()
    row(page, "Gripper arm").wait_for()
    assert page.context.cookies() == []
    assert page.evaluate("localStorage.length") == 0
    other = page.context.new_page()
    other.goto(locked_stage.stage.url)
    other.get_by_text("asks for an access token").wait_for()


def test_what_is_behind_a_link_is_shown_to_who_has_given_a_token(
    locked_stage: Any, page: Any
) -> None:
    give(page, locked_stage.token)
    row(page, "Gripper arm").wait_for()
    page.get_by_role("link", name="Metrics").click()
    page.get_by_text("medkit_beacon_build_info").first.wait_for()
    page.go_back()
    row(page, "Gripper arm").wait_for()
    page.get_by_role("link", name="JSON").click()
    page.get_by_text('"Gripper arm"').first.wait_for()


def test_a_wrong_token_is_refused_and_not_kept(locked_stage: Any, page: Any) -> None:
    give(page, "wrong")
    page.get_by_text("That access token is not accepted.").wait_for()
    assert page.locator("#canvas .row:visible").count() == 0
    assert kept(page) is None
    give(page, locked_stage.token)
    row(page, "Gripper arm").wait_for()
    assert kept(page) == locked_stage.token


def test_of_an_expired_token_the_page_says_so_and_takes_another(
    locked_stage: Any, page: Any
) -> None:
    give(page, locked_stage.passing_token(6.0))
    row(page, "Gripper arm").wait_for()
    page.get_by_text("does not count any more: it has expired").wait_for()
    page.get_by_text("the last that was heard").wait_for()
    assert page.locator("#link").inner_text() == "Not connected"
    assert row(page, "Gripper arm").is_visible()
    assert kept(page) is None
    give(page, locked_stage.token)
    page.locator("#banner").wait_for(state="hidden")
    locked_stage.stage.announce("lift", robot="l", display_name="Lift")
    row(page, "Lift").wait_for()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_sign_in(locked_stage: Any, look: Look, scheme: str) -> None:
    url = locked_stage.stage.url
    opened = look(url, faults_expected=True, color_scheme=scheme, bypass_csp=True)
    opened.get_by_text("asks for an access token").wait_for()
    opened.evaluate(files("axe_playwright_python").joinpath("axe.min.js").read_text())
    found = opened.evaluate("axe.run()")["violations"]
    assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in found] == []


@pytest.mark.skipif(not IMAGES, reason="pictures are taken when BEACON_IMAGES names a folder")
def test_pictures(locked_stage: Any, look: Look) -> None:
    for name, size in {"live-sign-in": (1440, 500), "live-sign-in-phone": (390, 844)}.items():
        viewport = dict(zip(("width", "height"), size, strict=True))
        opened = look(locked_stage.stage.url, faults_expected=True, viewport=viewport)
        opened.get_by_text("asks for an access token").wait_for()
        opened.screenshot(path=str(Path(IMAGES) / f"{name}.png"))
