"""Debian's Chromium, as a person's browser: found, started, signed in, asked about accessibility."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
MUST = "VIBROIMPACT_BROWSER"
"""Variable that, where it is set, makes tests of the page fail instead of being skipped: `.ci/run`."""
RULES = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice")


def need_browser() -> Any:
    """Return what starts a browser; skip the test, with the reason, where there is none."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        absent("playwright cannot be imported: pip install playwright")
    if CHROMIUM is None:
        absent("no Chromium on PATH. On Debian: apt-get install chromium")
    return sync_playwright()


def absent(reason: str) -> None:
    if os.environ.get(MUST):
        pytest.fail(reason)
    pytest.skip(reason)


@contextmanager
def browser() -> Iterator[Any]:
    """Start a browser with a profile of its own."""
    with need_browser() as starter:
        started = starter.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        yield started
        started.close()


def sign_in(page: Any, url: str, token: str, view: str = "") -> None:
    """Open the page of a service and give it its token."""
    page.goto(f"{url}/{view}")
    page.get_by_label("Token of the service").fill(token)
    page.keyboard.press("Enter")
    page.get_by_role("navigation").wait_for()


def violations(page: Any) -> list[str]:
    """Return what axe-core finds wrong with what a page shows."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page, options={"runOnly": list(RULES)}).response["violations"]
    return [f"{one['id']}: {one['help']}: {one['nodes'][0]['html']}" for one in found]
