"""How FMI names the machine this Python runs on."""

from __future__ import annotations

import platform
import sys

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
FMI2_SYSTEMS = {"linux": "linux", "darwin": "darwin", "windows": "win"}


def system() -> str:
    """Return `linux`, `darwin` or `windows`."""
    if sys.platform not in SYSTEMS:
        raise ComponentFileError(f"platform: expected one of {', '.join(SYSTEMS)}, got {sys.platform}.")
    return SYSTEMS[sys.platform]


def architecture() -> str:
    """Return `x86_64`, `aarch64` or `x86`: of this Python, which may be a 32-bit one on a 64-bit machine."""
    machine = platform.machine().lower()
    if machine not in ARCHITECTURES:
        raise ComponentFileError(f"platform: expected one of {', '.join(ARCHITECTURES)}, got {machine}.")
    name = ARCHITECTURES[machine]
    return "x86" if name == "x86_64" and sys.maxsize < 2**32 else name


def library_suffix() -> str:
    """Return `.so`, `.dylib` or `.dll`."""
    return SUFFIXES[system()]


def binary_folder(fmi_version: str) -> str:
    """Return the folder in `binaries/` for this machine: `x86_64-linux` (FMI 3.0), `linux64` (FMI 2.0)."""
    if fmi_version.startswith("3"):
        return f"{architecture()}-{system()}"
    return FMI2_SYSTEMS[system()] + ("32" if architecture() == "x86" else "64")
