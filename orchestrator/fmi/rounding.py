"""The rounding mode of the process, which an FMU may change for all components after it.

Whether numbers are rounded to nearest, and subnormal ones kept, is seen from two sums and a product: far cheaper
than a call of the C library.
"""

from __future__ import annotations

import ctypes
import sys

#: ONE + TINY == ONE - TINY where numbers are rounded to nearest, and nowhere else.
ONE, TINY = 1.0, 1e-17
#: SMALL * HALF > 0 where subnormal numbers are kept.
SMALL, HALF = sys.float_info.min, 0.5


def is_usual() -> bool:
    """Are numbers rounded to nearest, and subnormal numbers kept?"""
    return ONE + TINY == ONE - TINY and SMALL * HALF > 0.0


def set_usual() -> None:
    """Go back to the default floating-point environment; elsewhere than on Linux only to rounding to nearest."""
    # Python itself is linked with the mathematical library: `find_library` would start processes to find it.
    library = ctypes.CDLL(None if sys.platform != "win32" else "ucrtbase")
    if sys.platform == "linux":
        library.fesetenv(ctypes.c_void_p(-1))  # FE_DFL_ENV of glibc and musl
    else:
        library.fesetround(ctypes.c_int(0))  # FE_TONEAREST
