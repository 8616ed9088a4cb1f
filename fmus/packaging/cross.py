"""Libraries of the components for other machines: shipped with a release, kept in a cache, or compiled by zig."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata, util
from pathlib import Path

from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.packaging.build import BUILT, PLATFORMS_FOLDER, compile_component, fingerprint
from vibroimpact.fmus.packaging.compiler import zig_compiler
from vibroimpact.fmus.packaging.description import ComponentDescription
from vibroimpact.fmus.packaging.platform_names import TARGETS, Platform
from vibroimpact.fmus.private_folder import UnsafeFolderError, private_folder

SHIPPED = BUILT / PLATFORMS_FOLDER
Note = Callable[[str], None]


def chosen_platforms(names: str) -> tuple[Platform, ...]:
    """Return the platforms named by `all`, or by names with commas between them.

    Raise UsageError for a name that is unknown to FMI, or that nothing can be compiled for.
    """
    chosen = list(TARGETS) if names.strip() == "all" else [name.strip() for name in names.split(",")]
    unknown = [name for name in chosen if name not in TARGETS]
    if unknown:
        raise UsageError(f"platform: expected all, or some of {', '.join(TARGETS)}, got {unknown[0]!r}.")
    return tuple(Platform(name) for name in dict.fromkeys(chosen))


def library_for(component: ComponentDescription, platform: Platform, note: Note = lambda _: None) -> bytes:
    """Return a component's library for a platform; the component must be as compiled, not as edited for an export.

    `note` gets a line about each compilation. It takes seconds, for Windows minutes the first time. Raise
    ComponentError for a library that is absent and cannot be compiled.
    """
    name = f"{component.name}{platform.suffix}"
    shipped = SHIPPED / platform.name / name
    if shipped.is_file():
        return shipped.read_bytes()
    kept = _kept(platform) / name
    if kept.is_file():
        return kept.read_bytes()
    zig_compiler()
    note(f"{platform.name}: compiling {component.name}")
    library = compile_component(component, strict=False, platform=platform)
    temporary = kept.with_name(f".{name}.new")
    temporary.write_bytes(library)
    temporary.replace(kept)
    return library


def members_for(
    components_library: Callable[[Platform], bytes], name: str, platforms: Iterable[Platform], fmi: str
) -> dict[str, bytes]:
    """Return the members of an FMU that hold its binaries, named by the model identifier.

    FMI `2.0` has one folder for both processors of macOS, whose file holds both libraries; FMI `3.0` has two folders.
    """
    members: dict[str, dict[Platform, bytes]] = {}
    for platform in platforms:
        place = f"binaries/{platform.folder(fmi)}/{name}{platform.suffix}"
        members.setdefault(place, {})[platform] = components_library(platform)
    return {place: universal(libraries) for place, libraries in members.items()}


def universal(libraries: Mapping[Platform, bytes]) -> bytes:
    """Return one library for several processors of macOS, as one Mach-O file; a single library as it is."""
    if len(libraries) == 1:
        return next(iter(libraries.values()))
    header, body = struct.pack(">II", 0xCAFEBABE, len(libraries)), bytearray(1 << _ALIGNMENT)
    for platform, library in libraries.items():
        processor = platform.name.partition("-")[0]
        offset = len(body)
        header += struct.pack(">5I", *_MACH_PROCESSORS[processor], offset, len(library), _ALIGNMENT)
        body += library + bytes(-len(library) % (1 << _ALIGNMENT))
    body[: len(header)] = header
    return bytes(body)


#: Type and subtype of a processor in Mach-O.
_MACH_PROCESSORS = {"x86_64": (0x01000007, 3), "aarch64": (0x0100000C, 0)}
_ALIGNMENT = 14


def _kept(platform: Platform) -> Path:
    """Return the cache folder of libraries for a platform, by these sources and this compiler."""
    compiler = metadata.version("ziglang") if util.find_spec("ziglang") else "none"
    try:
        folder = private_folder("libraries") / f"{fingerprint()[:16]}-zig-{compiler}" / platform.name
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except (OSError, UnsafeFolderError) as error:
        raise ComponentError(
            f"cache of libraries: expected a folder that can be written, got: {error}"
        ) from error
    return folder
