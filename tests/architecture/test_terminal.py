"""One module writes to the terminal, and escapes the texts of files."""

from __future__ import annotations

import re

from support.places import ROOT

# Modules that run as scripts of their own, before the command line exists.
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
