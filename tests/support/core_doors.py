"""The C core with the doors that only tests go through (`doors/`): bodies of many modes.

Compiled once for each state of the sources; what is built lies in `build/`, which `make clean` removes.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
from functools import lru_cache
from pathlib import Path

from support.places import ROOT
from vibroimpact.fmus.packaging.build import NATIVE, fingerprint
from vibroimpact.fmus.packaging.compiler import compile_library
from vibroimpact.fmus.packaging.platform_names import library_suffix

DOORS = Path(__file__).with_name("doors")


@lru_cache(maxsize=1)
def library_with_doors() -> ctypes.CDLL:
    """Return the library, loaded once."""
    doors = sorted(DOORS.glob("*.[ch]"))
    digest = hashlib.sha256(
        fingerprint().encode() + b"".join(path.read_bytes() for path in doors)
    ).hexdigest()
    target = ROOT / "build" / "tests" / f"libvibroimpact_tests-{digest[:16]}{library_suffix()}"
    if not target.is_file():
        target.parent.mkdir(parents=True, exist_ok=True)
        beside = target.with_name(f"{os.getpid()}-{target.name}")  # several workers may build it at once
        compile_with_doors(beside, NATIVE / "core")
        beside.replace(target)
    return ctypes.CDLL(str(target))


def compile_with_doors(target: Path, core: Path) -> None:
    """Compile a core, of these sources or of others like them, with the doors."""
    sources = [*sorted(core.rglob("*.c")), *sorted(DOORS.glob("*.c"))]
    compile_library(target, sources, [core, DOORS], export_all=True)
