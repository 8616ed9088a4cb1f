"""Chromium as the browser of a user: found, started, signed in, checked for accessibility."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import pytest

from support.served import Served
from vibroimpact.service.client import RemoteJob

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
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
"""Variable that makes tests of the page fail instead of being skipped, once it is set: `.ci/run`."""
VIOLATED = """
window.violated = [];
document.addEventListener("securitypolicyviolation", (event) => window.violated.push(event.violatedDirective));
"""
"""Script that notes the page's violations of its Content-Security-Policy."""
MOST_MILLISECONDS = 120_000
"""Longest wait of a test, on a machine that has other work: each process of a job imports everything."""
RULES = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice")


def need_browser() -> Any:
    """Return the starter of browsers; skip the test, with the reason, without a browser."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        absent("playwright cannot be imported. In a checkout: pip install -e '.[test]'")
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


class PageSession:
    """A page of a service in a context of its own; an error in the page fails the test at its end.

    Parameters
    ----------
    chromium : browser
    served : Served
    **how
        Options of the context: `color_scheme`, `viewport`, ...
    """

    def __init__(self, chromium: Any, served: Served, **how: Any) -> None:
        self._served = served
        self.wrong: list[str] = []
        self.context = chromium.new_context(**how)
        self.context.add_init_script(VIOLATED)
        self.context.on("request", self._note_request)
        self.page = self.context.new_page()
        self.page.set_default_timeout(MOST_MILLISECONDS)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("console", self._note_message)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        found = [] if kind else self.page.evaluate("window.violated")
        self.context.close()
        assert kind or [*self.wrong, *found] == []

    def _note_message(self, message: Any) -> None:
        # the browser also reports refused requests here; each test knows its own
        if message.type == "error" and "Failed to load resource" not in message.text:
            self.wrong.append(message.text)

    def _note_request(self, request: Any) -> None:
        if not request.url.startswith(f"{self._served.url}/"):
            self.wrong.append(f"request to {request.url}")

    def sign_in(self) -> None:
        """Give the page its token."""
        self.page.goto(self._served.url)
        self.page.get_by_label("Token of the service").fill(token_of(self._served))
        self.page.keyboard.press("Enter")
        self.page.get_by_role("navigation").wait_for()

    def show(self, view: str) -> Any:
        """Return the page after opening one of its views."""
        self.page.goto(f"{self._served.url}/#/{view}")
        return self.page

    def show_job(self, job: RemoteJob) -> Any:
        """Return the page after opening a job."""
        return self.show(f"campaign/{job.id}")


def token_of(served: Served) -> str:
    return (served.folder / "token").read_text(encoding="utf-8").strip()


def violations(page: Any) -> list[str]:
    """Return the violations that axe-core finds in the current page."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page, options={"runOnly": list(RULES)}).response["violations"]
    return [f"{one['id']}: {one['help']}: {one['nodes'][0]['html']}" for one in found]
