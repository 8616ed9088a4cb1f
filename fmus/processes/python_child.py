"""Python processes that this package starts: they import no files from the current folder.

`python -m` and `python -c` put the current folder first on the module path. A user's `queue.py` next to a scene, or a
stranger's `scipy.py` next to a recording, would replace the module of the same name.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

SAFE_PATH = "PYTHONSAFEPATH"


def python_command(*arguments: str) -> list[str]:
    """Return the command that runs this Python with arguments, without the current folder on its module path."""
    return [sys.executable, "-P", *arguments]


@contextmanager
def safe_module_path() -> Iterator[None]:
    """Keep the current folder off the module path of Python processes that libraries start inside this context.

    This serves processes whose command is not ours to choose: those of Dask and multiprocessing. They do not rerun the
    script of this process either, as multiprocessing would for its definitions. A script that starts a campaign outside
    of `if __name__ == "__main__"` would start another campaign in every worker.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        with _nameless_main():
            yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


@contextmanager
def no_library_warns() -> Iterator[None]:
    """Hide warnings of libraries in Python processes that libraries start inside this context.

    Python's resource tracker is such a process: it warns of the semaphores of a killed command, and removes them. A
    user's own options (`python -W`, PYTHONWARNINGS) come after this one and take precedence.
    """
    before = list(sys.warnoptions)
    sys.warnoptions.insert(0, "ignore")
    try:
        yield
    finally:
        sys.warnoptions[:] = before


@contextmanager
def _nameless_main() -> Iterator[None]:
    main = vars(sys.modules["__main__"])
    names = {name: main[name] for name in ("__file__", "__spec__") if main.get(name) is not None}
    if "__file__" in names:
        del main["__file__"]
    main["__spec__"] = None
    try:
        yield
    finally:
        main.update(names)


def ending(code: int | None) -> str:
    """Return the end of a process in words, from its exit code (negative: the signal).

    >>> ending(3), ending(-9)
    ('ended with exit code 3', 'was ended by SIGKILL')
    """
    if code is None or code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"
