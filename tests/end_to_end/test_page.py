"""The page of the service as a person has it: in Chromium, on a service in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.browser import browser, sign_in, violations
from support.served import Served, sweep_text

pytestmark = pytest.mark.slow
SHORT = sweep_text(40, 50, "up")
LONG = sweep_text(400, 60_000)
FAILING = f"{sweep_text(12, 50)}[execution]\nimpact_limit = 20\n"
MAP = f'{sweep_text(6, 20)}"stop[1].restitution" = {{ values = [0.6, 0.7, 0.8] }}\n'
SECONDS = 30_000
"""Milliseconds that a campaign may take to begin: each of its processes imports everything."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def served(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    service = Served(tmp_path_factory.mktemp("page") / "service")
    yield service
    service.stop()


@pytest.fixture(scope="module")
def ended(served: Served, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the ids of campaigns that have ended."""
    scene, found = tmp_path_factory.mktemp("scenes") / "scene.toml", {}
    with served.client() as service:
        for name, text in (("short", SHORT), ("failing", FAILING), ("map", MAP)):
            scene.write_text(text, encoding="utf-8")
            found[name] = service.submit(scene, workers=1).wait().id
    return found


class Seen:
    """A page that is signed in, and what went wrong in it."""

    def __init__(self, chromium: Any, served: Served, view: str = "", **how: Any) -> None:
        self.context = chromium.new_context(**how)
        self.page = self.context.new_page()
        self.page.set_default_timeout(SECONDS)
        self.wrong: list[str] = []
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("console", self._note)
        sign_in(self.page, served.url, token_of(served), view)

    def _note(self, message: Any) -> None:
        # of requests that are refused, which each test knows of, the browser tells here too
        if message.type == "error" and "Failed to load resource" not in message.text:
            self.wrong.append(message.text)

    def close(self) -> None:
        self.context.close()
        assert not self.wrong


def token_of(served: Served) -> str:
    return (served.folder / "token").read_text(encoding="utf-8").strip()


@pytest.fixture
def seen(chromium: Any, served: Served) -> Iterator[Seen]:
    one = Seen(chromium, served)
    yield one
    one.close()


def show(seen: Seen, served: Served, view: str) -> Any:
    seen.page.goto(f"{served.url}/#/{view}")
    return seen.page


def drawn(page: Any) -> int:
    """Return how many points the diagram of a page has, once it has some."""
    canvas = page.locator("canvas[data-points]").first
    canvas.wait_for()
    return int(canvas.get_attribute("data-points"))


def test_a_wrong_token_is_refused_and_the_right_one_is_nowhere_in_the_page(
    chromium: Any, served: Served
) -> None:
    page = chromium.new_page()
    page.goto(served.url)
    page.get_by_label("Token of the service").fill("wrong")
    page.keyboard.press("Enter")
    page.get_by_text("This is not the token of this service.").wait_for()
    assert violations(page) == []
    sign_in(page, served.url, token_of(served))
    kept = page.evaluate(
        "JSON.stringify([document.cookie, {...localStorage}, {...sessionStorage}, location.href])"
        " + document.documentElement.outerHTML + [...document.querySelectorAll('input')].map((one) => one.value)"
    )
    assert token_of(served) not in kept
    (cookie,) = page.context.cookies()
    assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
    assert token_of(served) not in cookie["value"]
    page.reload()
    page.get_by_role("heading", name="Campaigns").wait_for()
    page.get_by_role("button", name="Sign out").click()
    page.get_by_label("Token of the service").wait_for()
    assert page.context.cookies() == []
    page.close()


def test_a_scene_is_checked_while_one_types_and_submitted(seen: Seen, served: Served) -> None:
    page = show(seen, served, "new")
    page.get_by_role("button", name="Impact oscillator, thesis").wait_for()
    page.get_by_label("Scene (TOML)").fill("[body]\nstiffness = 1\nmass = -1\n[record]\nrecorded_time = 5\n")
    problem = page.get_by_role("button", name="Line 3: body.mass: expected a number > 0, got -1.")
    problem.click()
    assert page.get_by_role("button", name="Submit").is_disabled()
    assert page.evaluate("document.activeElement.id + getSelection()") == "scenemass = -1"
    assert page.locator("pre .wrong").inner_text() == "3"
    assert violations(page) == []
    page.get_by_label("Scene (TOML)").fill(SHORT)
    page.get_by_text("The scene is sound.").wait_for()
    page.get_by_label("Workers").fill("1")
    page.get_by_role("button", name="Submit").click()
    page.get_by_role("heading", name="short sweep").wait_for()
    page.locator(".state.done").wait_for()
    page.get_by_text("40 of 40 points").wait_for()


def test_a_point_that_is_chosen_shows_its_motion(seen: Seen, served: Served, ended: dict[str, str]) -> None:
    page = show(seen, served, f"campaign/{ended['short']}")
    assert drawn(page) >= 40
    page.locator("canvas[data-points]").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    said = page.locator("#news").inner_text()
    assert "angular frequency" in said
    page.keyboard.press("Enter")
    for name in ("Motion in time", "Phase portrait", "Impacts"):
        page.get_by_role("region", name=name, exact=True).wait_for()
    assert page.get_by_role("heading", name="Point ").inner_text() in said.replace("point", "Point")
    assert violations(page) == []
    page.get_by_text("As a table", exact=True).click()
    page.get_by_role("row", name="ok").first.wait_for()
    with page.expect_download() as download:
        page.get_by_role("link", name="Dataset (NetCDF)").click()
    assert Path(download.value.path()).read_bytes()[:4] == b"\x89HDF"


def test_a_click_on_a_map_shows_its_point_and_a_drag_zooms(
    seen: Seen, served: Served, ended: dict[str, str]
) -> None:
    page = show(seen, served, f"campaign/{ended['map']}")
    page.get_by_label("Show", exact=True).wait_for()
    assert drawn(page) == 18
    page.locator("canvas").first.click(position={"x": 200, "y": 120})
    page.get_by_role("heading", name="Point ").wait_for()
    page.get_by_label("Show", exact=True).select_option(label="Over angular frequency")
    page.get_by_label("restitution").wait_for()
    page.locator('canvas[data-points="6"]').wait_for()
    box = page.locator("canvas").first.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 330, steps=3)
    page.mouse.up()
    page.locator('canvas[data-points="3"]').wait_for()


def test_failed_points_say_why(seen: Seen, served: Served, ended: dict[str, str]) -> None:
    page = show(seen, served, f"campaign/{ended['failing']}")
    page.get_by_role("heading", name="points did not come to their end").wait_for()
    page.get_by_role("cell", name="impact_limit: 20 impacts").first.wait_for()


def test_a_campaign_grows_is_cancelled_and_goes_on_after_the_service_was_killed(
    chromium: Any, tmp_path: Path
) -> None:
    folder = tmp_path / "service"
    served = Served(folder)
    port = served.url.rpartition(":")[2]
    scene = tmp_path / "scene.toml"
    scene.write_text(LONG, encoding="utf-8")
    with served.client() as service:
        job = service.submit(scene, workers=1)
    seen = Seen(chromium, served, f"#/campaign/{job.id}")
    page = seen.page
    try:
        first = drawn(page)
        page.wait_for_function(
            "(first) => document.querySelector('canvas').dataset.points > first", arg=first
        )
        served.kill()
        page.get_by_text("The service does not answer; trying again.").wait_for()
        served = Served(folder, "--port", port)
        page.locator("#banner").wait_for(state="hidden")
        page.locator(".state.running").wait_for()
        began = time.monotonic()
        page.get_by_role("button", name="Cancel").click()
        page.locator(".state.cancelled").wait_for()
        assert time.monotonic() - began < 2.0
        page.get_by_role("button", name="Resume").click()
        page.get_by_role("button", name="Cancel").click()
        page.locator(".state.cancelled").wait_for()
        page.once("dialog", lambda dialog: dialog.accept())
        page.get_by_role("button", name="Delete").click()
        page.get_by_text("No campaigns yet.").wait_for()
        seen.close()
    finally:
        served.stop()


@pytest.mark.parametrize(("colours", "width"), [("dark", 1280), ("light", 390)])
def test_every_view_is_accessible_and_fits(
    chromium: Any, served: Served, ended: dict[str, str], colours: str, width: int
) -> None:
    seen = Seen(chromium, served, color_scheme=colours, viewport={"width": width, "height": 844})
    views = ("campaigns", "new", "compare", f"campaign/{ended['map']}", f"campaign/{ended['failing']}")
    for view in (*views, "recordings"):
        page = show(seen, served, view)
        page.get_by_role("heading", level=1).wait_for()
        page.wait_for_load_state("networkidle")
        assert violations(page) == [], view
        assert page.evaluate("document.documentElement.scrollWidth") <= width, view
    seen.close()


def test_what_is_written_into_the_page_is_not_run(seen: Seen, served: Served) -> None:
    page = show(seen, served, "campaigns")
    policy = page.request.get(served.url).headers["content-security-policy"]
    assert "unsafe" not in policy
    assert page.evaluate(
        "new Promise((resolve) => {"
        " document.addEventListener('securitypolicyviolation', (event) => resolve(event.violatedDirective));"
        " const script = document.createElement('script'); script.textContent = 'window.ran = 1';"
        " document.body.append(script); })"
    ).startswith("script-src")
    assert page.evaluate("window.ran") is None
    seen.wrong.clear()  # of the violation that was tried here
