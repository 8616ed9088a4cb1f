"""Libraries for other machines, run by a program compiled for each: directly, or by wine and qemu-user."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np

from exchange._cases import Rows
from exchange._single import described
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.fmus.packaging.archive import UnpackedFmu, unpack
from vibroimpact.fmus.packaging.build import fmi_headers
from vibroimpact.fmus.packaging.compiler import LANGUAGE, WARNINGS, find_compiler, zig_compiler
from vibroimpact.fmus.packaging.platform_names import TARGETS, Platform, this_platform

SOURCE = Path(__file__).with_name("_host.c")
LIMIT = 300.0
"""Time limit for a run, s: the first run of wine creates its folder."""

LIBRARIES = "QEMU_LD_PREFIX"
"""Variable of qemu-user with the place of a machine's C library; Debian installs them below /usr."""


class HostFailedError(Exception):
    """The program printed no values; the text has its last output."""


@dataclass(frozen=True, slots=True)
class Machine:
    """A target machine of FMUs, and the emulator of its programs.

    Attributes
    ----------
    platform : Platform
    runner : str
        Emulator of the machine; empty if this machine can run its programs.
    """

    platform: Platform
    runner: str = ""

    def missing(self) -> str:
        """Return the reason why its libraries cannot be run here, empty if they can."""
        if not self.runner:
            return "" if self.platform == this_platform() else f"this is no {self.platform.name}"
        if shutil.which(self.runner) is None:
            return f"{self.runner} is not on PATH"
        try:
            zig_compiler()
        except ComponentError as error:
            return str(error).rstrip(".")
        if self.platform.system == "linux" and not self._libraries().is_dir():
            return f"{self._libraries()} has no C library of {self.platform.name}, and {LIBRARIES} names none"
        return ""

    @property
    def export_platform(self) -> str | None:
        """Platform of the export; None, for the library built on this machine, if zig is not installed."""
        return self.platform.name if self.runner or importlib.util.find_spec("ziglang") else None

    def shown(self) -> str:
        """Return its name with its emulator."""
        if not self.runner:
            return self.platform.name
        text = subprocess.run([self.runner, "--version"], capture_output=True, text=True).stdout
        version = re.search(r"\d+\.[\d.]*\d", text)
        return f"{self.platform.name} ({self.runner} {version[0] if version else ''})"

    def _libraries(self) -> Path:
        processor = self.platform.name.partition("-")[0]
        return Path(os.environ.get(LIBRARIES) or f"/usr/{processor}-linux-gnu")

    def host(self, folder: Path) -> Path:
        """Compile the program that runs an FMU's library, and return it."""
        program = folder / f"host-{self.platform.name}{'.exe' if self.platform.system == 'windows' else ''}"
        compiler = (*zig_compiler(), "-target", self.platform.target) if self.runner else find_compiler()
        options = [*LANGUAGE, *WARNINGS, "-Werror", f"-I{fmi_headers()}", "-o", str(program), str(SOURCE)]
        options += [] if self.platform.system == "windows" else ["-ldl"]
        done = subprocess.run([*compiler, *options], capture_output=True, text=True)
        if done.returncode:
            raise HostFailedError(f"{SOURCE.name} for {self.platform.name}: {done.stderr.strip()}")
        return program

    def run(self, host: Path, fmu: Path, names: Sequence[str], step: float, count: int) -> Rows:
        """Return the outputs of an FMU after each step, shape (count, len(names))."""
        unpacked = unpack(fmu)
        references = {name: f"{kind[0]}{number}" for name, (number, kind) in described(str(fmu)).items()}
        given = [unpacked.fmi_version[0], *self._places(unpacked), repr(step), str(count)]
        command = [
            *([self.runner] if self.runner else []),
            str(host),
            *given,
            *(references[n] for n in names),
        ]
        environment = self._environment(host)
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, env=environment)
        if done.returncode:
            raise HostFailedError(
                f"{self.shown()} ended with {done.returncode}: {done.stderr.strip()[-500:]}"
            )
        return np.array([[float(number) for number in line.split()] for line in done.stdout.splitlines()])

    def end(self, host: Path) -> None:
        """End the processes that the emulator leaves behind: wine's server, which keeps the folder in use."""
        if self.runner and self.platform.system == "windows" and (server := shutil.which("wineserver")):
            subprocess.run([server, "-k"], env=self._environment(host), timeout=LIMIT)

    def _environment(self, host: Path) -> dict[str, str]:
        if self.runner and self.platform.system == "windows":
            return os.environ | {"WINEPREFIX": str(host.parent / "wine"), "WINEDEBUG": "-all"}
        return os.environ | ({LIBRARIES: str(self._libraries())} if self.runner else {})

    def _places(self, fmu: UnpackedFmu) -> tuple[str, str, str]:
        """Return library, token and resources in the form that the program takes."""
        # wine shows this machine's files as files of a drive
        drive = "Z:" if self.runner and self.platform.system == "windows" else ""
        name = f"{fmu.identifiers[0]}{self.platform.suffix}"
        library = fmu.folder / "binaries" / self.platform.folder(fmu.fmi_version) / name
        resources = f"{drive}{fmu.resources.as_posix()}/"
        if fmu.fmi_version.startswith("2"):
            resources = f"file:///{quote(resources.lstrip('/'), safe='/:')}"
        return f"{drive}{library.as_posix()}", fmu.token, resources


RUNNERS = {"x86_64-windows": "wine", "aarch64-linux": "qemu-aarch64", "x86_64-linux": "qemu-x86_64"}
MACHINES = tuple(
    Machine(Platform(name), "" if Platform(name) == this_platform() else RUNNERS.get(name, ""))
    for name in TARGETS
)
