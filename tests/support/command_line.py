"""The command line for tests: in a process of its own, as by a user, or in this process, which is quicker."""

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
    """Run the command `vibroimpact`; return its exit code and its output."""
    return warm.run(ENTRY, *arguments, cwd=cwd, env=os.environ | ENVIRONMENT)


def in_this_process(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run the command in this process; a new Python with its imports takes longer than most commands."""
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
