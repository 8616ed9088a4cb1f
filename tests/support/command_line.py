"""The command line as tests use it: in a process of its own, as a person does, or in this one, which is quicker."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
from pathlib import Path
from unittest.mock import patch

from harness import warm

from vibroimpact.orchestrator.commands.cli import main

ENTRY = "from vibroimpact.orchestrator.commands.cli import main; main()"
ENVIRONMENT = {"COLUMNS": "200"}


def vibroimpact(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command `vibroimpact` and return its exit code and what it printed."""
    return warm.run(ENTRY, *arguments, cwd=cwd, env=os.environ | ENVIRONMENT)


def in_this_process(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Do the same without starting Python and importing everything anew, which takes longer than most commands."""
    given, out, err = [*map(str, arguments)], io.StringIO(), io.StringIO()
    code: object = 0
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        patch.dict(os.environ, ENVIRONMENT),
    ):
        try:
            main(given)
        except SystemExit as left:
            code = left.code
    return subprocess.CompletedProcess(given, int(str(code or 0)), out.getvalue(), err.getvalue())
