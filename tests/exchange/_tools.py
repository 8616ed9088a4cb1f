"""The tools: whether each is there, which version, and what it makes of an FMU, in a process of its own."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

LIMIT = 120.0
"""How long a tool may take for a run, s."""

DRIVER = Path(__file__).with_name("_drive.py")


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool that runs FMUs, driven by a function of `_drive`.

    Attributes
    ----------
    package, program : str
        What must be installed, or be found on PATH or named by the variable `VIBROIMPACT_` + its name in capitals.
    versions : tuple of str
        The versions of FMI that it speaks.
    """

    name: str
    versions: tuple[str, ...]
    package: str = ""
    program: str = ""

    def missing(self) -> str:
        """Return why it cannot be tried here, empty where it can."""
        if self.package and importlib.util.find_spec(self.package) is None:
            return f"the package {self.package} is not installed"
        if self.program and self.path() is None:
            return f"{self.program} is not on PATH, nor named by {self.variable}"
        return ""

    @property
    def variable(self) -> str:
        """Name of the variable that says where its program is."""
        return f"VIBROIMPACT_{self.program.upper()}"

    def path(self) -> str | None:
        """Return where its program is."""
        return os.environ.get(self.variable) or shutil.which(self.program)

    def shown(self) -> str:
        """Return its name with the version of its package."""
        return f"{self.name} ({self.package} {metadata.version(self.package)})" if self.package else self.name


TOOLS = (
    Tool("FMPy", ("2.0", "3.0"), package="fmpy"),
    # libcosim 0.11 speaks FMI 3.0 not at all, and ends with a segmentation fault when it is given such an FMU
    Tool("libcosim", ("2.0",), package="libcosimpy"),
    Tool("Ecos", ("2.0", "3.0"), package="ecospy"),
    Tool("fmusim", ("2.0", "3.0"), program="fmusim"),
    Tool("OMSimulator", ("2.0", "3.0"), program="OMSimulator"),
)


class ToolFailedError(Exception):
    """A tool gave no values; the text has its last words."""


def values(
    tool: Tool, fmu: Path, names: Sequence[str], step: float, count: int, folder: Path
) -> list[list[float]]:
    """Return what a tool makes of an FMU that nobody sets anything for.

    Parameters
    ----------
    tool : Tool
    fmu : Path
    names : sequence of str
        Outputs.
    step : float
        Communication step, s: a whole number of nanoseconds, in which libcosim counts.
    count : int
        Steps.
    folder : Path
        Where files may be written.

    Returns
    -------
    list of list of float, shape (count, len(names))
        After each step.
    """
    asked = {"tool": tool.name, "program": tool.path() if tool.program else "", "fmu": str(fmu)}
    asked |= {"names": list(names), "step": step, "count": count, "answer": str(folder / "answer.json")}
    command = [sys.executable, str(DRIVER), json.dumps(asked)]
    answer = folder / "answer.json"
    answer.unlink(missing_ok=True)
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=folder)
    if not answer.is_file():
        raise ToolFailedError(
            f"{tool.name} ended with {done.returncode}: {(done.stderr or done.stdout)[-500:]}"
        )
    found: list[list[float]] = json.loads(answer.read_text())
    return found
