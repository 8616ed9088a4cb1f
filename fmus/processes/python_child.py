"""Python processes that this package starts: none of them imports files that lie in the current folder.

`python -m` and `python -c` put the current folder first on the module path. A person's `queue.py` beside a scene, or a
stranger's `scipy.py` beside a recording, would be imported in place of what it is named after.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

SAFE_PATH = "PYTHONSAFEPATH"


def python_command(*arguments: str) -> list[str]:
    """Return the command that runs this Python with arguments, the current folder off its module path."""
    return [sys.executable, "-P", *arguments]


@contextmanager
def safe_module_path() -> Iterator[None]:
    """Keep the current folder off the module path of the Python processes that libraries start meanwhile.

    For processes whose command is not ours to choose: those of Dask and multiprocessing. They do not run the script of
    this process again either, as multiprocessing would to find what is defined in it: one that starts a campaign
    outside of `if __name__ == "__main__"` would start another in every worker.
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
    """Let no warning of a library be shown by the Python processes that libraries start meanwhile.

    Python's resource tracker is one of them: it warns of the semaphores of a command that was killed, and removes them.
    Options of a person (`python -W`, PYTHONWARNINGS) come after this one, and so go before it.
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
    """Return in words how a process ended, by its exit code (negative: the signal).

    >>> ending(3), ending(-9)
    ('ended with exit code 3', 'was ended by SIGKILL')
    """
    if code is None or code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"
