"""Build every component into FMUs for this machine: `python -m vibroimpact.fmus.packaging.build`.

Each folder of `native/` with a `variables.toml` is a component. Its library holds the shared core, both FMI
adapters and its own C files; FMI's headers come from the FMPy package. This module imports the standard library only
(FMPy is located, not imported), since it also runs while the package itself is being built.
"""

from __future__ import annotations

import argparse
import hashlib
import html
import importlib.util
import os
import shutil
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from vibroimpact.fmus.errors import ComponentError, VibroimpactError
from vibroimpact.fmus.packaging.compiler import ACROSS_FILES, LANGUAGE, WARNINGS, compile_library
from vibroimpact.fmus.packaging.description import (
    ComponentDescription,
    c_header,
    header_name,
    model_description,
    read_component,
    with_table,
)
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.platform_names import TARGETS, Platform, binary_folder, library_suffix
from vibroimpact.fmus.shipped import FOLDERS

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parent
NATIVE = PACKAGE / "native"
BUILT = PACKAGE / "built"
CORE_LIBRARY = "libvibroimpact_core"
#: Folder of a release with the libraries of all platforms, each in a folder named by its platform.
PLATFORMS_FOLDER = "platforms"
#: Smallest length of an array in the sizes: gcc warns of loops over further elements of a shorter one.
SMALLEST_ARRAY = 2
#: Name of the file with the hash of the sources that the folder was built from.
FINGERPRINT = "sources.sha256"


def read_components(native: Path = NATIVE) -> tuple[ComponentDescription, ...]:
    """Return every component of a folder of C sources, in the order of the folders' names."""
    return tuple(read_component(path) for path in sorted(native.glob("*/variables.toml")))


def build(output: Path = BUILT, *, native: Path = NATIVE, strict: bool = True) -> tuple[Path, ...]:
    """Compile all components and the core library for this machine.

    Parameters
    ----------
    output : Path
        Folder to fill: `fmi3/*.fmu`, `fmi2/*.fmu`, the core library, the fingerprint of the sources.
    native : Path
        Folder of the C sources.
    strict : bool
        Whether compiler warnings are errors.

    Returns
    -------
    tuple of Path
        The written files.

    Raises
    ------
    ComponentError
        No compiler works, or one found an error.
    """
    output.mkdir(parents=True, exist_ok=True)
    (output / FINGERPRINT).unlink(missing_ok=True)
    components = read_components(native)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        core = pool.submit(_build_core, output, native, strict)
        binaries = pool.map(lambda component: compile_component(component, native, strict=strict), components)
        written = [core.result()]
        for component, binary in zip(components, binaries, strict=True):
            written += _write_versions(component, binary, output)
    (output / FINGERPRINT).write_text(fingerprint(native) + "\n", encoding="ascii")
    return (*written, output / FINGERPRINT)


