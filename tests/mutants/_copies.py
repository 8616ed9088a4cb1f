"""A copy of the package whose C core has a fault."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from support.kept import compiler_identity, content_of, digest, kept
from support.places import ROOT

from mutants._faults import Fault
from vibroimpact.fmus.packaging.build import (
    BUILT,
    CORE_LIBRARY,
    NATIVE,
    beside_core,
    documentation,
    fmi_headers,
    is_part,
    read_components,
    sizes,
)
from vibroimpact.fmus.packaging.compiler import LANGUAGE, find_compiler
from vibroimpact.fmus.packaging.description import (
    ComponentDescription,
    c_header,
    header_name,
    model_description,
)
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.platform_names import binary_folder, library_suffix
from vibroimpact.fmus.shipped import FOLDERS

KEPT = ROOT / "build" / "mutants"
PACKAGE = ROOT / ".editable" / "vibroimpact"


class DoesNotCompile(Exception):
    """The compiler refuses the fault."""


@dataclass(frozen=True)
class Library:
    """A shared library that holds the core: the library of a component, or the core's own (None)."""

    component: ComponentDescription | None

    @cached_property
    def sources(self) -> tuple[Path, ...]:
        """C files of the library."""
        core = sorted((NATIVE / "core").rglob("*.c"))
        one = self.component
        if one is None:
            return tuple(core)
        others = sorted(path for folder in beside_core(one, NATIVE) for path in folder.rglob("*.c"))
        return (*(path for path in core if is_part(one, path.relative_to(NATIVE / "core"))), *others)

    @cached_property
    def name(self) -> str:
        """Name of the library without the suffix."""
        return CORE_LIBRARY if self.component is None else self.component.name

    def command(self, native: Path) -> list[str]:
        """Return the command that compiles one of its files, in a folder of C sources."""
        options = [*find_compiler(), *LANGUAGE, "-w", "-fPIC", "-I", str(native / "core")]
        if (one := self.component) is None:
            return options
        folders = (*beside_core(one, native), _generated(one), fmi_headers())
        options += ["-fvisibility=hidden", *(f"-D{name}={value}" for name, value in sizes(one).items())]
        return [*options, *(f"-I{folder}" for folder in folders)]

    def object_of(self, source: Path) -> Path:
        """Return the unpatched object of one of its files; made once."""
        key = digest(
            _headers(), content_of([source]), *self.command(NATIVE), compiler_identity(find_compiler())
        )
        return kept(
            f"{source.stem}.o", key, lambda path: _run(*self.command(NATIVE), "-c", source, "-o", path), KEPT
        )


@cache
def libraries() -> tuple[Library, ...]:
    """Return all libraries that hold the core."""
    return (Library(None), *map(Library, read_components()))


@cache
def _headers() -> str:
    return content_of([*NATIVE.rglob("*.h"), *NATIVE.rglob("*.toml")])


def _generated(component: ComponentDescription) -> Path:
    text = c_header(component)
    folder = KEPT / f"{digest(text)[:24]}-{component.name}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / header_name(component)).write_text(text, encoding="utf-8")
    return folder


def _run(*command: str | Path) -> None:
    done = subprocess.run([*map(str, command)], capture_output=True, text=True)
    if done.returncode != 0:
        raise DoesNotCompile(done.stderr[-500:])


def copy_with(fault: Fault | None, folder: Path) -> Path:
    """Make a copy of the package with a fault in it; return the folder for Python's path.

    Raises
    ------
    DoesNotCompile
    """
    native = folder / "native"
    shutil.copytree(NATIVE, native)
    built = folder / "path" / "vibroimpact" / "fmus" / "built"
    _link_package(built)
    shutil.copytree(BUILT, built)
    if fault is None:
        return folder / "path"
    text = (NATIVE / fault.file).read_text(encoding="utf-8")
    (native / fault.file).write_text(fault.patched(text), encoding="utf-8")
    changed = set(_including(NATIVE / fault.file))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for library in libraries():
            if changed & set(library.sources):
                _link(library, changed, native, built, pool)
    return folder / "path"


def _link(library: Library, changed: set[Path], native: Path, built: Path, pool: ThreadPoolExecutor) -> None:
    def object_of(source: Path) -> Path:
        if source not in changed:
            return library.object_of(source)
        made = native / f"{library.name}-{source.stem}.o"
        _run(*library.command(native), "-c", native / source.relative_to(NATIVE), "-o", made)
        return made

    target = native / f"{library.name}{library_suffix()}"
    _run(*find_compiler(), "-shared", "-o", target, *pool.map(object_of, library.sources), "-lm")
    if (one := library.component) is None:
        shutil.copyfile(target, built / target.name)
        return
    for version, place in FOLDERS.items():
        members = {
            "modelDescription.xml": model_description(one, version).encode("utf-8"),
            f"binaries/{binary_folder(version)}/{target.name}": target.read_bytes(),
            **documentation(one),
        }
        write_fmu(built / place / f"{one.name}.fmu", members)


def _including(file: Path) -> Iterator[Path]:
    """Yield a C file, or all C files that include a header."""
    if file.suffix == ".c":
        yield file
        return
    for path in sorted(NATIVE.rglob("*.[ch]")):
        if path != file and re.search(rf'#include "(?:\w+/)*{file.name}"', path.read_text(encoding="utf-8")):
            yield from _including(path)


def _link_package(built: Path) -> None:
    """Make a package of links to this one, with another folder of built libraries."""
    own = built.parent
    own.mkdir(parents=True)
    for place, links in ((own.parent, PACKAGE), (own, PACKAGE / "fmus")):
        for path in links.iterdir():
            if path.name not in {"fmus", "built", "__pycache__"}:
                (place / path.name).symlink_to(path.resolve())
