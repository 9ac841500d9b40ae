"""The page in a real browser: what a person sees, does, and is told when the line is cut."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from beacon_gateway.tree.entities import App, Tree
from beacon_gateway.tree.manifest import Manifest

pytestmark = pytest.mark.system

Look = Callable[..., Any]
Eventually = Callable[[Callable[[], object]], None]

IMAGES = os.environ.get("BEACON_IMAGES", "")
"""A folder to take pictures into, for the documentation."""

PARTS = [
    ("base", "Drive base", ()),
    ("lidar", "Laser scanner", ("base",)),
    ("camera", "Stereo camera", ("base",)),
    ("arm", "Gripper arm", ("base",)),
    ("planner", "Route planner", ("base", "lidar")),
    ("safety", "Safety supervisor", ("lidar", "base", "estop")),
]

XSS = '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>\'"`javascript:hack()'


def fleet(stage: Any, robots: int = 6) -> None:
    """A fleet to look at: most are well, some are not."""
    for number in range(1, robots + 1):
        for process, (part, name, needs) in enumerate(PARTS):
            stage.announce(
                f"amr_{number:02}_{part}",
                robot=f"amr-{number:02}",
                display_name=f"{name} {number:02}",
                component_id=f"amr_{number:02}",
                depends_on=tuple(f"amr_{number:02}_{need}" for need in needs),
                hostname=f"amr-{number:02}.plant",
                process_id=4000 + 10 * number + process,
                process_name=part,
                transport_type="zenoh",
                metadata={"firmware": "2.4.1", "slot": str(process)},
            )


def rows(page: Any) -> list[str]:
    """The names in the table, from the top."""
    names: list[str] = page.eval_on_selector_all(
        "#canvas .row:not([hidden])",
        "all => all.sort((a, b) => a.ariaRowIndex - b.ariaRowIndex)"
        ".map((row) => row.querySelector('b').textContent)",
    )
    return names


def row(page: Any, name: str) -> Any:
    return page.locator("#canvas .row:visible", has_text=name)


def test_the_page_shows_who_there_is(stage: Any, look: Look, eventually: Eventually) -> None:
    fleet(stage, robots=1)
    page = look(stage.url)
    row(page, "Laser scanner 01").wait_for()
    eventually(lambda: len(rows(page)) == len(PARTS))
    assert page.locator("#link").inner_text() == "Live"
    text = row(page, "Laser scanner 01").inner_text()
    for shown in ("active", "amr_01_lidar", "amr_01", "amr-01.plant", ": 4011", "zenoh", " s"):
        assert shown in text
    eventually(lambda: page.locator(".tile[data-status=active] b").inner_text() == "6")
    eventually(lambda: "/ 20,000" in page.locator("#fill-text").inner_text())
    sources = page.locator("#sources li")
    assert sources.count() == 2
    eventually(lambda: "up" in sources.nth(1).inner_text())
    heard = sources.nth(1).locator("dl").inner_text()
    for shown in ("last message", " s ago", "tokens left"):
        assert shown in heard
    assert "never" in sources.nth(0).locator("dl").inner_text()
    for name, path in (
        ("JSON", "/api/v1/x-medkit-beacon"),
        ("API", "/api/v1/docs"),
        ("Metrics", "/metrics"),
    ):
        link = page.get_by_role("link", name=name, exact=True)
        assert link.evaluate("(a) => a.pathname") == path
        assert page.request.get(stage.url + path).ok


def test_what_happens_shows_without_reloading(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    page = look(stage.url)
    stage.announce("arm", display_name="Arm", hostname="h", process_id=1)
    row(page, "Arm").wait_for()
    stage.announce("base", display_name="Base", robot="other")
    stage.crash("r")
    eventually(lambda: "stale" in row(page, "Arm").inner_text())
    assert rows(page) == ["Arm", "Base"]  # what needs attention comes first
    stage.announce("arm", display_name="Arm", robot="again", hostname="h", process_id=2)
    eventually(lambda: "↻ 1" in row(page, "Arm").inner_text())
    stage.announce("arm", display_name="Arm", robot="thief", hostname="elsewhere")
    eventually(lambda: "conflict" in row(page, "Arm").inner_text())
    stage.announcers["zenoh", "other"].withdraw("base")
    eventually(lambda: "left" in row(page, "Base").inner_text())
    eventually(lambda: page.locator("#canvas .row:visible").count() == 1)
    kinds = page.locator("#events .status").all_inner_texts()
    for kind in ("appeared", "stale", "recovered", "restarted", "conflict", "left", "expired"):
        assert kind in kinds


def test_who_should_be_there_and_is_not_is_missed(
    expecting_stage: Any, look: Look, eventually: Eventually
) -> None:
    page = look(expecting_stage.url)
    crane = row(page, "Overhead crane")
    eventually(lambda: "not heard" in crane.inner_text())
    assert page.locator(".tile[data-status=expected] b").inner_text() == "1"
    expecting_stage.announce("crane", display_name="Overhead crane")
    eventually(lambda: "active" in crane.inner_text())
    expecting_stage.crash("r")
    page.locator("#events li", has_text="expired").wait_for()
    eventually(lambda: "not heard" in crane.inner_text())
    crane.click()
    page.get_by_text("Nothing is heard of this entity").wait_for()


def test_ages_of_the_living_are_those_of_their_last_word(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    stage.announce("arm")
    page = look(stage.url)
    row(page, "arm").wait_for()
    page.wait_for_timeout(5_000)  # beyond the time to live
    eventually(lambda: float(row(page, "arm").locator(".age").inner_text()[:-2]) < 2.5)
    assert "active" in row(page, "arm").inner_text()
    assert row(page, "arm").locator(".bar").get_attribute("data-state") == "fresh"


def test_refusals_are_counted_and_told_with_the_reason(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    page = look(stage.url)
    page.wait_for_selector("#link[data-state=live]")
    stage.gateway.listeners[0].intake.offer(b"no hint at all", "fool")
    event = page.locator("#events li", has_text="rejected")
    event.wait_for()
    assert "malformed" in event.inner_text()
    eventually(lambda: page.locator("[data-count=rejected] b").inner_text() == "1")


def test_the_filter_takes_words_and_a_status(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    fleet(stage, robots=3)
    page = look(stage.url)
    eventually(lambda: page.locator("#shown").inner_text() == "18")
    page.keyboard.press("/")
    page.keyboard.type("LIDAR amr-02")
    eventually(lambda: rows(page) == ["Laser scanner 02"])
    assert page.locator("#shown").inner_text() == "1 of 18"
    page.fill("#filter", "no such thing")
    page.get_by_text("Nothing here matches the filter.").wait_for()
    page.fill("#filter", "")
    stage.crash("amr-03")
    eventually(lambda: page.locator(".tile[data-status=stale] b").inner_text() == "6")
    page.click(".tile[data-status=stale]")
    eventually(lambda: len(rows(page)) == 6)
    page.click(".tile[data-status=stale]")
    eventually(lambda: len(rows(page)) == 18)


def test_the_drawer_has_all_that_is_known(stage: Any, look: Look, eventually: Eventually) -> None:
    fleet(stage, robots=1)
    stage.announce("amr_01_lidar", source="topic", display_name="Old lidar", stable_id="SN-7")
    page = look(stage.url)
    row(page, "amr_01_lidar").click()
    drawer = page.locator("#drawer")
    drawer.get_by_text("As each source has it").wait_for()
    table = drawer.locator("table.sides")
    eventually(lambda: set(table.locator("thead th").all_inner_texts()) == {"topic", "zenoh"})
    differing = table.locator("tr.differs", has_text="display name").inner_text()
    assert "Old lidar" in differing
    assert "Laser scanner 01" in differing
    assert "SN-7" in table.inner_text()
    assert "2.4.1" in table.inner_text()
    assert drawer.get_by_role("link", name="beacon as JSON").is_visible()
    page.keyboard.press("Escape")
    drawer.wait_for(state="hidden")
    assert page.evaluate("document.activeElement.id") == "grid"


def test_dependencies_are_a_graph_that_can_be_walked(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    fleet(stage, robots=1)
    page = look(stage.url + "/#entity=amr_01_safety")
    graph = page.locator("#drawer .graph")
    graph.wait_for()
    assert "estop" in graph.locator(".node.missing").text_content()
    assert "needs 3" in graph.text_content()
    graph.locator("a.node", has_text="Laser").click()
    eventually(lambda: page.locator("#drawer-title").inner_text() == "Laser scanner 01")
    graph.get_by_text("needed by 2").wait_for()
    page.go_back()
    eventually(lambda: page.locator("#drawer-title").inner_text() == "Safety supervisor 01")


def test_whether_all_that_is_needed_is_there_is_told_with_the_way_to_what_is_not(
    patient_stage: Any, look: Look, eventually: Eventually
) -> None:
    patient_stage.announce("bus", robot="bus")
    patient_stage.announce("driver", depends_on=("bus",))
    patient_stage.announce("planner", depends_on=("driver", "camera"))
    intake = patient_stage.gateway.listeners[1].intake
    intake.offer(b'{"entity_id": "camera"}', "wire")
    page = look(patient_stage.url + "/#entity=planner")
    line = page.locator("#drawer .rollup")
    line.get_by_text("All it depends on is active.").wait_for()
    intake.lost("camera", "wire", reason=XSS)
    eventually(lambda: XSS[:30] in line.inner_text())
    assert page.evaluate("window.hacked") is None
    assert page.locator("#drawer img, #drawer script").count() == 0
    intake.offer(b'{"entity_id": "camera"}', "wire")
    patient_stage.crash("bus")
    line.get_by_text("planner → driver → bus").wait_for()
    assert "bus is stale" in line.inner_text()
    assert line.evaluate("(p) => p.nextElementSibling.className") == "graph"
    page.evaluate("location.hash = '#entity=bus'")
    eventually(lambda: page.locator("#drawer-title").inner_text() == "bus")
    page.locator("#drawer .graph").wait_for()
    assert line.count() == 0, "it needs nobody"


def test_of_two_sources_words_the_page_uses_the_same_everywhere(
    patient_stage: Any, look: Look, eventually: Eventually
) -> None:
    patient_stage.announce("lidar", display_name="New lidar")
    page = look(patient_stage.url + "/#entity=lidar")
    row(page, "New lidar").wait_for()
    patient_stage.announce("lidar", source="topic", display_name="Old lidar")
    shown = """() => [
      document.getElementById('drawer-title').textContent,
      document.querySelector('#drawer .node.chosen text').textContent,
      [...document.querySelectorAll('#canvas .row:not([hidden])')]
        .find((row) => row.textContent.includes('topic')).querySelector('b').textContent,
    ]"""
    for number in range(6):  # each makes the drawer draw the graph again
        patient_stage.announce(f"user{number}", robot=f"u{number}", depends_on=("lidar",))
        page.get_by_text(f"needed by {number + 1}").wait_for()
        eventually(lambda: len(set(page.evaluate(shown))) == 1)
        page.wait_for_timeout(700)  # both sources speak, and the drawer asks, again
        assert len(set(page.evaluate(shown))) == 1


def test_who_is_missed_follows_another_manifest(
    expecting_stage: Any, look: Look, eventually: Eventually
) -> None:
    expecting_stage.announce("stranger")
    page = look(expecting_stage.url)
    eventually(lambda: set(rows(page)) == {"Overhead crane", "stranger"})
    apps = {"dock": App("dock", "Charging dock"), "stranger": App("stranger")}
    gateway = expecting_stage.gateway
    gateway.take_config(gateway.config, Manifest(Tree(apps=apps)))
    eventually(lambda: set(rows(page)) == {"Charging dock", "stranger"})
    assert page.locator(".tile[data-status=expected] b").inner_text() == "1"
    expecting_stage.crash("r")
    eventually(lambda: page.locator(".tile[data-status=expected] b").inner_text() == "2")


def test_the_history_of_restarts_is_told(stage: Any, look: Look, eventually: Eventually) -> None:
    stage.announce("arm", hostname="h", process_id=1)
    page = look(stage.url + "/#entity=arm")
    page.locator("#drawer .summary").wait_for()
    stage.crash("r")
    page.locator(".history li", has_text="lost").wait_for()
    stage.announce("arm", robot="again", hostname="h", process_id=2)
    page.get_by_text("History, 1 restart").wait_for()
    page.locator(".history li", has_text="another").first.wait_for()


def test_when_the_line_is_cut_it_says_so_and_comes_back(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    stage.announce("arm")
    page = look(stage.url, faults_expected=True)
    row(page, "arm").wait_for()
    stage.cut()
    banner = page.locator("#banner")
    banner.get_by_text("the last that was heard").wait_for()
    assert page.locator("#link").inner_text() == "Not connected"
    age = row(page, "arm").locator(".age")
    eventually(lambda: float(age.inner_text()[:-2]) > 3.5)  # ages go on
    stage.announce("newcomer")
    stage.serve()
    row(page, "newcomer").wait_for()
    banner.wait_for(state="hidden")
    assert page.locator("#link").inner_text() == "Live"


def test_a_gateway_that_wants_a_token_is_given_one(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    stage.announce("arm")
    page = look("about:blank", faults_expected=True)

    def guard(route: Any) -> None:
        if route.request.headers.get("authorization") == "Bearer secret":
            route.continue_()
        else:
            route.fulfill(status=401, body="{}")

    page.route("**/api/**", guard)
    page.goto(stage.url)
    page.get_by_text("asks for an access token").wait_for()
    page.fill("#token", "secret")
    page.keyboard.press("Enter")
    row(page, "arm").wait_for()


def test_no_word_of_a_robot_is_ever_more_than_text(
    stage: Any, look: Look, eventually: Eventually
) -> None:
    fields = (
        *("stable_id", "display_name", "transport_type", "negotiated_format"),
        *("process_name", "hostname"),
    )
    words = dict.fromkeys(fields, XSS)
    hostile = {"metadata": {"note": XSS}, **words}
    stage.announce("evil", robot="one", **hostile)
    stage.announce("evil", robot="two", **{**hostile, "hostname": "x" + XSS})
    stage.announce("evil", source="topic", robot="three", **hostile)
    page = look(stage.url)
    page.wait_for_selector("#link[data-state=live]")
    stage.gateway.listeners[0].intake.offer(XSS.encode(), XSS)
    page.locator("#events li", has_text="rejected").wait_for()
    eventually(lambda: "conflict" in page.locator("#canvas").inner_text())
    page.locator("#canvas .row").first.click()
    page.locator("#drawer .claims").wait_for()
    page.locator(".sides tr", has_text="note").wait_for()
    for place in ("#canvas", "#drawer", "#drawer-title"):
        assert XSS[:30] in page.locator(place).first.inner_text()
    assert page.evaluate("window.hacked") is None
    assert page.locator("main img, #drawer img, main script, #drawer script").count() == 0


def test_the_policy_forbids_what_no_script_of_ours_does(stage: Any, look: Look) -> None:
    page = look(stage.url, faults_expected=True)
    assert (
        page.evaluate(
            "() => { try { document.body.innerHTML = '<b>x</b>'; } catch (e) { return e.name; } }"
        )
        == "TypeError"
    )
    policy = page.request.get(stage.url).headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy


def test_nothing_is_asked_of_anybody_else(stage: Any, look: Look) -> None:
    page = look("about:blank")
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(stage.url)
    page.wait_for_selector("#link[data-state=live]")
    assert asked
    assert all(url.startswith(stage.url + "/") for url in asked)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_use_it(stage: Any, look: Look, eventually: Eventually, scheme: str) -> None:
    fleet(stage, robots=2)
    stage.announce("amr_01_lidar", source="topic", display_name="Old lidar")
    stage.gateway.listeners[0].intake.offer(b"no hint", "fool")
    page = look(stage.url, color_scheme=scheme, bypass_csp=True)
    eventually(lambda: page.locator("#shown").inner_text() == "12")
    stage.crash("amr-02")
    eventually(lambda: "stale" in page.locator("#events").inner_text())
    script = files("axe_playwright_python").joinpath("axe.min.js").read_text()
    page.evaluate(script)
    assert violations(page) == []
    page.click("#canvas .row >> nth=0")
    page.locator("#drawer .graph").wait_for()
    page.evaluate("Promise.all(document.getAnimations().map((one) => one.finished))")
    assert violations(page) == []


def violations(page: Any) -> list[tuple[str, list[str]]]:
    found = page.evaluate("axe.run({runOnly: ['wcag2a', 'wcag2aa', 'wcag21aa', 'best-practice']})")
    return [
        (one["id"], [node["failureSummary"] + node["html"][:200] for node in one["nodes"][:3]])
        for one in found["violations"]
    ]


def test_it_can_be_used_without_a_mouse(stage: Any, look: Look, eventually: Eventually) -> None:
    fleet(stage, robots=4)
    page = look(stage.url)
    eventually(lambda: page.locator("#shown").inner_text() == "24")
    page.focus("#grid")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    chosen = page.locator("#canvas .row[aria-selected=true]")
    assert chosen.locator("b").inner_text() == rows(page)[1]
    assert page.get_attribute("#grid", "aria-activedescendant") == chosen.get_attribute("id")
    page.keyboard.press("End")
    assert chosen.locator("b").inner_text() == rows(page)[-1]
    page.keyboard.press("Enter")
    page.locator("#drawer .summary").wait_for()


def test_ten_thousand_rows_scroll_smoothly(
    patient_stage: Any, look: Look, eventually: Eventually
) -> None:
    intake = patient_stage.gateway.listeners[1].intake
    for number in range(10_000):
        body = f'{{"entity_id": "e{number:05}", "display_name": "Entity {number:05}"}}'
        intake.offer(body.encode(), f"robot-{number % 500}")
    page = look(patient_stage.url)
    eventually(lambda: page.locator("#shown").inner_text() == "10,000")
    assert page.locator("#canvas .row").count() < 100
    # Beside other tests the page may get a fraction of a processor for a while.
    halves_ms = [half_of_the_frames_ms(page)]
    while halves_ms[-1] >= 34 and len(halves_ms) < 5:
        halves_ms.append(half_of_the_frames_ms(page))
    assert halves_ms[-1] < 34, f"half of the frames take more than {min(halves_ms):.0f} ms"
    page.evaluate("document.getElementById('grid').scrollTop = 1e9")
    eventually(lambda: rows(page)[-1] == "Entity 09999")
    page.fill("#filter", "entity e04")
    eventually(lambda: page.locator("#shown").inner_text() == "1,000 of 10,000")


def half_of_the_frames_ms(page: Any) -> float:
    """Half of the frames come this soon after the one before while somebody scrolls."""
    half_ms: float = page.evaluate(
        """async () => {
          const grid = document.getElementById('grid'), times = [];
          grid.scrollTop = 0;
          let before = await new Promise(requestAnimationFrame);
          for (let step = 0; step < 120; step += 1) {
            grid.scrollTop += 700;
            const now = await new Promise(requestAnimationFrame);
            times.push(now - before);
            before = now;
          }
          return times.sort((a, b) => a - b)[60];
        }"""
    )
    return half_ms


def test_a_phone_shows_it_in_parts(stage: Any, look: Look, eventually: Eventually) -> None:
    fleet(stage, robots=2)
    page = look(stage.url, viewport={"width": 390, "height": 844}, has_touch=True)
    eventually(lambda: page.locator("#shown").inner_text() == "12")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert not page.locator("#events").is_visible()
    page.get_by_role("button", name="Events").tap()
    page.locator("#events, #quiet").first.wait_for(state="attached")
    assert not page.locator("#grid").is_visible()
    page.get_by_role("button", name="Entities").tap()
    page.locator("#canvas .row").first.tap()
    page.locator("#drawer .summary").wait_for()
    assert page.evaluate("document.getElementById('drawer').clientWidth") == 390


@pytest.mark.skipif(not IMAGES, reason="pictures are taken when BEACON_IMAGES names a folder")
def test_pictures(pictured_stage: Any, look: Look, eventually: Eventually) -> None:
    stage = pictured_stage
    fleet(stage, robots=9)
    pages = {
        "live-light": look(stage.url, color_scheme="light"),
        "live-dark": look(stage.url, color_scheme="dark"),
        "live-phone": look(stage.url, color_scheme="light", viewport={"width": 390, "height": 844}),
        "live-wall": look(stage.url, color_scheme="dark", viewport={"width": 2560, "height": 1440}),
    }
    for page in pages.values():
        page.locator("#shown", has_text="55").wait_for()
    stage.announce(
        "amr_03_lidar",
        source="topic",
        robot="topic-3",
        display_name="Laser 03 (old)",
        hostname="amr-03.plant",
        process_id=4031,
        depends_on=("amr_03_base",),
    )
    stage.announce(
        "amr_07_arm",
        robot="spare",
        display_name="Gripper arm 07",
        hostname="spare-2.plant",
        process_id=991,
    )
    stage.crash("amr-05")
    stage.announcers["zenoh", "amr-08"].withdraw("amr_08_camera")
    stage.gateway.listeners[0].intake.offer(b"no hint", "10.0.3.17:51022")
    for number in range(3):
        stage.announce(
            f"amr_05_{PARTS[number][0]}",
            robot="amr-05 again",
            display_name=f"{PARTS[number][1]} 05",
            component_id="amr_05",
            hostname="amr-05.plant",
            process_id=5100 + number,
            process_name=PARTS[number][0],
            transport_type="zenoh",
        )
    for name, page in pages.items():
        page.wait_for_timeout(2500)
        page.screenshot(path=str(Path(IMAGES) / f"{name}.png"))
    page = pages["live-light"]
    page.evaluate("location.hash = '#entity=amr_03_lidar'")
    page.locator("#drawer .graph").wait_for()
    page.wait_for_timeout(600)
    page.screenshot(path=str(Path(IMAGES) / "live-drawer.png"))
    page = pages["live-phone"]
    page.evaluate("location.hash = '#entity=amr_03_lidar'")
    page.locator("#drawer .graph").wait_for()
    page.wait_for_timeout(600)
    page.screenshot(path=str(Path(IMAGES) / "live-phone-drawer.png"))
