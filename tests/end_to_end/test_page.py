"""The page of the service as a user sees it: in Chromium, on a service in a process of its own."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from support.browser import PageSession, browser, token_of, violations
from support.replay_scenes import BOARD, hit
from support.served import Served, scene_file, sweep_text

from vibroimpact.service.client import RemoteJob

pytestmark = pytest.mark.together("service")

SHORT = sweep_text(40, 50, "up")
LONG = sweep_text(400, 1_000_000)
MAP = sweep_text(6, 20) + (
    '"stop[1].position" = { values = [0.0, 0.5, 1.0] }\n[execution]\nimpact_limit = 30\n'
)
"""A scene of 18 points; 4 of its points with the stop at 0 have too many impacts."""
POINT = re.compile("^Point [0-9]+$")
CLASS_NAME = re.compile(r"P\(|chaos|unknown|no impacts")
WRONG = "[body]\nstiffness = 1\nmass = -1\n[record]\nrecorded_time = 5\n"
DROP = """([selector, files]) => {
  const dropped = new DataTransfer();
  for (const [name, text] of files) dropped.items.add(new File([text], name));
  document.querySelector(selector).dispatchEvent(new DragEvent("drop", { dataTransfer: dropped, bubbles: true }));
}"""


@dataclass(frozen=True, slots=True)
class Jobs:
    """Jobs of a service, submitted before its page is opened."""

    map: RemoteJob
    fit: RemoteJob


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def served(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    service = Served(tmp_path_factory.mktemp("page") / "service")
    yield service
    service.stop()


@pytest.fixture(scope="module", autouse=True)
def jobs(served: Served, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Jobs]:
    """Submit all jobs of the tests first: they are computed while the tests start."""
    folder = tmp_path_factory.mktemp("scenes")
    with served.client() as service:
        recording = service.upload_recording(hit(folder))
        yield Jobs(
            service.submit(scene_file(folder, MAP), workers=1),
            service.submit(scene_file(folder, BOARD), recordings=[recording], fit="body.frequency"),
        )


@pytest.fixture
def seen(chromium: Any, served: Served) -> Iterator[PageSession]:
    with PageSession(chromium, served) as session:
        session.sign_in()
        yield session


def drawn(page: Any) -> int:
    """Return the number of points in the diagram of a page, once it has some."""
    canvas = page.locator("canvas[data-points]").first
    canvas.wait_for()
    return int(canvas.get_attribute("data-points"))


def test_a_wrong_token_is_refused_and_the_right_one_is_nowhere_in_the_page(
    chromium: Any, served: Served
) -> None:
    token = token_of(served)
    with PageSession(chromium, served) as seen:
        page = seen.page
        page.goto(served.url)
        page.get_by_label("Token of the service").fill("wrong")
        page.keyboard.press("Enter")
        page.get_by_text("This is not the token of this service.").wait_for()
        assert violations(page) == []
        seen.sign_in()
        kept = page.evaluate(
            "JSON.stringify([document.cookie, {...localStorage}, {...sessionStorage}, location.href])"
            " + document.documentElement.outerHTML + [...document.querySelectorAll('input')].map((one) => one.value)"
        )
        assert token not in kept
        (cookie,) = page.context.cookies()
        assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
        assert token not in cookie["value"]
        page.reload()
        page.get_by_role("heading", name="Campaigns").wait_for()
        page.get_by_role("button", name="Sign out").click()
        page.get_by_label("Token of the service").wait_for()
        assert page.context.cookies() == []


def test_a_scene_is_checked_while_one_types_and_submitted(seen: PageSession) -> None:
    page = seen.show("new")
    page.get_by_role("button", name="Impact oscillator, thesis").click()
    page.get_by_text("The scene is sound.").wait_for()
    page.get_by_label("Scene (TOML)").fill(WRONG)
    problem = page.get_by_role("button", name="Line 3: body.mass: expected a number > 0, got -1.")
    problem.click()
    assert page.get_by_role("button", name="Submit").is_disabled()
    assert page.evaluate("document.activeElement.id + getSelection()") == "scenemass = -1"
    assert page.locator("pre .wrong").inner_text() == "3"
    assert violations(page) == []
    page.evaluate(DROP, [".editor", [["short.toml", SHORT]]])
    page.get_by_text("The scene is sound.").wait_for()
    page.get_by_label("Workers").fill("1")
    page.get_by_role("button", name="Submit").click()
    page.get_by_role("heading", name="short sweep").wait_for()
    page.locator(".state.done").wait_for()
    page.get_by_text("40 of 40 points").wait_for()
    assert drawn(page) >= 40


def test_a_click_on_a_map_shows_its_point_and_a_drag_zooms(seen: PageSession, jobs: Jobs) -> None:
    page = seen.show_job(jobs.map)
    page.get_by_label("Show", exact=True).wait_for()
    assert drawn(page) == 18
    page.locator("canvas").first.hover(position={"x": 210, "y": 70})
    assert "range of the displacement" in page.locator(".tip").first.inner_text()
    page.locator("canvas").first.click(position={"x": 200, "y": 60})
    page.get_by_role("heading", name=POINT).wait_for()
    page.get_by_label("Show", exact=True).select_option(label="Over angular frequency")
    page.get_by_label("position").select_option("1")
    page.locator('canvas[data-points="6"]').wait_for()
    box = page.locator("canvas").first.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 330, steps=3)
    page.mouse.up()
    page.locator('canvas[data-points="3"]').wait_for()


def test_a_map_of_classes_names_them_and_a_point_shows_its_stop(seen: PageSession, jobs: Jobs) -> None:
    page = seen.show_job(jobs.map)
    assert drawn(page) == 18
    page.get_by_label("Variable", exact=True).select_option("class")
    page.get_by_text("class of the motion: 18 of 18 points.").wait_for()
    legend = page.locator(".legend").first
    legend.get_by_text(CLASS_NAME).first.wait_for()
    assert violations(page) == []
    canvas = page.locator("canvas").first
    canvas.focus()
    # the first point was not completed
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert CLASS_NAME.search(page.locator(".tip").first.inner_text())
    page.keyboard.press("Enter")
    portrait = page.get_by_role("region", name="Phase portrait")
    portrait.locator(".legend").get_by_text("stop").wait_for()
    # a line has a gap between an impact and the next sample
    gaps = """async () => (await import('/page/layers.js')).withGaps([[5, 6, 7]], [0, 1, 2], [0.5, 0.7, 2.5, -1])"""
    assert page.evaluate(gaps) == [[5, None, 6, 7]]


def test_a_point_that_is_chosen_by_keys_shows_its_motion(seen: PageSession, jobs: Jobs) -> None:
    page = seen.show_job(jobs.map)
    drawn(page)
    page.locator("canvas[data-points]").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    said = page.locator("#news").inner_text()
    assert "angular frequency" in said
    page.keyboard.press("Enter")
    for name in ("Motion in time", "Phase portrait", "Impacts"):
        page.get_by_role("region", name=name, exact=True).wait_for()
    assert page.get_by_role("heading", name=POINT).inner_text() in said.replace("point", "Point")
    assert violations(page) == []
    page.get_by_text("As a table", exact=True).click()
    page.get_by_role("row", name="ok").first.wait_for()
    with page.expect_download() as download:
        page.get_by_role("link", name="Dataset (NetCDF)").click()
    assert Path(download.value.path()).read_bytes()[:4] == b"\x89HDF"


def test_failed_points_say_why(seen: PageSession, jobs: Jobs) -> None:
    page = seen.show_job(jobs.map)
    page.get_by_role("heading", name="4 points did not come to their end").wait_for()
    assert page.get_by_role("cell", name="impact_limit: 30 impacts").count() == 4
    page.get_by_role("button", name="Point 0", exact=True).click()
    page.get_by_text("There is no motion in time of this point.").wait_for()


def test_recordings_are_dropped_replayed_and_deleted(seen: PageSession, jobs: Jobs) -> None:
    page = seen.show("recordings")
    columns = "\n".join(f"{k / 100};{k % 7};{k % 5}" for k in range(50))
    page.get_by_text("What files of text do not say").click()
    page.get_by_label("Names of the channels").fill("base, tip")
    page.get_by_label("Units").fill("g, g")
    page.evaluate(DROP, [".dropped", [["hits.txt", columns], ["bad.txt", "nonsense"]]])
    page.get_by_text("bad.txt: expected rows of numbers, got none.").wait_for()
    page.get_by_text("hits.txt was received as hits.nc.").wait_for()
    page.get_by_text("base (9.80665 m/s²): 50 samples, tip").wait_for()
    page.get_by_role("link", name="Replay hits.nc").click()
    page.get_by_text("The scene is sound.").wait_for()
    assert 'recordings = ["hits.nc"]' in page.get_by_label("Scene (TOML)").input_value()
    page.get_by_label("Fit").wait_for()
    page.go_back()
    page.once("dialog", lambda dialog: dialog.accept())
    page.get_by_role("button", name="Delete hits.nc").click()
    page.get_by_role("heading", name="hits.nc").wait_for(state="detached")


def test_an_estimate_is_asked_for_with_all_its_options(seen: PageSession, jobs: Jobs) -> None:
    page = seen.show("recordings")
    page.get_by_role("link", name="Estimate hit.nc").click()
    page.get_by_label("Estimate", exact=True).select_option("response")
    page.get_by_label("Drive").select_option("base")
    page.get_by_label("Band").fill("700, 900")
    page.get_by_label("Estimate", exact=True).select_option("decay")
    page.get_by_label("Start").fill("late")
    page.get_by_role("button", name="Estimate").click()
    page.get_by_text("estimate.decay.start: Input should be a valid number").wait_for()
    page.get_by_label("Start").fill("0.005")
    page.get_by_role("button", name="Estimate").click()
    page.get_by_role("heading", name="decay of hit.nc").wait_for()
    see_results(page, "damping ratio")
    assert violations(page) == []


def test_a_fit_shows_its_figure_and_what_it_said_and_gives_its_scene(seen: PageSession, jobs: Jobs) -> None:
    page = seen.show_job(jobs.fit)
    page.get_by_role("heading", name="Untitled fit").wait_for()
    see_results(page, "standard error")
    with page.expect_download() as download:
        page.get_by_role("link", name="Fitted scene").click()
    assert "[replay]" in Path(download.value.path()).read_text(encoding="utf-8")


def see_results(page: Any, said: str) -> None:
    """Wait for the figure of a job and for its messages."""
    picture = page.get_by_role("img", name="Figure of")
    picture.wait_for()
    page.wait_for_function("(one) => one.complete && one.naturalWidth > 100", arg=picture.element_handle())
    page.get_by_label("Log").get_by_text(said).first.wait_for()


@pytest.mark.parametrize(("colours", "width"), [("dark", 1280), ("light", 390)])
def test_every_view_is_accessible_and_fits(
    chromium: Any, served: Served, jobs: Jobs, colours: str, width: int
) -> None:
    views = {
        "campaigns": ".state",
        "new": ".templates li",
        "compare": "canvas",
        "recordings": ".recordings li",
        "new/replay/hit.nc": "p.good",
        "estimate/recording/hit.nc": "form select",
        f"campaign/{jobs.map.id}": "td button",
        f"campaign/{jobs.fit.id}": "img.figure",
        "campaign/none": "h1",
        "new/none": "p.problem",
    }
    # half way through a change of colours a button has no contrast
    looks = {"color_scheme": colours, "reduced_motion": "reduce"}
    with PageSession(chromium, served, **looks, viewport={"width": width, "height": 844}) as seen:
        seen.sign_in()
        for view, there in views.items():
            page = seen.show(view)
            page.locator(there).first.wait_for()
            assert violations(page) == [], view
            assert page.evaluate("document.documentElement.scrollWidth") <= width, view


def test_what_is_written_into_the_page_is_not_run(seen: PageSession) -> None:
    page = seen.show("campaigns")
    assert "unsafe" not in page.request.get(page.url).headers["content-security-policy"]
    page.evaluate(
        "const script = document.createElement('script'); script.textContent = 'window.ran = 1';"
        "document.body.append(script);"
    )
    assert page.evaluate("window.ran") is None
    page.wait_for_function("window.violated.length")
    assert page.evaluate("window.violated.splice(0)") == ["script-src-elem"]
    seen.wrong.clear()


def test_a_campaign_grows_is_cancelled_and_goes_on_after_the_service_was_killed(
    seen: PageSession, served: Served, tmp_path: Path
) -> None:
    with served.client() as service:
        job = service.submit(scene_file(tmp_path, LONG), workers=1)
    page = seen.show_job(job)
    first = drawn(page)
    page.wait_for_function("(first) => document.querySelector('canvas').dataset.points > first", arg=first)
    page.get_by_text("Points a second").wait_for()
    served.kill()
    page.get_by_text("The service does not answer; trying again.").wait_for()
    served.restart()
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
    page.get_by_role("heading", name="Campaigns").wait_for()
    page.locator(f"a[href='#/campaign/{job.id}']").wait_for(state="detached")
