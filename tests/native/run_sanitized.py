"""Runs every C test of this folder under the sanitizers that the compiler at hand supports.

Each `*.c` here is a program of its own, linked with the whole core; it passes when it exits with 0.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from vibroimpact.fmus.packaging.build import NATIVE, fmi_headers
from vibroimpact.fmus.packaging.compiler import LANGUAGE, WARNINGS, find_compiler

HERE = Path(__file__).parent
SANITIZERS = ("address", "undefined")
PROBE = "int main(int count, char **names) { (void)names; return count - 1; }\n"
#: Longest that one test may take under the sanitizers, s.
LIMIT = 600.0
#: Tests of bodies of one mode, which run on a core that is compiled for them, as the Oscillator's is.
OF_ONE_MODE = ("one_mode.c",)
ONE_MODE = ("-DVI_MODES=2", "-DVI_PORTS=2", "-DVI_ONLY_MODES=1")
ENVIRONMENT = {**os.environ, "UBSAN_OPTIONS": "print_stacktrace=1", "ASAN_OPTIONS": "detect_leaks=1"}


def supported(compiler: Sequence[str], sanitizer: str, folder: Path) -> bool:
    """Return whether a program with this sanitizer compiles, links and runs here."""
    source, program = folder / "probe.c", folder / "probe"
    source.write_text(PROBE, encoding="ascii")
    command = [*compiler, f"-fsanitize={sanitizer}", str(source), "-o", str(program)]
    compiled = subprocess.run(command, capture_output=True)
    return compiled.returncode == 0 and subprocess.run([str(program)], capture_output=True).returncode == 0


def options_for(sanitizers: Sequence[str]) -> list[str]:
    """Return the options that the core and the tests are compiled with."""
    options = [*LANGUAGE, *WARNINGS, "-Werror", "-g", "-O1"]
    options += [f"-I{folder}" for folder in (NATIVE / "core", NATIVE / "adapters", fmi_headers())]
    if sanitizers:
        options += [f"-fsanitize={','.join(sanitizers)}", "-fno-sanitize-recover=all"]
    return options


def compile_core(compiler: Sequence[str], options: Sequence[str], folder: Path) -> list[Path] | None:
    """Compile the core, which tests share, side by side on all processors; None if that fails."""
    folder.mkdir()
    sources = sorted((NATIVE / "core").rglob("*.c"))
    objects = [folder / f"{source.stem}.o" for source in sources]

    def compiles(source: Path, target: Path) -> bool:
        return subprocess.run([*compiler, *options, "-c", str(source), "-o", str(target)]).returncode == 0

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return objects if all(pool.map(compiles, sources, objects)) else None


def run(
    test: Path, compiler: Sequence[str], options: Sequence[str], core: Sequence[Path], folder: Path
) -> bool:
    """Compile and run one test; return whether it passed."""
    program = folder / test.stem
    command = [*compiler, *options, str(test), *map(str, core), "-o", str(program), "-lm"]
    if subprocess.run(command).returncode != 0:
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
        options = options_for(sanitizers)
        cores = {
            only_one: (sizes, compile_core(compiler, [*options, *sizes], folder / f"core{len(sizes)}"))
            for only_one, sizes in ((False, ()), (True, ONE_MODE))
        }

        def passes(test: Path) -> bool:
            sizes, core = cores[test.name in OF_ONE_MODE]
            return core is not None and run(test, compiler, [*options, *sizes], core, folder)

        tests = sorted(HERE.glob("*.c"))
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            results = pool.map(passes, tests)
            for test, passed in zip(tests, results, strict=True):
                kinds, result = ", ".join(sanitizers) or "no sanitizer", "passed" if passed else "FAILED"
                print(f"{test.name} ({kinds}): {result}")
                failed += [] if passed else [test.name]
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
