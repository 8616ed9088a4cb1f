"""A process that reports the modules loaded by several commands, or by lines of Python.

It reads orders from standard input as JSON: modules to load beforehand, modules to look for, and groups of rows. A row
is a command of `vibroimpact` (a list of words) or Python (a text). Each group runs in a child made by `fork` from this
process, which has loaded nothing of vibroimpact. The answer has one line for each group. For each row it has the exit
code, the loaded modules among those looked for, and the end of the output.
"""

from __future__ import annotations

import importlib
import io
import json
import os
import sys
from collections.abc import Collection, Iterable
from contextlib import redirect_stderr, redirect_stdout

Row = list[str] | str
Answer = tuple[int, list[str], str]


def loaded_by(rows: Iterable[Row], looked_for: Collection[str]) -> str:
    """Return the answers to a group of rows, as JSON."""
    answers, answer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(answers)
        with os.fdopen(answer, "w") as pipe:
            json.dump([run(row, looked_for) for row in rows], pipe)
        os._exit(0)
    os.close(answer)
    with os.fdopen(answers) as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    return text


def run(row: Row, looked_for: Collection[str]) -> Answer:
    """Run a row; return its exit code, the loaded modules among those looked for, and the end of its output."""
    said, code = io.StringIO(), 0
    with redirect_stdout(said), redirect_stderr(said):
        try:
            if isinstance(row, str):
                exec(row, {"__name__": "row"})
            else:
                from vibroimpact.orchestrator.commands.cli import main

                main(row)
        except SystemExit as left:
            code = int(str(left.code or 0))
        except Exception as error:
            code = 1
            print(f"{type(error).__name__}: {error}")
    return code, [name for name in looked_for if name in sys.modules], said.getvalue()[-1000:]


def answer_orders() -> None:
    """Answer the orders of standard input."""
    for order in json.load(sys.stdin):
        for name in order["beforehand"]:
            importlib.import_module(name)
        assert "vibroimpact" not in sys.modules
        # an old xarray loads scipy itself
        looked_for = [name for name in order["looked_for"] if name not in sys.modules]
        for rows in order["groups"]:
            print(loaded_by(rows, looked_for), flush=True)


if __name__ == "__main__":
    answer_orders()
