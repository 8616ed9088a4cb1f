"""Search for a C compiler, and compilation of shared libraries with it."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.fmus.packaging.platform_names import Platform, library_suffix, system
from vibroimpact.fmus.processes.python_child import python_command

#: Compiler that the user chose; if it does not work, that is an error, and no other compiler is tried.
CHOICE = "VIBROIMPACT_CC"
ON_PATH = ("cc", "gcc", "clang")

# no contraction: a * b + c is rounded twice everywhere, so that all machines give the same bits
LANGUAGE = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno")
WARNINGS = ("-Wall", "-Wextra", "-Wconversion")
#: Optimization across files, unknown to some linkers.
ACROSS_FILES = "-flto=auto"


def find_compiler() -> tuple[str, ...]:
    """Return the command of the first C compiler that works.

    The candidates are, in order, `$VIBROIMPACT_CC`, `$CC`, cc, gcc, clang and the ziglang package. Raise
    ComponentError if none works, or if the compiler of `$VIBROIMPACT_CC` does not.
    """
    for command in _candidates():
        if _works(command):
            return command
        if os.environ.get(CHOICE):
            chosen = os.environ[CHOICE]
            raise ComponentError(f"{CHOICE}: expected a C compiler that works, got {chosen!r}.")
    raise ComponentError(
        f"compiler: expected ${CHOICE}, $CC, {', '.join(ON_PATH)} or the package ziglang, "
        "got none that works. Run `pip install ziglang`."
    )


def has_compiler() -> bool:
    """Return whether there is a compiler besides the ziglang package."""
    return any(_works(command) for command in _candidates() if "ziglang" not in command)


def compile_library(
    target: Path,
    sources: Sequence[Path],
    include: Sequence[Path],
    *,
    definitions: Mapping[str, int] = MappingProxyType({}),
    export_all: bool = False,
    across_files: bool = False,
    level: str | None = None,
    strict: bool = True,
    platform: Platform | None = None,
) -> None:
    """Compile C files, with the folders of their headers, into one shared library, the target.

    Definitions are macros and their values. `export_all` exports every function, not only the marked ones.
    `across_files` optimizes across files where compiler and linker can, at another `level` if one is given, such as
    "-O3"; it takes half as long again. `strict` turns warnings into errors; it is off where users build, since a newer
    compiler may know new warnings. The ziglang package compiles for another platform. Raise ComponentError with the
    compiler's own words.
    """
    compiler = find_compiler() if platform is None else zig_compiler()
    options = [*LANGUAGE, *WARNINGS, *(["-Werror"] if strict else []), *_platform_options(compiler, platform)]
    if across_files and _works((*compiler, *_platform_options(compiler, platform), ACROSS_FILES)):
        options += [ACROSS_FILES, *([level] if level else [])]
    options += [] if export_all else ["-fvisibility=hidden"]
    options += [f"-D{name}={value}" for name, value in definitions.items()]
    folders = [f"-I{folder}" for folder in include]
    command = [*compiler, *options, *folders, "-o", str(target), *map(str, sources), "-lm"]
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        raise ComponentError(
            f"{target.name}: expected {shlex.join(compiler)} to compile it, "
            f"got exit code {result.returncode}:\n"
            f"{result.stderr.strip()}"
        )


def zig_compiler() -> tuple[str, ...]:
    """Return the command of the compiler for other machines; raise ComponentError without the package ziglang."""
    if not importlib.util.find_spec("ziglang"):
        raise ComponentError(
            "compiler: expected the package ziglang to compile for another machine, got none. "
            "Install it: `pip install 'vibroimpact[cross]'`."
        )
    return tuple(python_command("-m", "ziglang", "cc"))


def _platform_options(compiler: Sequence[str], platform: Platform | None = None) -> list[str]:
    windows = (system() if platform is None else platform.system) == "windows"
    options = ["-shared"] if windows else ["-shared", "-fPIC"]
    if "ziglang" in compiler:
        # by default zig compiles for the processor at hand; a wheel must run on every processor
        options += ["-mcpu=baseline", "-fno-sanitize=undefined"]
    if platform is not None:
        # symbols for a debugger are three quarters of a library, and name the folder of its compilation
        options += ["-target", platform.target, "-s"]
    return options


def _candidates() -> Iterator[tuple[str, ...]]:
    if os.environ.get(CHOICE):
        yield tuple(shlex.split(os.environ[CHOICE]))
        return
    if os.environ.get("CC"):
        yield tuple(shlex.split(os.environ["CC"]))
    yield from ((path,) for path in map(shutil.which, ON_PATH) if path)
    if importlib.util.find_spec("ziglang"):
        yield zig_compiler()


@cache
def _works(command: tuple[str, ...]) -> bool:
    # a compiler without the C library's headers, or the stub of a system without one, does not count
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "probe.c")
        source.write_text("#include <math.h>\ndouble probe(double x) { return sin(x); }\n")
        target = source.with_suffix(library_suffix())
        options = [*_platform_options(command), str(source), "-o", str(target), "-lm"]
        try:
            result = subprocess.run([*command, *options], capture_output=True)
        except OSError:
            return False
        return result.returncode == 0 and target.exists()
