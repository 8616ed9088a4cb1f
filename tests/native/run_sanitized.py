"""Run every C test of this folder under the sanitizers that the compiler supports.

Each `*.c` is a program, linked with the whole core; it passes when it exits with 0. Objects and programs are cached
by the content of their sources, all headers and the compiler. All programs run each time.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from support.kept import compiler_identity, content_of, digest, kept, remove_unused
from support.places import ROOT

from vibroimpact.fmus.packaging.build import NATIVE, fmi_headers, is_part, sizes
from vibroimpact.fmus.packaging.compiler import LANGUAGE, WARNINGS, find_compiler
from vibroimpact.fmus.packaging.description import read_component

HERE = Path(__file__).resolve().parent
KEPT = ROOT / "build" / "sanitized"
SANITIZERS = ("address", "undefined")
PROBE = "int main(int count, char **names) { (void)names; return count - 1; }\n"
#: Tests with the longest run times; they start first.
LONGEST = ("one_mode.c", "budget.c", "pressed_flow.c")
#: Longest run time of one test under the sanitizers, s; a longer test fails.
LIMIT = 600.0
#: Tests of bodies of one mode or of many contacts. Each runs on a core compiled for them, like that of a component.
OWN_CORES = {"one_mode.c": "oscillator", "many_contacts.c": "structure"}
ENVIRONMENT = {**os.environ, "UBSAN_OPTIONS": "print_stacktrace=1", "ASAN_OPTIONS": "detect_leaks=1"}


@dataclass(frozen=True)
class Toolchain:
    """Compiler, options and headers of one kind of core."""

    compiler: tuple[str, ...]
    options: tuple[str, ...]

    @cached_property
    def key(self) -> str:
        """Digest of everything that affects an object, except its source."""
        headers = [*NATIVE.rglob("*.h"), *HERE.glob("*.h"), *fmi_headers().glob("*.h")]
        return digest(compiler_identity(self.compiler), *self.options, content_of(headers))

    def compile(self, *arguments: str | Path) -> None:
        """Run the compiler; a CalledProcessError holds its messages."""
        command = [*self.compiler, *self.options, *map(str, arguments)]
        subprocess.run(command, check=True, capture_output=True, text=True)

    def object_of(self, source: Path) -> Path:
        """Return the object of a source of the core."""
        key = digest(self.key, content_of([source]))
        return kept(f"{source.stem}.o", key, lambda path: self.compile("-c", source, "-o", path), KEPT)

    def program_of(self, test: Path, core: Sequence[Path]) -> Path:
        """Return the program of a test, linked with the objects of the core."""
        beside_core = [path for path in NATIVE.rglob("*.c") if NATIVE / "core" not in path.parents]
        key = digest(self.key, content_of([test, *beside_core]), *(path.name for path in core))
        return kept(test.stem, key, lambda path: self.compile(test, *core, "-o", path, "-lm"), KEPT)


def supported(compiler: Sequence[str], sanitizers: Sequence[str]) -> bool:
    """Return whether a program with these sanitizers compiles, links and runs here."""
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder, "probe.c"), Path(folder, "probe")
        source.write_text(PROBE, encoding="ascii")
        command = [*compiler, f"-fsanitize={','.join(sanitizers)}", str(source), "-o", str(program)]
        compiled = subprocess.run(command, capture_output=True)
        return compiled.returncode == 0 and subprocess.run([program], capture_output=True).returncode == 0


def supported_sanitizers(compiler: Sequence[str]) -> tuple[str, ...]:
    """Return the sanitizers that work here; print a line for each of the others."""
    if supported(compiler, SANITIZERS):
        return SANITIZERS
    found = tuple(sanitizer for sanitizer in SANITIZERS if supported(compiler, [sanitizer]))
    for missing in sorted(set(SANITIZERS) - set(found)):
        print(f"SKIPPED: the {missing} sanitizer, which {' '.join(compiler)} does not have here")
    return found


def options_for(sanitizers: Sequence[str]) -> tuple[str, ...]:
    """Return the compiler options for the core and the tests."""
    options = [*LANGUAGE, *WARNINGS, "-Werror", "-g1", "-O1"]
    options += [
        f"-I{folder}"
        for folder in (NATIVE / "core", NATIVE / "adapters", NATIVE / "structure", fmi_headers())
    ]
    if sanitizers:
        options += [f"-fsanitize={','.join(sanitizers)}", "-fno-sanitize-recover=all"]
    return tuple(options)


@dataclass(frozen=True)
class CoreKind:
    """Sources of a core, and definitions of its sizes."""

    sources: tuple[Path, ...]
    sizes: tuple[str, ...] = ()


def core_of(folder: str) -> CoreKind:
    """Return the core of the component in a folder; for an empty name, the whole core."""
    sources = tuple(sorted((NATIVE / "core").rglob("*.c")))
    if not folder:
        return CoreKind(sources)
    component = read_component(NATIVE / folder / "variables.toml")
    own = tuple(path for path in sources if is_part(component, path.relative_to(NATIVE / "core")))
    return CoreKind(own, tuple(f"-D{name}={value}" for name, value in sizes(component).items()))


def run(program: Path, name: str) -> None:
    """Run a program in a folder of its own, in which it may write."""
    with tempfile.TemporaryDirectory() as folder:
        itself = str(Path(folder, name))
        subprocess.run(
            [itself],
            executable=program,
            cwd=folder,
            check=True,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=LIMIT,
            env=ENVIRONMENT,
        )


def failure(test: Path, tools: Toolchain, core: Sequence[Path]) -> str:
    """Compile and run one test; return the error message, empty if the test passed."""
    try:
        run(tools.program_of(test, core), test.stem)
    except subprocess.CalledProcessError as error:
        return f"exit code {error.returncode}\n{error.stdout}{error.stderr}"
    except subprocess.TimeoutExpired:
        return f"not at its end after {LIMIT:g} s"
    return ""


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), help="programs at once, of the compiler and of tests"
    )
    return parser.parse_args(arguments)


def in_order(tests: Iterable[Path]) -> list[Path]:
    """Return the tests in their starting order: the longest first, then by name."""
    return sorted(tests, key=lambda test: (test.name not in LONGEST, test.name))


def run_all(pool: ThreadPoolExecutor, compiler: tuple[str, ...], sanitizers: Sequence[str]) -> list[str]:
    """Compile and run all tests, print a line for each; return the names of failed tests."""
    options, failed = options_for(sanitizers), []
    kinds = {folder: core_of(folder) for folder in ("", *OWN_CORES.values())}
    tools = {folder: Toolchain(compiler, (*options, *kind.sizes)) for folder, kind in kinds.items()}
    objects = {folder: pool.map(tools[folder].object_of, kind.sources) for folder, kind in kinds.items()}
    cores = {kind: list(found) for kind, found in objects.items()}
    running = {}
    for test in in_order(HERE.glob("*.c")):
        kind = OWN_CORES.get(test.name, "")
        running[pool.submit(failure, test, tools[kind], cores[kind])] = test.name
    for future in as_completed(running):
        name, wrong = running[future], future.result()
        used = ", ".join(sanitizers) or "no sanitizer"
        print(f"{name} ({used}): {f'FAILED: {wrong}' if wrong else 'passed'}", flush=True)
        failed += [name] if wrong else []
    return failed


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all tests; return 1 if a test failed or the core does not compile."""
    compiler = find_compiler()
    with ThreadPoolExecutor(parsed(arguments).jobs) as pool:
        try:
            failed = run_all(pool, compiler, supported_sanitizers(compiler))
        except subprocess.CalledProcessError as error:
            print(f"FAILED: the core does not compile\n{error.stderr}")
            return 1
    remove_unused(KEPT)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
