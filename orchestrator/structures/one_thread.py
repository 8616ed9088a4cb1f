"""Linear algebra on one thread: the blocks of a reduction are thin, and threads that wait for them spin.

The result is then also that of any number of processors.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import Lock

_PACKAGES = ("numpy", "scipy")
_PREFIX, _SUFFIXES = "scipy_openblas", ("64_", "")
"""Names of the functions in the wheels of numpy (64-bit integers) and scipy."""
_lock = Lock()
_before: list[int] = []
"""Numbers of threads that the libraries had before the first of the blocks that run now."""
_running = 0


@contextmanager
def on_one_thread() -> Iterator[None]:
    """Run a block, or a function, with one thread in the OpenBLAS libraries of numpy and scipy.

    Blocks of several Python threads may overlap. Other libraries, such as Accelerate, keep their threads.
    """
    global _running
    with _lock:
        if not _running:
            _before[:] = [read() for read, _ in _libraries()]
            for _, write in _libraries():
                write(1)
        _running += 1
    try:
        yield
    finally:
        with _lock:
            _running -= 1
            if not _running:
                for (_, write), threads in zip(_libraries(), _before, strict=True):
                    write(threads)


@cache
def _libraries() -> tuple[tuple[Callable[[], int], Callable[[int], None]], ...]:
    """Return the functions that read and set the number of threads of each library."""
    found = []
    for path in _paths():
        library = ctypes.CDLL(str(path))
        for suffix in _SUFFIXES:
            read = getattr(library, f"{_PREFIX}_get_num_threads{suffix}", None)
            write = getattr(library, f"{_PREFIX}_set_num_threads{suffix}", None)
            if read is not None and write is not None:
                found.append((read, write))
    return tuple(found)


def _paths() -> Iterator[Path]:
    """Yield the libraries beside numpy and scipy in their wheels."""
    for package in _PACKAGES:
        spec = find_spec(package)
        if spec is not None and spec.origin is not None:
            inside = Path(spec.origin).parent
            for folder in (inside.with_name(f"{package}.libs"), inside / ".dylibs"):
                yield from sorted(folder.glob("*openblas*"))
