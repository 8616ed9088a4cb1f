"""The shared library of the C core, loaded once."""

from __future__ import annotations

import ctypes
import sys
from functools import cache

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.fmus.shipped import package_folder


@cache
def core_library() -> ctypes.CDLL:
    """Return the shared library of the core.

    Raises
    ------
    ComponentError
        The library is not built.
    """
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    path = package_folder() / "built" / f"libvibroimpact_core{suffix}"
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise ComponentError(
            f"{path.name}: expected the built core library, got: {error}. "
            "Run `python -m vibroimpact.fmus.packaging.build`."
        ) from error
