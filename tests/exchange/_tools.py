"""The tools: whether each is there, which version, and what it makes of FMUs, in a process of its own."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from support.places import ROOT

LIMIT = 120.0
"""How long a tool may take for a run, s."""

WARNING = re.compile(r"\bwarn(ing)?\b(?!\(s\))|\berror\b(?!\(s\))", re.IGNORECASE)
"""A line in which a tool, or an FMU through it, complains: not one that counts complaints, `0 Warning(s)`."""

COUNTS = re.compile(r"\b0 (warnings|errors)\b|warning\(s\) and error\(s\)", re.IGNORECASE)
OF_ITSELF = re.compile(r"FMI3 support is experimental")
"""What PyFMI says of itself, whatever the FMU."""

Rows = list[list[float]]


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool that runs FMUs, driven by a function of `_single`, and of `_couple` where it couples them.

    Attributes
    ----------
    package, program : str
        What must be installed, or be found on PATH. The variable `VIBROIMPACT_` + its name in capitals names a Python
        that has the package, or the program.
    versions : tuple of str
        The versions of FMI that it speaks.
    couples : tuple of str
        The versions of FMI of which it couples FMUs.
    without_integers : tuple of str
        The versions of FMI whose integers it cannot read: Ecos has half of the room for those of FMI 3.0, and ends.
    exchanges_first : bool
        Whether it exchanges the values of a step before it writes the row of the step's end.
    """

    name: str
    versions: tuple[str, ...]
    package: str = ""
    program: str = ""
    couples: tuple[str, ...] = ()
    without_integers: tuple[str, ...] = ()
    exchanges_first: bool = False

    def missing(self) -> str:
        """Return why it cannot be tried here, empty where it can."""
        named = os.environ.get(self.variable)
        if named and shutil.which(named) is None:
            return f"{self.variable} names {named}, which is no program"
        if self.package and not self._version_of_package():
            where = f"{named}, which {self.variable} names" if named else "this Python"
            return f"the package {self.package} is not installed in {where}"
        if self.program and self.path() is None:
            return f"{self.program} is not on PATH, nor named by {self.variable}"
        return ""

    @property
    def variable(self) -> str:
        """Name of the variable that says where it is."""
        return "VIBROIMPACT_" + (self.package or self.program).partition(".")[0].upper()

    def path(self) -> str | None:
        """Return where its program is."""
        return shutil.which(os.environ.get(self.variable) or self.program)

    @property
    def python(self) -> str:
        """The Python that its driver runs in."""
        return (os.environ.get(self.variable) if self.package else None) or sys.executable

    def shown(self) -> str:
        """Return its name with its version."""
        version = (
            f"{self.package} {self._version_of_package()}" if self.package else self._version_of_program()
        )
        return f"{self.name} ({version})" if version else self.name

    def _version_of_package(self) -> str:
        code = (
            "import sys, importlib.util, importlib.metadata as m\n"
            "there = importlib.util.find_spec(sys.argv[1])\n"
            "print(m.version(sys.argv[1]) if there else '')"
        )
        return _said_by([self.python, "-c", code, self.package]).strip()

    def _version_of_program(self) -> str:
        found = re.search(r"v?(\d+\.\d[\w.]*)", _said_by([str(self.path()), "--version"]))
        return found[1] if found else ""


def _said_by(command: Sequence[str]) -> str:
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT).stdout


TOOLS = (
    Tool("FMPy", ("2.0", "3.0"), package="fmpy", couples=("2.0",)),
    # libcosim 0.11 speaks FMI 3.0 not at all, and ends with a segmentation fault when it is given such an FMU
    Tool("libcosim", ("2.0",), package="libcosimpy", couples=("2.0",)),
    Tool(
        "Ecos",
        ("2.0", "3.0"),
        package="ecospy",
        couples=("2.0", "3.0"),
        without_integers=("3.0",),
        exchanges_first=True,
    ),
    Tool("PyFMI", ("2.0",), package="pyfmi", couples=("2.0",), exchanges_first=True),
    Tool("fmusim", ("2.0", "3.0"), program="fmusim"),
    Tool(
        "OMSimulator",
        ("2.0", "3.0"),
        program="OMSimulator",
        couples=("2.0", "3.0"),
        exchanges_first=True,
    ),
    Tool("FMU Compliance Checker", ("2.0",), program="fmuCheck.linux64"),
)


