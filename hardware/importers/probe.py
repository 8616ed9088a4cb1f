"""Open a file in a child process first, where the library that reads it can crash on damaged bytes."""

from __future__ import annotations

import os
import subprocess

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.python_child import python_command

PROBE_SECONDS = 120.0


def check_survives(code: str, path: os.PathLike[str] | str, kind: str) -> None:
    """Refuse a file whose reading kills a Python process, or does not end.

    Parameters
    ----------
    code : str
        Python that reads the file `sys.argv[1]`. Errors that it raises are left to the reader proper.
    path : path
    kind : str
        Format, for the message.

    Raises
    ------
    DatasetError
        The child died or did not end.
    """
    command = python_command("-c", code, os.fspath(path))
    try:
        ended = subprocess.run(command, capture_output=True, timeout=PROBE_SECONDS, check=False).returncode
    except subprocess.TimeoutExpired as problem:
        raise DatasetError(
            f"expected a {kind} file that opens within {PROBE_SECONDS:.0f} s, got another."
        ) from problem
    if ended not in (0, 1):  # 1 is an exception, a signal or a fault is another number
        raise DatasetError(f"expected a whole {kind} file, got one that crashes the library which reads it.")
