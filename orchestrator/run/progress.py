"""The progress of a running campaign on the screen: points done, speed and remaining time."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, TextIO

from vibroimpact.fmus.printable import printable

if TYPE_CHECKING:
    from rich.progress import Progress as RichBar

LINE_SECONDS = 5.0
"""Least time between two lines where the output is not a terminal, s."""

REFRESHES_PER_SECOND = 2
"""Number of times per second that the bar is drawn; drawing takes processor time from the workers."""


class Progress:
    """Counts the points of a campaign without showing them; its subclasses show the counts."""

    def __init__(self) -> None:
        self._total = self._done = self._resumed = 0
        self._lost, self._stage = "", ""
        self._began = time.monotonic()

    def begin(self, total: int, done: int, said: str = "") -> None:
        """Start the clock with `done` of `total` points finished already; `said` names the round of points."""
        self._stage = said
        self._total, self._done, self._resumed = total, done, done
        self._began = time.monotonic()

    def advance(self, points: int) -> None:
        """Count more points as done."""
        self._done += points

    def lost_workers(self, count: int) -> None:
        """Set the number of workers that have died so far."""
        self._lost = lost_text(count)

    def note(self, text: str) -> None:
        """Show a text once."""

    def _pace(self) -> tuple[str, str]:
        """Return points a second and the remaining time, both in words."""
        rate = (self._done - self._resumed) / max(time.monotonic() - self._began, 1e-9)
        remaining = clock((self._total - self._done) / rate) if rate > 0 else "?"
        return f"{rate:.0f} points/s", remaining


class Lines(Progress):
    """Writes a line now and then; for files, pipes and continuous integration."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self._stream = stream
        self._last_line = -math.inf

    def advance(self, points: int) -> None:
        """Write a line when the last one is old, and at the end."""
        super().advance(points)
        now = time.monotonic()
        if now - max(self._last_line, self._began) >= LINE_SECONDS or self._done == self._total:
            self._last_line = now
            rate, remaining = self._pace()
            done = f"{self._done} of {self._total} points{self._stage}"
            self.note(f"{done}, {rate}, {remaining} remaining{self._lost}")

    def note(self, text: str) -> None:
        """Write a line."""
        print(printable(text), file=self._stream, flush=True)


class Bar(Progress):
    """Draws a bar in a terminal."""

    def __init__(self, bar: RichBar) -> None:
        super().__init__()
        self._bar = bar
        self._task = bar.add_task("points", total=None, rate="", remaining="", lost="", round="")

    def begin(self, total: int, done: int, said: str = "") -> None:
        """Show the bar."""
        super().begin(total, done, said)
        self._bar.update(self._task, total=total, completed=done, round=said)

    def advance(self, points: int) -> None:
        """Move the bar; a timer of the bar draws it."""
        super().advance(points)
        rate, remaining = self._pace()
        self._bar.update(self._task, completed=self._done, rate=rate, remaining=remaining)

    def lost_workers(self, count: int) -> None:
        """Show the number at the end of the bar."""
        self._bar.update(self._task, lost=lost_text(count))

    def note(self, text: str) -> None:
        """Write a line above the bar."""
        self._bar.console.print(text)


class NotebookBar(Progress):
    """Draws a bar below the cell of a notebook; `show` replaces the HTML there."""

    def __init__(self, show: Callable[[str], None]) -> None:
        super().__init__()
        self._show = show
        self._notes, self._drawn = "", 0.0

    def begin(self, total: int, done: int, said: str = "") -> None:
        """Show the bar."""
        super().begin(total, done, said)
        self._draw()

    def advance(self, points: int) -> None:
        """Move the bar when the last drawing is old, and at the end."""
        super().advance(points)
        if time.monotonic() - self._drawn >= 1.0 / REFRESHES_PER_SECOND or self._done == self._total:
            self._draw()

    def note(self, text: str) -> None:
        """Write a line below the bar."""
        self._notes += f"<br>{escape(printable(text))}"
        self._draw()

    def _draw(self) -> None:
        self._drawn = time.monotonic()
        rate, remaining = self._pace()
        left = f", {rate}, {remaining} remaining" if self._done > self._resumed else ""
        bar = f'<progress max="{self._total}" value="{self._done}"></progress>'
        self._show(f"{bar} {self._done} of {self._total} points{self._stage}{left}{self._lost}{self._notes}")


def _notebook() -> Callable[[str], None] | None:
    """Return a function that shows HTML below the running cell; None outside a notebook."""
    interactive = sys.modules.get("IPython")
    shell = interactive.get_ipython() if interactive is not None else None
    if shell is None or not hasattr(shell, "kernel"):
        return None
    from IPython.display import HTML, display

    handle = display(HTML(""), display_id=True)
    return lambda text: handle.update(HTML(text))


def lost_text(count: int) -> str:
    """Return the words on lost workers for a line of progress.

    >>> lost_text(0), lost_text(1), lost_text(2)
    ('', ', 1 worker lost', ', 2 workers lost')
    """
    return f", {count} worker{'s' if count > 1 else ''} lost" if count else ""


def clock(seconds: float) -> str:
    """Return a duration as minutes and seconds, with hours from one hour on.

    >>> clock(59.6), clock(3725.0)
    ('1:00', '1:02:05')
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


@contextmanager
def shown_progress(stream: TextIO | None = None) -> Iterator[Progress]:
    """Show progress on a stream, standard error by default: a bar in a notebook or a terminal, else lines."""
    notebook = _notebook() if stream is None else None
    if notebook is not None:
        yield NotebookBar(notebook)
        return
    stream = stream or sys.stderr
    if not stream.isatty():
        yield Lines(stream)
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as RichBar

    from vibroimpact.fmus.terminal import Terminal

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("points{task.fields[round]}"),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[remaining]} remaining{task.fields[lost]}"),
    )
    with RichBar(*columns, console=Terminal(file=stream), refresh_per_second=REFRESHES_PER_SECOND) as bar:
        yield Bar(bar)
