"""FMI's names of this machine, and of the platforms that FMUs can be made for."""

from __future__ import annotations

import platform
import sys
from dataclasses import dataclass

from vibroimpact.fmus.errors import ComponentFileError

ARCHITECTURES = {
    "x86_64": "x86_64",
    "amd64": "x86_64",
    "aarch64": "aarch64",
    "arm64": "aarch64",
    "i386": "x86",
    "i686": "x86",
    "x86": "x86",
}
SYSTEMS = {"linux": "linux", "darwin": "darwin", "win32": "windows"}
SUFFIXES = {"linux": ".so", "darwin": ".dylib", "windows": ".dll"}
TARGETS = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
    "x86_64-darwin": "x86_64-macos",
    "aarch64-darwin": "aarch64-macos",
}
"""Zig's names of the platforms that an export can be made for, by FMI 3.0's names; glibc 2.17 is of 2012."""
FMI2_SYSTEMS = {"linux": "linux", "darwin": "darwin", "windows": "win"}


@dataclass(frozen=True, slots=True)
class Platform:
    """A platform that an FMU can be made for, by its name in FMI 3.0: `x86_64-windows`."""

    name: str

    @property
    def system(self) -> str:
        """Operating system: `linux`, `darwin` or `windows`."""
        return self.name.rpartition("-")[2]

    @property
    def suffix(self) -> str:
        """Extension of a shared library: `.so`, `.dylib` or `.dll`."""
        return SUFFIXES[self.system]

    @property
    def target(self) -> str:
        """Zig's name of the platform."""
        return TARGETS[self.name]

    def folder(self, fmi_version: str) -> str:
        """Return the folder in `binaries/`; FMI 2.0 names ARM only on macOS, where one file may serve both kinds."""
        if fmi_version.startswith("3") or (self.name.startswith("aarch64") and self.system != "darwin"):
            return self.name
        return f"{FMI2_SYSTEMS[self.system]}64"


def this_platform() -> Platform:
    """Return the platform of this Python."""
    return Platform(f"{architecture()}-{system()}")


def system() -> str:
    """Return the operating system: `linux`, `darwin` or `windows`."""
    if sys.platform not in SYSTEMS:
        raise ComponentFileError(f"platform: expected one of {', '.join(SYSTEMS)}, got {sys.platform}.")
    return SYSTEMS[sys.platform]


def architecture() -> str:
    """Return the architecture of this Python, which may be 32-bit on a 64-bit machine: `x86_64`, `aarch64` or `x86`."""
    machine = platform.machine().lower()
    if machine not in ARCHITECTURES:
        raise ComponentFileError(f"platform: expected one of {', '.join(ARCHITECTURES)}, got {machine}.")
    name = ARCHITECTURES[machine]
    return "x86" if name == "x86_64" and sys.maxsize < 2**32 else name


def library_suffix() -> str:
    """Return the extension of a shared library: `.so`, `.dylib` or `.dll`."""
    return SUFFIXES[system()]


def binary_folder(fmi_version: str) -> str:
    """Return the folder in `binaries/` for this machine: `x86_64-linux` (FMI 3.0), `linux64` (FMI 2.0)."""
    if fmi_version.startswith("3"):
        return f"{architecture()}-{system()}"
    return FMI2_SYSTEMS[system()] + ("32" if architecture() == "x86" else "64")
