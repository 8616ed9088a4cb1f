"""The tools: presence, version, and results with FMUs, computed in a separate process."""

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
"""Time limit for a run of a tool, s."""

WARNING = re.compile(r"\bwarn(ing)?\b(?!\(s\))|\berror\b(?!\(s\))", re.IGNORECASE)
"""A line with a complaint of a tool, or of an FMU through it; counts of complaints, `0 Warning(s)`, do not match."""

COUNTS = re.compile(r"\b0 (warnings|errors)\b|warning\(s\) and error\(s\)", re.IGNORECASE)
OF_ITSELF = re.compile(r"FMI3 support is experimental")
"""PyFMI's message about itself, printed for any FMU."""

Rows = list[list[float]]


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool that runs FMUs, driven by a function of `_single`, and of `_couple` if it couples them.

    Attributes
    ----------
    package, program : str
        Package to install, or program to find on PATH. The variable `VIBROIMPACT_` + its name in capitals names a
        Python with the package, or the program.
    versions : tuple of str
        Versions of FMI that the tool supports.
    couples : tuple of str
        Versions of FMI whose FMUs the tool can couple.
    without_integers : tuple of str
        Versions of FMI whose integers the tool cannot read: Ecos reserves too little memory for FMI 3.0's, and ends.
    exchanges_first : bool
        Whether the tool exchanges the values of a step before it writes the row of the step's end.
    """

    name: str
    versions: tuple[str, ...]
    package: str = ""
    program: str = ""
    couples: tuple[str, ...] = ()
    without_integers: tuple[str, ...] = ()
    exchanges_first: bool = False

    def missing(self) -> str:
        """Return the reason why the tool cannot be tried here, empty if it can."""
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
        """Name of the variable that says where the tool is."""
        return "VIBROIMPACT_" + (self.package or self.program).partition(".")[0].upper()

    def path(self) -> str | None:
        """Return the path of the tool's program."""
        return shutil.which(os.environ.get(self.variable) or self.program)

    @property
    def python(self) -> str:
        """The Python that runs the tool's driver."""
        return (os.environ.get(self.variable) if self.package else None) or sys.executable

    def shown(self) -> str:
        """Return the tool's name with its version."""
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
        return _output_of([self.python, "-c", code, self.package]).strip()

    def _version_of_program(self) -> str:
        found = re.search(r"v?(\d+\.\d[\w.]*)", _output_of([str(self.path()), "--version"]))
        return found[1] if found else ""


def _output_of(command: Sequence[str]) -> str:
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT).stdout


TOOLS = (
    Tool("FMPy", ("2.0", "3.0"), package="fmpy", couples=("2.0",)),
    # libcosim 0.11 does not support FMI 3.0, and crashes with a segmentation fault on such an FMU
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
"""CasADi integrates and differentiates FMUs for model exchange; it steps none."""


class ToolFailedError(Exception):
    """A tool gave no values; the text has its last output."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Results of a tool with FMUs at their own start values.

    Attributes
    ----------
    rows : list of list of float
        The outputs after each step.
    complaints : tuple of str
        Lines of warnings and errors that the tool wrote.
    """

    rows: Rows
    complaints: tuple[str, ...]


def run(tool: Tool, fmu: Path, names: Sequence[str], step: float, count: int, folder: Path) -> Answer:
    """Return a tool's results with an FMU.

    Parameters
    ----------
    tool : Tool
    fmu : Path
    names : sequence of str
        Names of outputs.
    step : float
        Communication step, s: a whole number of nanoseconds, in which libcosim counts.
    count : int
        Number of steps.
    folder : Path
        Folder for temporary files.

    Raises
    ------
    ToolFailedError
        The tool gave no values.
    """
    return _answer(tool, {"fmu": str(fmu), "names": list(names), "step": step, "count": count}, folder)


def run_integrated(
    tool: Tool, fmu: Path, names: Sequence[str], step: float, count: int, folder: Path, tolerance: float
) -> Answer:
    """Return a tool's results with an FMU for model exchange, integrated at a relative tolerance."""
    order = {"fmu": str(fmu), "names": list(names), "step": step, "count": count, "tolerance": tolerance}
    return _answer(tool, order, folder)


def steps_of(tool: Tool, fmu: Path, folder: Path, stop_time: float, tolerance: float) -> int:
    """Return the number of steps that a tool's integrator takes up to an instant, s, at a relative tolerance.

    Raises
    ------
    ToolFailedError
        The tool gave no number, or warned.
    """
    answer = _answer(tool, {"fmu": str(fmu), "stop_time": stop_time, "tolerance": tolerance}, folder)
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
    """Return a tool's results with coupled FMUs; `names` and `connections` are in the form `component.variable`."""
    order = {"fmus": {name: str(path) for name, path in fmus.items()}, "connections": list(connections)}
    return _answer(tool, {**order, "names": list(names), "step": step, "count": count}, folder)


def run_system(
    tool: Tool, system: Path, names: Sequence[str], step: float, count: int, folder: Path
) -> Answer:
    """Return a tool's results with a system (SSP), with the step that it proposes; `names` are `component.variable`."""
    with zipfile.ZipFile(system) as archive:
        inside = [name for name in archive.namelist() if name.endswith(".fmu")]
        fmus = {Path(name).stem: archive.extract(name, folder) for name in inside}
        description = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    order = {"system": str(system), "model": description.get("name"), "fmus": fmus}
    return _answer(tool, {**order, "names": list(names), "step": step, "count": count}, folder)


def _answer(tool: Tool, request: Mapping[str, Any], folder: Path) -> Answer:
    answer = folder / "answer.json"
    answer.unlink(missing_ok=True)
    order = {
        **request,
        "tool": tool.name,
        "program": tool.path() if tool.program else "",
        "answer": str(answer),
    }
    done = subprocess.run(
        [tool.python, "-m", "exchange._drive", json.dumps(order)],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT / "tests")},
    )
    text = f"{done.stdout}\n{done.stderr}"
    if not answer.is_file():
        raise ToolFailedError(f"{tool.name} gave nothing: {text.strip()[-1000:]}")
    lines = (line.strip() for line in text.splitlines())
    candidates = (line for line in lines if not COUNTS.search(line) and not OF_ITSELF.search(line))
    complaints = tuple(line for line in candidates if WARNING.search(line))
    return Answer(json.loads(answer.read_text()), complaints)
