"""The C core with test-only entry points (`doors/`): bodies of many modes.

The library is built once for each state of the sources; it lies in `build/`, which `make clean` removes.
"""

from __future__ import annotations

import ctypes
import sys
from functools import lru_cache
from pathlib import Path

from support.kept import content_of, digest, kept
from vibroimpact.fmus.packaging.build import CORE_LIBRARY, NATIVE, is_current
from vibroimpact.fmus.packaging.compiler import LANGUAGE, WARNINGS, compile_library
from vibroimpact.fmus.packaging.platform_names import library_suffix
from vibroimpact.fmus.shipped import package_folder

DOORS = Path(__file__).with_name("doors")
CORE = NATIVE / "core"


@lru_cache(maxsize=1)
def library_with_doors() -> ctypes.CDLL:
    """Return the library, loaded once."""
    # built for the imported package: `python -m mutants` puts faults into the core of another package
    built = package_folder() / "built" / f"{CORE_LIBRARY}{library_suffix()}"
    # the core library exports all functions that the doors call; a link to it by path works only on Linux
    is_linked = sys.platform == "linux" and is_current()
    core = [built] if is_linked else sorted(CORE.rglob("*.c"))
    key = digest(*LANGUAGE, *WARNINGS, content_of([*core, *CORE.rglob("*.h"), *DOORS.glob("*.[ch]")]))
    name = f"libvibroimpact_tests{library_suffix()}"
    return ctypes.CDLL(str(kept(name, key, lambda path: _compile(path, core, CORE))))


def compile_with_doors(target: Path, core: Path) -> None:
    """Compile a core, from these sources or from similar ones, with the test-only entry points."""
    _compile(target, sorted(core.rglob("*.c")), core)


def _compile(target: Path, core: list[Path], headers: Path) -> None:
    # a linker that takes only needed objects wants the doors, which need the core, first
    compile_library(target, [*sorted(DOORS.glob("*.c")), *core], [headers, DOORS], export_all=True)