CASADI = Tool("CasADi", (), package="casadi")
"""It integrates and differentiates FMUs for model exchange, and steps none."""


class ToolFailedError(Exception):
    """A tool gave no values; the text has its last words."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a tool made of FMUs that nobody sets anything for.

    Attributes
    ----------
    rows : list of list of float
        The outputs after each step.
    complaints : tuple of str
        Lines of warnings and errors that it wrote.
    """

    rows: Rows
    complaints: tuple[str, ...]


def run(tool: Tool, fmu: Path, names: Sequence[str], step: float, count: int, folder: Path) -> Answer:
    """Return what a tool makes of an FMU.

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

    Raises
    ------
    ToolFailedError
        It gave no values.
    """
    return _asked(tool, {"fmu": str(fmu), "names": list(names), "step": step, "count": count}, folder)


def run_integrated(
    tool: Tool, fmu: Path, names: Sequence[str], step: float, count: int, folder: Path, tolerance: float
) -> Answer:
    """Return what a tool makes of an FMU for model exchange that it integrates, at a relative tolerance."""
    asked = {"fmu": str(fmu), "names": list(names), "step": step, "count": count, "tolerance": tolerance}
    return _asked(tool, asked, folder)


def steps_of(tool: Tool, fmu: Path, folder: Path, stop_time: float, tolerance: float) -> int:
    """Return how many steps the integrator of a tool takes to an instant, s, at a relative tolerance.

    Raises
    ------
    ToolFailedError
        It gave no number, or warned.
    """
    answer = _asked(tool, {"fmu": str(fmu), "stop_time": stop_time, "tolerance": tolerance}, folder)
    if answer.complaints:
        raise ToolFailedError("\n".join(answer.complaints))
    return round(answer.rows[0][0])


def run_coupled(
    tool: Tool,
    fmus: Mapping[str, Path],
    connections: Iterable[tuple[str, str]],
    names: Sequence[str],
    step: float,
    count: int,
    folder: Path,
) -> Answer:
    """Return what a tool makes of FMUs that it couples: `names` and `connections` are of `component.variable`."""
    asked = {"fmus": {name: str(path) for name, path in fmus.items()}, "connections": list(connections)}
    return _asked(tool, {**asked, "names": list(names), "step": step, "count": count}, folder)


def run_system(
    tool: Tool, system: Path, names: Sequence[str], step: float, count: int, folder: Path
) -> Answer:
    """Return what a tool makes of a system (SSP), with the step that it proposes; `names` are `component.variable`."""
    with zipfile.ZipFile(system) as archive:
        inside = [name for name in archive.namelist() if name.endswith(".fmu")]
        fmus = {Path(name).stem: archive.extract(name, folder) for name in inside}
        description = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    asked = {"system": str(system), "model": description.get("name"), "fmus": fmus}
    return _asked(tool, {**asked, "names": list(names), "step": step, "count": count}, folder)


def _asked(tool: Tool, request: Mapping[str, Any], folder: Path) -> Answer:
    answer = folder / "answer.json"
    answer.unlink(missing_ok=True)
    asked = {
        **request,
        "tool": tool.name,
        "program": tool.path() if tool.program else "",
        "answer": str(answer),
    }
    done = subprocess.run(
        [tool.python, "-m", "exchange._drive", json.dumps(asked)],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT / "tests")},
    )
    said = f"{done.stdout}\n{done.stderr}"
    if not answer.is_file():
        raise ToolFailedError(f"{tool.name} gave nothing: {said.strip()[-1000:]}")
    lines = (line.strip() for line in said.splitlines())
    told = (line for line in lines if not COUNTS.search(line) and not OF_ITSELF.search(line))
    complaints = tuple(line for line in told if WARNING.search(line))
    return Answer(json.loads(answer.read_text()), complaints)
