"""The shared library of the C core, loaded once."""

from __future__ import annotations

import ctypes
import sys
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from vibroimpact.fmus.errors import ComponentError


@lru_cache(maxsize=1)
def core_library() -> ctypes.CDLL:
    """Return the shared library of the core.

    Raises
    ------
    ComponentError
        It is not built.
    """
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    path = Path(str(files("vibroimpact.fmus"))) / "built" / f"libvibroimpact_core{suffix}"
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise ComponentError(
            f"{path.name}: expected the built core library, got: {error}. "
            "Run `python -m vibroimpact.fmus.packaging.build`."
        ) from error
    return library
