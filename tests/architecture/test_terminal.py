"""One module writes to the terminal, so that no text of a file gets there as it is."""

from __future__ import annotations

import re

from support.places import ROOT

# Run as a script of its own, before the command line is there.
SCRIPTS = ("fmus/packaging/build.py",)
WRITES = re.compile(
    r"typer\.(?:echo|secho)\(|\bConsole\(|^\s*print\((?!printable\()|sys\.std(?:out|err)\.write", re.MULTILINE
)


def test_everything_that_is_printed_goes_through_the_module_of_the_terminal() -> None:
    writers = []
    for package in ("fmus", "analysis", "orchestrator", "hardware"):
        for path in (ROOT / package).rglob("*.py"):
            name = path.relative_to(ROOT).as_posix()
            code = re.sub(r"^\s*>>>.*$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
            if name not in SCRIPTS and name != "fmus/terminal.py" and WRITES.search(code):
                writers.append(name)
    assert writers == []
