"""`make exchange`: every export in every installed tool, into docs/exchange.md; exit code 1 if a result differs.

`python -m exchange machines` makes one of its tables: tools, pairs, integrated, stiff, systems, reference, machines.
A tool that is not installed has no row; the program reports it.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from support.places import ROOT

from exchange import _model_exchange, _stiff, _systems
from exchange._cases import (
    COUNT,
    NAMES,
    PAIRS,
    RATE,
    Rows,
    difference,
    made,
    made_pair,
)
from exchange._machines import MACHINES, HostFailedError, Machine
from exchange._reference import BALL, EXAMPLE, VERSIONS, bounces, found, imported, missing
from exchange._tools import (
    CASADI,
    TOOLS,
    Answer,
    Tool,
    ToolFailedError,
    run,
    run_coupled,
    run_integrated,
    run_system,
    steps_of,
)
from vibroimpact.fmus.packaging.export import export_fmu

PAGE = ROOT / "docs" / "exchange.md"
GOAL = 1e-9
NO_COUPLING = "couples none"
"""Cell for a tool that runs only single FMUs."""
CONSOLE = Console(width=180)
CONSOLE.soft_wrap = True


def main() -> int:
    """Try all tables, or the named ones, print and write them."""
    tables = {
        "tools": lambda: _of_tools("tools", list(NAMES), _row_of_tool),
        "pairs": lambda: _of_tools("pairs", list(PAIRS), _row_of_pair),
        "integrated": _of_integrated,
        "stiff": _of_stiff,
        "systems": _of_systems,
        "reference": _of_reference_fmus,
        "machines": _of_machines,
    }
    bad = [line for table in sys.argv[1:] or tables for line in tables[table]()]
    for line in bad:
        CONSOLE.print(line, style="red", markup=False)
    CONSOLE.print(f"The tables are in {PAGE.relative_to(ROOT)}.")
    return 1 if bad else 0


Cell = float | str
Row = Callable[[Tool, str, list[str]], Iterator[Cell]]


def _of_tools(table: str, names: list[str], row: Row) -> Iterator[str]:
    """Write the table of tools or of pairs; yield the failures."""
    lines = ["| tool | FMI | " + " | ".join(names) + " |", "|---" * (2 + len(names)) + "|"]
    for tool in _here(TOOLS):
        for versions, cells in _cells(tool, table, row):
            lines.append(_line(tool.shown(), [versions, *cells, *[""] * (len(names) - len(cells))]))
            tried = [cell for cell in cells if cell != NO_COUPLING]
            if not all(isinstance(cell, float) and cell <= GOAL for cell in tried):
                yield f"{tool.name}, FMI {versions}: expected {GOAL:g} at most, got {', '.join(map(str, cells))}."
    _write(table, lines)


def _of_integrated() -> Iterator[str]:
    """Write the table of model exchange; yield the failures."""
    names = list(_model_exchange.STEPS)
    lines = ["| tool | FMI | tolerance | " + " | ".join(names) + " |", "|---" * (3 + len(names)) + "|"]
    for tool in _here(tool for tool in TOOLS if tool.name in _model_exchange.VERSIONS):
        for fmi in _model_exchange.VERSIONS[tool.name]:
            for tolerance in _model_exchange.TOLERANCES:
                cells = [_cell_of_integrated(tool, fmi, name, tolerance) for name in names]
                lines.append(_line(tool.shown(), [fmi, f"{tolerance:.0e}", *cells]))
                goal = _model_exchange.ALLOWED * tolerance if tolerance < _model_exchange.USUAL else np.inf
                if not all(isinstance(cell, float) and cell <= goal for cell in cells):
                    yield f"{tool.name}, FMI {fmi}, model exchange: expected {goal:g} at most, got {lines[-1]}."
    _write("integrated", lines)


def _cell_of_integrated(tool: Tool, fmi: str, name: str, tolerance: float) -> Cell:
    with tempfile.TemporaryDirectory() as folder:
        it = made(name, fmi, Path(folder)).integrated(_model_exchange.STEPS[name])
        arguments = (tool, it.path, it.outputs, it.step, len(it.rows), Path(folder), tolerance)
        return _cell(run_integrated, it.rows, *arguments, rows=it.quiet)


def _of_stiff() -> Iterator[str]:
    """Write the table of steps for a stiff chain; yield the tools that take too many."""
    lines = ["| tool | FMI | steps |", "|---|---|---|"]
    for tool in _here(tool for tool in (*TOOLS, CASADI) if tool.name in _stiff.VERSIONS):
        for fmi in _stiff.VERSIONS[tool.name]:
            with tempfile.TemporaryDirectory() as folder:
                path = export_fmu(
                    "chain", Path(folder) / "c.fmu", masses=_stiff.MASSES, fmi=fmi, starts=_stiff.STARTS
                )
                try:
                    steps = steps_of(tool, path, Path(folder), _stiff.STOP_TIME, _stiff.TOLERANCE)
                except ToolFailedError as error:
                    print(error, file=sys.stderr)
                    steps = 0
            lines.append(_line(tool.shown(), [fmi, f"{steps:,}" if steps else "failed"]))
            if not 0 < steps <= _stiff.MOST_STEPS:
                yield f"{tool.name}, FMI {fmi}, stiff: expected {_stiff.MOST_STEPS} steps at most, got {steps}."
    _write("stiff", lines)


def _of_systems() -> Iterator[str]:
    """Write the table of systems; yield the failures."""
    lines = ["| tool | FMI | gains | two oscillators with a spring |", "|---|---|---|---|"]
    here = [tool.name for tool in _here(tool for tool in TOOLS if tool.name in _systems.GAINS)]
    for tool, fmi, gains in _systems.PAIRS:
        if tool.name not in here:
            continue
        with tempfile.TemporaryDirectory() as folder:
            system, expected = _systems.made(Path(folder), tool, fmi, gains)
            steps = (_systems.STEP, _systems.COUNT, Path(folder))
            cell = _cell(run_system, expected, tool, system, _systems.NAMES, *steps)
        late = ", springs one step late" if _systems.is_late(tool, gains) else ""
        lines.append(_line(tool.shown(), [fmi, f"{gains}{late}", cell]))
        if not isinstance(cell, float) or cell > GOAL:
            yield f"{tool.name}, FMI {fmi}, a system: expected {GOAL:g} at most, got {cell}."
    _write("systems", lines)


def _of_reference_fmus() -> Iterator[str]:
    """Write the table of Reference-FMUs in our importer; yield the failures."""
    if reason := missing():
        _write("reference", [f"Not tried: {reason}."])
        return
    lines = ["| Reference-FMU | " + " | ".join(f"FMI {fmi}" for fmi in VERSIONS) + " |", "|---|---|---|"]
    for name, by_version in found().items():
        cells = {}
        for fmi, path in by_version.items():
            with tempfile.TemporaryDirectory() as folder:
                cells[fmi] = imported(path, Path(folder))
            if isinstance(cell := cells[fmi], float) and cell > GOAL:
                yield f"{name}, FMI {fmi}: expected {GOAL:g} at most, got {cell:.1g}."
        lines.append(_line(name, [cells.get(fmi, "") for fmi in VERSIONS]))
    counts = []
    for fmi in VERSIONS:
        with tempfile.TemporaryDirectory() as folder:
            path = found().get(BALL, {}).get(fmi)
            times = bounces(path, Path(folder)) if path else []
        counts.append(f"{len(times)} bounces, the first at {times[0]:.5f} s" if times else "")
    lines.append(_line(f"examples/{EXAMPLE}, e = 0.7", counts))
    _write("reference", lines)


def _of_machines() -> Iterator[str]:
    """Write the table of target machines; yield the failures."""
    lines = ["| made for | FMI | " + " | ".join(NAMES) + " |", "|---" * (2 + len(NAMES)) + "|"]
    for machine in MACHINES:
        if reason := machine.missing():
            lines.append(
                _line(machine.platform.name, ["2.0, 3.0", f"not tried: {reason}", *[""] * (len(NAMES) - 1)])
            )
            continue
        with tempfile.TemporaryDirectory() as folder:
            host = machine.host(Path(folder))
            for fmi in VERSIONS:
                cells = [_cell_of_machine(machine, host, name, fmi, Path(folder)) for name in NAMES]
                lines.append(_line(machine.shown(), [fmi, *cells]))
                if not all(isinstance(cell, float) and cell <= GOAL for cell in cells):
                    yield f"{machine.platform.name}, FMI {fmi}: expected {GOAL:g} at most, got {lines[-1]}."
            machine.end(host)
    _write("machines", lines)


def _cell_of_machine(machine: Machine, host: Path, name: str, fmi: str, folder: Path) -> Cell:
    it = made(name, fmi, folder, machine.export_platform)
    try:
        rows = machine.run(host, it.path, it.outputs, it.step, len(it.rows))
    except HostFailedError as error:
        print(error, file=sys.stderr)
        return "failed"
    return difference(rows, it.rows) if rows.shape == it.rows.shape else f"{len(rows)} steps"


def _line(name: str, cells: Sequence[Cell]) -> str:
    texts = (cell if isinstance(cell, str) else f"{cell:.1g}" for cell in cells)
    return f"| {name} | {' | '.join(texts)} |"


def _write(table: str, lines: list[str]) -> None:
    """Write a table into the page, and print it."""
    CONSOLE.print(*lines, sep="\n", markup=False)
    begin, end = f"<!-- {table}: written by make exchange -->", f"<!-- end of {table} -->"
    written = "\n".join((begin, *lines, end))
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(re.sub(f"{begin}.*{end}", lambda _: written, text, flags=re.S), encoding="utf-8")


def _here(tools: Iterable[Tool]) -> Iterator[Tool]:
    """Yield the installed tools; print why the others are not tried."""
    for tool in tools:
        if reason := tool.missing():
            CONSOLE.print(f"{tool.name} is not tried: {reason}.", markup=False)
        else:
            yield tool


def _cells(tool: Tool, table: str, row: Row) -> Iterator[tuple[str, list[Cell]]]:
    """Yield the rows of a tool: the version or versions of FMI, and the cells."""
    versions = tool.couples if table == "pairs" else tool.versions
    if not versions:
        yield ", ".join(tool.versions), [NO_COUPLING]
    for fmi in versions:
        yield fmi, list(row(tool, fmi, list(PAIRS if table == "pairs" else NAMES)))


def _row_of_tool(tool: Tool, fmi: str, names: list[str]) -> Iterator[Cell]:
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            it = made(name, fmi, Path(folder)).read_by(tool, fmi)
            yield _cell(run, it.rows, tool, it.path, it.outputs, it.step, len(it.rows), Path(folder))


def _row_of_pair(tool: Tool, fmi: str, names: list[str]) -> Iterator[Cell]:
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            it = made_pair(name, tool, fmi, Path(folder))
            arguments = (tool, it.fmus, PAIRS[name].connections, it.outputs, 1.0 / RATE, COUNT, Path(folder))
            yield _cell(run_coupled, it.rows, *arguments)


def _cell(
    ask: Callable[..., Answer], expected: Rows, *arguments: object, rows: NDArray[np.bool_] | None = None
) -> Cell:
    """Return the error of a tool's answer, in all rows or in the given ones, or the tool's fault in words."""
    try:
        answer = ask(*arguments)
    except ToolFailedError as error:
        print(error, file=sys.stderr)
        return "failed"
    if answer.complaints:
        print(*dict.fromkeys(answer.complaints), sep="\n", file=sys.stderr)
        return "warned"
    found = np.array(answer.rows)
    if found.shape != expected.shape:
        return f"{len(found)} steps"
    compared = slice(None) if rows is None else rows
    return difference(found[compared], expected[compared])


if __name__ == "__main__":
    sys.exit(main())
