"""The rounding mode of the process, which an FMU may change for all components after it.

Two sums and a product show the rounding to nearest and the treatment of subnormal numbers. They are far cheaper than a
call of the C library.
"""

from __future__ import annotations

import ctypes
import sys

#: ONE + TINY == ONE - TINY only if numbers are rounded to nearest.
ONE, TINY = 1.0, 1e-17
#: SMALL * HALF > 0 only if subnormal numbers are kept.
SMALL, HALF = sys.float_info.min, 0.5


def is_usual() -> bool:
    """Are numbers rounded to nearest, and subnormal numbers kept?"""
    return ONE + TINY == ONE - TINY and SMALL * HALF > 0.0


def set_usual() -> None:
    """Restore the default floating-point environment; on other systems than Linux only the rounding to nearest."""
    # Python itself is linked with the mathematical library; `find_library` would start processes to find it.
    library = ctypes.CDLL(None if sys.platform != "win32" else "ucrtbase")
    if sys.platform == "linux":
        library.fesetenv(ctypes.c_void_p(-1))  # FE_DFL_ENV of glibc and musl
    else:
        library.fesetround(ctypes.c_int(0))  # FE_TONEAREST
