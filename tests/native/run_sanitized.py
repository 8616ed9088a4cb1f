"""Runs every C test of this folder under the sanitizers that the compiler at hand supports.

Each `*.c` here is a program of its own, linked with the whole core; it passes when it exits with 0.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from vibroimpact.fmus.build import NATIVE, fmi_headers
from vibroimpact.fmus.compiler import LANGUAGE, WARNINGS, find_compiler

HERE = Path(__file__).parent
SANITIZERS = ("address", "undefined")
PROBE = "int main(int count, char **names) { (void)names; return count - 1; }\n"
#: Longest that one test may take under the sanitizers, s.
LIMIT = 600.0
ENVIRONMENT = {**os.environ, "UBSAN_OPTIONS": "print_stacktrace=1", "ASAN_OPTIONS": "detect_leaks=1"}


def supported(compiler: Sequence[str], sanitizer: str, folder: Path) -> bool:
    """Return whether a program with this sanitizer compiles, links and runs here."""
    source, program = folder / "probe.c", folder / "probe"
    source.write_text(PROBE, encoding="ascii")
    command = [*compiler, f"-fsanitize={sanitizer}", str(source), "-o", str(program)]
    compiled = subprocess.run(command, capture_output=True)
    return compiled.returncode == 0 and subprocess.run([str(program)], capture_output=True).returncode == 0


def run(test: Path, compiler: Sequence[str], sanitizers: Sequence[str], folder: Path) -> bool:
    """Compile and run one test; return whether it passed."""
    program = folder / test.stem
    options = [*LANGUAGE, *WARNINGS, "-Werror", "-g", "-O1", f"-I{NATIVE / 'core'}", f"-I{fmi_headers()}"]
    if sanitizers:
        options += [f"-fsanitize={','.join(sanitizers)}", "-fno-sanitize-recover=all"]
    sources = [str(test), *map(str, sorted((NATIVE / "core").glob("*.c")))]
    compiled = subprocess.run([*compiler, *options, *sources, "-o", str(program), "-lm"])
    if compiled.returncode != 0:
        return False
    return subprocess.run([str(program)], timeout=LIMIT, env=ENVIRONMENT).returncode == 0


def main() -> int:
    """Run all; return 1 if one failed."""
    compiler = find_compiler()
    failed = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sanitizers = [s for s in SANITIZERS if supported(compiler, s, folder)]
        for missing in sorted(set(SANITIZERS) - set(sanitizers)):
            print(f"SKIPPED: the {missing} sanitizer, which {' '.join(compiler)} does not have here")
        for test in sorted(HERE.glob("*.c")):
            passed = run(test, compiler, sanitizers, folder)
            print(
                f"{test.name} ({', '.join(sanitizers) or 'no sanitizer'}): {'passed' if passed else 'FAILED'}"
            )
            failed += [] if passed else [test.name]
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
