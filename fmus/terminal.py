"""Output to the terminal: no character from a file may move its cursor, set its colour or reverse its text.

Names in files, scenes and the log lines of FMUs are untrusted text. Every message goes through `printable`: by `say`,
or by a `Terminal`, which also prints square brackets as they are.

If the reader has gone, as behind `| head`, output stops and the command goes on, since its results are still to be
saved. The command also goes on if its output goes to a full disk, but reports this and fails.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import typer
from rich.console import Console
from rich.text import Text

from vibroimpact.fmus.messages import Spelling, typed
from vibroimpact.fmus.printable import printable

_PIPE_WIDTH = 160
_UNWRITTEN: set[str] = set()


def say(text: object, *, err: bool = False) -> None:
    """Write a line to standard output, or to standard error."""
    try:
        typer.echo(printable(str(text)), err=err)
    except OSError as error:
        _write_no_more(err, error)


def all_was_written() -> bool:
    """Return whether all text of this process reached its reader, or the reader had gone."""
    return not _UNWRITTEN


def _write_no_more(err: bool, error: OSError) -> None:
    """Redirect standard output, or standard error, to nowhere: its reader has gone, or it cannot be written."""
    stream = sys.stderr if err else sys.stdout
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
    if isinstance(error, BrokenPipeError):
        return
    name = "Standard error" if err else "Standard output"
    _UNWRITTEN.add(name)
    say(
        f"{name}: cannot be written to ({error.strerror or error}). What is computed is saved all the same.",
        err=True,
    )


class Terminal(Console):
    """A console of rich whose texts are printable and hold no markup; styles are given separately.

    Parameters
    ----------
    spelling : callable
        Spelling of messages: see `messages.Spelling`.
    options
        Options of rich's console.
    """

    def __init__(self, spelling: Spelling = typed, **options: Any) -> None:
        plain = {"markup": False, "highlight": False, "emoji": False}
        self.spelling = spelling
        super().__init__(**{**plain, **options})

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a string in its printable form; every string to print passes through this method."""
        return super().render_str(printable(self.spelling(text)), **options)

    def on_broken_pipe(self) -> None:
        """Continue without a reader."""
        self._write_no_more(BrokenPipeError())

    def __exit__(self, *error: Any) -> None:
        """Write text to the terminal; all printing ends in this method."""
        try:
            super().__exit__(*error)
        except OSError as problem:
            self._write_no_more(problem)

    def _write_no_more(self, error: OSError) -> None:
        self.quiet = True
        _write_no_more(self.stderr, error)


def wide_terminal(spelling: Spelling = typed) -> Terminal:
    """Return a console whose tables take the width they need if they go to a pipe, which has no width."""
    console = Terminal(spelling)
    if not console.is_terminal:
        console.width = _PIPE_WIDTH
    return console


def note(text: str) -> None:
    """Announce a slow action, apart from the command's own output."""
    say(text, err=True)
