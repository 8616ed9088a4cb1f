"""Look at every page of the site in Chromium: `python docs/site/look.py SITE PICTURES` prints each fault.

SITE is the folder of the built pages. Each page is opened on the screen of a phone and on that of a laptop. Pictures
of some pages stay in PICTURES. Without Chromium the command says so in one line and ends without an error; where
VIBROIMPACT_BROWSER is set, it ends in one.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
ARGUMENTS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run")
MUST = "VIBROIMPACT_BROWSER"
"""Variable that turns a missing browser into an error."""
MOST_MILLISECONDS = 60_000
"""Longest wait for one page. A page takes a quarter of a second on a free machine."""
PHONE, LAPTOP = (390, 844), (1280, 720)
"""Screens, CSS pixels: width and height."""
FRONT, GALLERY = "docs/index.html", "docs/gallery.html"
DRAWN = {
    FRONT: "h1",
    GALLERY: ".thumbnails",
    "docs/scene/stop.html": "#a-rigid-stop",
    "docs/orbits.html": ".printed",
    "docs/tutorial.html": ".cell_output img",
}
"""Pages that leave pictures, with the part at the top of each: title, thumbnails, tables, results, figure."""
LEAST_THUMBNAIL, MOST_THUMBNAIL = 280.0, 320.0
"""Bounds of the width of a picture of the gallery, CSS pixels."""
MEASURE = (Path(__file__).parent / "measure_page.js").read_text(encoding="utf-8")

SHOW = """(selector) => {
  const found = document.querySelector(`article ${selector}`);
  if (found && selector !== "h1") window.scrollTo(0, found.getBoundingClientRect().top - 150);
}"""
"""Script that scrolls to a part of a page, below the head of the site; a title needs no scrolling."""


@dataclass(frozen=True)
class Facts:
    """Measurements of one page on one screen, as `measure_page.js` returns them.

    Attributes
    ----------
    width, scroll_width : float
        Of the screen and of the page, CSS pixels.
    links : int
        Visible links of the navigation on the left.
    outside : list of str
        Tables, blocks and pictures that stand out of the column and of each box that scrolls.
    wrapped : list of str
        Results and short cells whose lines may break.
    first_screen : dict of str to float
        Lower edges of the parts of the front page, CSS pixels; infinite for a part that is missing.
    thumbnails : list of float
        Widths of the pictures of the gallery, CSS pixels.
    """

    width: float
    scroll_width: float
    links: int
    outside: list[str]
    wrapped: list[str]
    first_screen: dict[str, float]
    thumbnails: list[float]


def faults(page: str, screen: tuple[int, int], facts: Facts) -> Iterator[str]:
    """Yield each rule that a page breaks on a screen."""
    if facts.scroll_width > facts.width:
        yield f"expected a page of {facts.width:g} px, got {facts.scroll_width:g} px: it scrolls sideways"
    yield from (
        f"expected a box that scrolls, got one wider than its column: {name}" for name in facts.outside
    )
    yield from (f"expected lines that never wrap, got lines that do: {name}" for name in facts.wrapped)
    if screen == LAPTOP and facts.links == 0:
        yield "expected pages in the navigation on the left, got none"
    if page == FRONT:
        for part, bottom in facts.first_screen.items():
            if bottom > screen[1]:
                yield f"expected the {part} within the first {screen[1]} px, got its end at {bottom:.0f} px"
    if page == GALLERY and not facts.thumbnails:
        yield "expected thumbnails, got none"
    others = {round(width) for width in facts.thumbnails if not LEAST_THUMBNAIL <= width <= MOST_THUMBNAIL}
    yield from (f"expected thumbnails of 300 px, got {width} px" for width in sorted(others))


def pages_of(site: Path) -> list[str]:
    """Return the pages of a site, by their paths in its folder; without those that only lead elsewhere."""
    found = sorted(path for path in site.rglob("*.html") if "_static" not in path.parts)
    return [path.relative_to(site).as_posix() for path in found if not _leads_elsewhere(path)]


def _leads_elsewhere(path: Path) -> bool:
    return 'http-equiv="refresh"' in path.read_text(encoding="utf-8")[:1000]


def look(site: Path, pictures: Path) -> tuple[int, list[str]]:
    """Return the number of pages, and a line for each fault. Pictures are written on the way.

    Raises
    ------
    SystemExit
        If there is no front page.
    """
    from playwright.sync_api import sync_playwright

    pictures.mkdir(parents=True, exist_ok=True)
    pages, found = pages_of(site), []
    if FRONT not in pages:
        sys.exit(f"look: expected {site / FRONT}, got no file. `make docs` builds it.")
    with sync_playwright() as starter:
        browser = starter.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        for screen in (PHONE, LAPTOP):
            tab = _tab(browser, screen)
            for page in pages:
                tab.goto((site / page).as_uri(), wait_until="load")
                facts = Facts(**tab.evaluate(MEASURE))
                found += [f"{page}, {screen[0]} px: {fault}." for fault in faults(page, screen, facts)]
                if page in DRAWN:
                    tab.evaluate(SHOW, DRAWN[page])
                    tab.screenshot(path=pictures / f"{Path(page).stem}_{screen[0]}.png")
        browser.close()
    return len(pages), found


def _tab(browser: Any, screen: tuple[int, int]) -> Any:
    """Return a tab of the size of a screen that reads files and nothing from a network."""
    context = browser.new_context(viewport={"width": screen[0], "height": screen[1]})
    context.set_default_timeout(MOST_MILLISECONDS)
    context.route("http*://**", lambda route: route.abort())
    return context.new_page()


def main(site: Path, pictures: Path) -> None:
    """Print the faults of a site, then one line of result.

    Raises
    ------
    SystemExit
        If a page has a fault, or if there is no browser and VIBROIMPACT_BROWSER is set.
    """
    begin = time.perf_counter()
    missing = _missing()
    if missing:
        if os.environ.get(MUST):
            sys.exit(f"look: {missing}")
        print(f"look: nothing looked at the pages: {missing}")
        return
    count, found = look(site, pictures)
    print(*found, sep="\n", end="\n" if found else "")
    widths = f"{PHONE[0]} and {LAPTOP[0]} px"
    seconds = time.perf_counter() - begin
    print(
        f"look: {count} pages at {widths}, {len(found)} faults, {seconds:.0f} s. Pictures are in {pictures}."
    )
    if found:
        sys.exit(1)


def _missing() -> str:
    """Return the reason why there is no browser, with its remedy; nothing where there is one."""
    if find_spec("playwright") is None:
        return "playwright is not installed. In a checkout: pip install -e '.[docs]'"
    if CHROMIUM is None:
        return "no Chromium on PATH. On Debian: apt-get install chromium"
    return ""


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("look: expected two arguments, the folders of the site and of the pictures.")
    main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]))
