"""Rows of the zoo's tables: who made an FMU, how our run compares, and why others were refused."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
CLOSE = 1e-9
"""Largest relative difference that counts as equal but for rounding."""
_MAKERS = (
    "Dymola", "OpenModelica", "20-sim", "Hopsan", "Simulink", "Reference FMUs", "PythonFMU3", "PythonFMU", "JModelica",
    "Activate", "AMESim", "Overture", "HIFSuite", "SimulationX", "MapleSim", "CATIA", "FMI4j", "SystemModeler",
    "OPTIMICA", "Coral", "cppfmu", "vibroimpact",
)  # fmt: skip
UNNAMED = "no tool named"
CAUSES = {
    "FMI 1.0": r"got FMI 1\.0",
    "a library of another name than the description gives": r"must have one name",
    "no library for this machine": r"a binary for this machine",
    "no components": r"a system with components",
    "a file that the system lacks": r"which it does not have|expected a file of the archive",
    "model exchange alone": r"model exchange|ModelExchange",
    "needs a library or module that is not here": r"cannot open shared object|No module|No such file|JVM",
    "a description above the limit of 16 MiB": r"expected XML of at most",
    "description beyond repair": r"modelDescription\.xml|its description",
    "names of members with backslashes": r"has a backslash",
    "no FMU inside": r"expected a safe FMU|not a zip|expected an FMU",
    "lacks a function of FMI": r"a binary that exports",
    "makes no instance": r"[Ii]nstantiat",
    "crashes": r"SIG[A-Z]+|exit code -",
    "does not end": r"no end in",
    "reports an error": r"returned|status|discard|fmi[23]",
    "ends in values that are not finite": r"finite|nan",
}
"""Causes of a refusal, by a pattern of its line; the first one that fits counts."""
OTHER = "other"


@dataclass(slots=True)
class Row:
    """An FMU in the zoo."""

    name: str
    maker: str
    kinds: str = ""
    refusal: str = ""
    """Why it did not run; empty if it ran."""
    passes: bool = True
    """Whether `fmu check` finds nothing that keeps it from running."""
    difference: float | None = None
    """Largest relative difference from FMPy, None if nothing was compared."""
    peer_refusal: str = ""
    """Why FMPy did not run it."""
    reference: float | None = None
    """Largest relative difference from the reference result beside the FMU."""
    worst: str = field(default="")
    """The output with the largest difference."""

    @property
    def cause(self) -> str:
        """The cause of the refusal, in a few words."""
        return cause_of(self.refusal)


def cause_of(refusal: str) -> str:
    """Return the cause of a refusal; empty without one.

    >>> cause_of("x.fmu: modelDescription.xml: expected FMI 2.0 or 3.0, got FMI 1.0.")
    'FMI 1.0'
    """
    if not refusal:
        return ""
    return next((cause for cause, pattern in CAUSES.items() if re.search(pattern, refusal)), OTHER)


def maker_of(tool: str) -> str:
    """Return the name of a tool without its version.

    >>> maker_of("Dymola Version 2020x (64-bit), 2019-10-10"), maker_of("")
    ('Dymola', 'no tool named')
    """
    known = next((name for name in _MAKERS if name.lower() in tool.lower()), "")
    return known or re.split(r"[\s(,;:]", tool.strip())[0][:30] or UNNAMED


def difference(
    time: Values, values: dict[str, Values], peer_time: Values, peer: dict[str, Values]
) -> tuple[float, str]:
    """Return the largest relative difference of common instants, and its output.

    At the instant of an event a peer has several rows, and the nearest one counts. A difference is relative to the
    largest value of its output.
    """
    worst, name = 0.0, ""
    for output in values.keys() & peer.keys():
        theirs, mine = np.asarray(peer[output], float), np.asarray(values[output], float)
        nearest = np.full(len(time), np.inf)
        for shift in range(-2, 3):
            place = np.clip(np.searchsorted(peer_time, time) + shift, 0, len(peer_time) - 1)
            same = np.abs(peer_time[place] - time) <= 1e-9 * (1.0 + np.abs(time))
            off = np.where(np.isnan(mine) & np.isnan(theirs[place]), 0.0, np.abs(theirs[place] - mine))
            nearest = np.where(same & ~(off >= nearest), off, nearest)
        compared = nearest[~np.isposinf(nearest)]
        largest = float(np.nanmax(np.abs(np.concatenate([theirs, mine])), initial=0.0))
        relative = float(np.max(compared, initial=0.0)) / max(largest, 1e-300)
        if not len(compared) or math.isnan(relative):
            relative = np.inf
        if relative > worst:
            worst, name = relative, output
    return worst, name


def beside_reference(path: Path, time: Values, values: dict[str, Values]) -> float | None:
    """Return the largest difference from `NAME_ref.csv` beside an FMU, at its instants; None without this file.

    A reference that belongs to inputs, `NAME_in.csv`, is not compared.
    """
    reference = path.with_name(f"{path.stem}_ref.csv")
    if not reference.exists() or path.with_name(f"{path.stem}_in.csv").exists() or not len(time):
        return None
    with reference.open(encoding="utf-8", errors="replace", newline="") as file:
        names, *rows = csv.reader(file)
    table = np.array([[float(cell) for cell in row] for row in rows if row])
    at = table[:, 0]
    inside = at <= time[-1]
    errors = [
        np.max(np.abs(np.interp(at[inside], time, values[name]) - table[inside, column]))
        / max(np.max(np.abs(table[:, column])), 1e-300)
        for column, name in enumerate(names)
        if name in values
    ]
    return float(max(errors)) if errors else None


def table_of_tools(rows: Sequence[Row]) -> list[str]:
    """Return the table of FMUs by the tool that made them, and their sum."""
    lines = [
        "| made by | tried | `fmu check` passes | ran | equal to FMPy, bit by bit | to 1e-9 | largest difference "
        "| FMPy does not run | not run, and why |",
        "|---" * 9 + "|",
    ]
    makers: dict[str, list[Row]] = {}
    for row in rows:
        makers.setdefault(row.maker, []).append(row)
    for maker, own in sorted(makers.items(), key=lambda item: (-len(item[1]), item[0])):
        lines.append(_line(maker, own))
    return [*lines, _line("all", rows)]


def _line(maker: str, rows: Sequence[Row]) -> str:
    ran = [row for row in rows if not row.refusal]
    compared = [row.difference for row in ran if row.difference is not None]
    cells = [
        maker,
        len(rows),
        sum(row.passes for row in rows),
        len(ran),
        sum(one == 0.0 for one in compared),
        sum(one <= CLOSE for one in compared),
        f"{max(compared):.0e}" if compared else "",
        sum(bool(row.peer_refusal) for row in ran) or "",
        causes(row.cause for row in rows if row.refusal),
    ]
    return "| " + " | ".join(map(str, cells)) + " |"


def table_of_systems(refusals: Iterable[str]) -> list[str]:
    """Return the table of systems: how many ran, and the causes of the others."""
    found = list(refusals)
    lines = ["| systems | ran | not run, and why |", "|---|---|---|"]
    return [*lines, f"| {len(found)} | {found.count('')} | {causes(map(cause_of, filter(None, found)))} |"]


def causes(found: Iterable[str]) -> str:
    """Return causes with their counts, the most frequent first."""
    return ", ".join(f"{count} {cause}" for cause, count in Counter(found).most_common())