def build_platforms(output: Path, *, native: Path = NATIVE) -> tuple[Path, ...]:
    """Compile the libraries of all components for every platform, into `PLATFORMS_FOLDER`; takes minutes.

    Raise ComponentError without the ziglang package, or if it finds an error.
    """

    def compiled(pair: tuple[ComponentDescription, Platform]) -> Path:
        component, platform = pair
        path = output / PLATFORMS_FOLDER / platform.name / f"{component.name}{platform.suffix}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(compile_component(component, native, platform=platform))
        print(path, file=sys.stderr, flush=True)
        return path

    pairs = [(component, Platform(name)) for name in TARGETS for component in read_components(native)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return tuple(pool.map(compiled, pairs))


def is_current(output: Path = BUILT, *, native: Path = NATIVE) -> bool:
    """Return whether a folder holds the results of `build` for the present sources."""
    stamp = output / FINGERPRINT
    return stamp.is_file() and stamp.read_text(encoding="ascii").strip() == fingerprint(native)


def fingerprint(native: Path = NATIVE) -> str:
    """Return the SHA-256 of everything that an FMU is made from, except the compiler."""
    digest = hashlib.sha256(repr((LANGUAGE, WARNINGS, ACROSS_FILES, sys.platform)).encode())
    sources = [p for p in native.rglob("*") if p.suffix in {".c", ".h", ".toml", ".md"}]
    builders = [*(HERE / "description").glob("*.py"), HERE / "build.py"]
    # by places inside the folders: the fingerprint depends on these, not on the place of the folders
    for folder, paths in ((native, sources), (HERE, builders)):
        for place, path in sorted((path.relative_to(folder).as_posix(), path) for path in paths):
            digest.update(place.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def update_readmes(native: Path = NATIVE, *, write: bool = True) -> tuple[Path, ...]:
    """Update the table of variables in each component's README; return the READMEs that were out of date."""
    stale = []
    for component in read_components(native):
        path = _readme(component)
        if not path.is_file():
            continue
        text = path.read_text(encoding="utf-8")
        renewed = with_table(text, component)
        if renewed != text:
            stale.append(path)
            if write:
                path.write_text(renewed, encoding="utf-8")
    return tuple(stale)


def fmi_headers() -> Path:
    """Return the folder of FMI's C headers in the FMPy package."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise ComponentError(
            "build: expected the package FMPy for FMI's headers, got none. Run `pip install fmpy`."
        )
    return Path(spec.origin).parent / "c-code"


def _build_core(output: Path, native: Path, strict: bool) -> Path:
    target = output / f"{CORE_LIBRARY}{library_suffix()}"
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder, target.name)
        compile_library(library, _c_files(native / "core"), [native / "core"], export_all=True, strict=strict)
        _replace(library, target)
    return target


def compile_component(
    component: ComponentDescription,
    native: Path = NATIVE,
    *,
    strict: bool = True,
    platform: Platform | None = None,
) -> bytes:
    """Return a component's shared library, for this machine or another platform.

    Raise ComponentError if no compiler works, or it finds an error.
    """
    core, folders = native / "core", beside_core(component, native)
    sources = [path for path in _c_files(core) if is_part(component, path.relative_to(core))]
    sources += [path for folder in folders for path in _c_files(folder)]
    with tempfile.TemporaryDirectory() as folder:
        generated = Path(folder)
        (generated / header_name(component)).write_text(c_header(component), encoding="utf-8")
        library = generated / f"{component.name}{library_suffix() if platform is None else platform.suffix}"
        include, defined = [core, *folders, generated, fmi_headers()], sizes(component)
        compile_library(
            library,
            sources,
            include,
            definitions=defined,
            # calls are most of the cost of an impact of one mode, and of what a body can have but has not
            across_files=defined["VI_ONLY_MODES"] == 1 or defined["VI_SINES"] > 0,
            level="-O3" if defined["VI_ONLY_MODES"] == 1 else None,
            strict=strict,
            platform=platform,
        )
        return library.read_bytes()


def beside_core(component: ComponentDescription, native: Path = NATIVE) -> tuple[Path, ...]:
    """Return the folders of a component's C sources outside of the core: the shared folders, then its own."""
    is_body = component.repeats.get("contact", 0) > 0
    return (native / "adapters", *([native / "bodies"] if is_body else ()), native / component.folder)


def is_part(component: ComponentDescription, file: Path) -> bool:
    """Return whether a component includes a file of the core; functions for ctypes are in the core library alone."""
    return file.parts[0] not in {"door", "lanes"} and component.uses(file.as_posix())


def _write_versions(component: ComponentDescription, binary: bytes, output: Path) -> list[Path]:
    return [
        _write_component(component, binary, output / folder, version) for version, folder in FOLDERS.items()
    ]


def sizes(component: ComponentDescription) -> dict[str, int]:
    """Return the sizes that a component is compiled for, as sizes.h names them.

    Saved states do not contain parts that the component has no use for.
    """
    blocks = component.repeats
    modes = blocks.get("mode", blocks.get("mass"))
    largest = {"VI_MODES": modes or 0, "VI_PORTS": blocks.get("contact", 0)}
    arrays = {name: max(size, SMALLEST_ARRAY) for name, size in largest.items()}
    # the constants remove loops over modes from a body with only one, and loads and motions from bodies without
    constants = {f"VI_{block.upper()}S": blocks.get(block, 0) for block in ("sine", "signal")}
    constants["VI_ONLY_MODES"] = 0 if modes is not None else 1
    constants["VI_GROWING"] = int(component.growing)
    constants["VI_STOPS_MOVE"] = int(any(v.name.startswith("stop[") for v in component.variables))
    return {**arrays, **constants, "VI_DEGREE": component.degree}


def _write_component(component: ComponentDescription, binary: bytes, folder: Path, version: str) -> Path:
    members = {
        "modelDescription.xml": model_description(component, version).encode("utf-8"),
        f"binaries/{binary_folder(version)}/{component.name}{library_suffix()}": binary,
        **documentation(component),
    }
    path = folder / f"{component.name}.fmu"
    write_fmu(path, members)
    return path


def documentation(component: ComponentDescription) -> dict[str, bytes]:
    """Return the members of an FMU that a person reads: the component's description with its table of variables."""
    path = _readme(component)
    has_readme = path.is_file()
    text = with_table(path.read_text(encoding="utf-8"), component) if has_readme else component.description
    title, body = html.escape(component.name), html.escape(text)
    page = f'<!DOCTYPE html>\n<meta charset="utf-8">\n<title>{title}</title>\n<pre>\n{body}</pre>\n'
    return {
        "documentation/README.md": text.encode("utf-8"),
        "documentation/index.html": page.encode("utf-8"),
        "documentation/licenses/license.txt": _licence(),
    }


def _readme(component: ComponentDescription) -> Path:
    return component.source.with_name("README.md")


def _licence() -> bytes:
    # next to the sources in a checkout, inside the package when installed
    places = (PACKAGE.parent / "LICENSE", PACKAGE / "LICENSE")
    return next(path for path in places if path.is_file()).read_bytes()


def _c_files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.c"))


def _replace(source: Path, target: Path) -> None:
    # a running process may have loaded the old library: write a new file, never overwrite
    temporary = target.with_name(f".{target.name}.new")
    shutil.copyfile(source, temporary)
    temporary.replace(target)


def main(arguments: Sequence[str] | None = None) -> int:
    """Build from the command line; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m vibroimpact.fmus.packaging.build", description=__doc__)
    parser.add_argument("--output", type=Path, default=BUILT, help="folder to fill (default: %(default)s)")
    parser.add_argument(
        "--check", action="store_true", help="build nothing; exit 1 if something is out of date"
    )
    options = parser.parse_args(arguments)
    try:
        if options.check:
            return _check(options.output)
        for path in (*update_readmes(), *build(options.output)):
            print(path)
    except VibroimpactError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


def _check(output: Path) -> int:
    stale = [str(path) for path in update_readmes(write=False)]
    if not is_current(output):
        stale.append(str(output))
    for path in stale:
        print(f"{path}: out of date. Run `python -m vibroimpact.fmus.packaging.build`.", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
