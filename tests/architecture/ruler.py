"""The ruler: the size of the code, its repetitions, and the share of it that a use runs.

`PYTHONPATH=tests python -m architecture.ruler` prints the table, `--write` lowers the ceilings of `ruler.toml`.
`test_ruler` checks the ceilings, and the names that are gone for good.
"""

from __future__ import annotations

import ast
import re
import statistics
import sys
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from architecture.uses import ROOMS, counts_of_uses
from support.places import ROOT

KEPT = Path(__file__).with_name("ruler.toml")
MAY_LAG = 0.01
"""Distance of a figure below its ceiling, relative, above which the ceiling has to follow."""
STAYING = ("median", "p90")
"""Ends of the names of figures with fixed ceilings: together these may rise by a tenth."""
LONG = 500
"""Lines above which a module counts as long."""
BODIES = {"OscillatorBody", "ChainBody", "BeamBody"}
STOPS = {"RestitutionStop", "KelvinVoigtStop", "HertzStop", "HuntCrossleyStop"}
SCENE = ("orchestrator", "scene")
STARTING_MODULES = {"subprocess", "multiprocessing"}
STARTING_ATTRIBUTES = {"fork", "posix_spawn", "executable"}
"""Starters of processes: a module that is imported, or an attribute of `os` or `sys`."""
Function = ast.FunctionDef | ast.AsyncFunctionDef
COUNTED = (
    *(ast.FunctionDef, ast.AsyncFunctionDef, ast.Expr, ast.Call, ast.MatchClass),
    *(ast.Import, ast.ImportFrom, ast.Attribute),
)


@cache
def modules() -> dict[Path, str]:
    """Return the text of each module of the package by its path from the project."""
    paths = sorted(
        path for room in ROOMS for path in (ROOT / room).rglob("*.py") if "built" not in path.parts
    )
    return {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in paths}


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """Return the nodes of a module of the counted kinds."""
    return tuple(node for node in ast.walk(ast.parse(modules()[path])) if isinstance(node, COUNTED))


def nodes() -> Iterator[ast.AST]:
    """Yield each node of the package of the counted kinds."""
    for path in modules():
        yield from nodes_of(path)


def lines_of(path: Path) -> int:
    """Return the lines of a module."""
    return len(modules()[path].splitlines())


def code_lines_of(path: Path) -> int:
    """Return the lines of a module without blank lines, comments, and texts that are a statement (docstrings)."""
    texts: set[int] = set()
    for node in nodes_of(path):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            texts |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return sum(
        bool(line.strip()) and not line.lstrip().startswith("#") and number not in texts
        for number, line in enumerate(modules()[path].splitlines(), start=1)
    )


def lines_of_c() -> int:
    """Return the lines of the C core, its headers and its components."""
    paths = [path for suffix in ("c", "h") for path in (ROOT / "fmus" / "native").rglob(f"*.{suffix}")]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def lengths_of_functions() -> list[int]:
    """Return the lines of each function."""
    return [
        (node.end_lineno or node.lineno) - node.lineno + 1 for node in nodes() if isinstance(node, Function)
    ]


def questions_of_class(names: set[str]) -> int:
    """Return the number of isinstance calls and match cases that test for one of these classes."""
    return sum(_asks(node, names) for node in nodes())


def _asks(node: ast.AST, names: set[str]) -> bool:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
        return any(isinstance(each, ast.Name) and each.id in names for each in ast.walk(node.args[1]))
    return isinstance(node, ast.MatchClass) and isinstance(node.cls, ast.Name) and node.cls.id in names


def starters() -> list[Path]:
    """Return the modules that start processes, or pass the interpreter's path on for that purpose."""
    return [path for path in modules() if any(map(_starts, nodes_of(path)))]


def _starts(node: ast.AST) -> bool:
    if isinstance(node, ast.Import):
        return any(alias.name.partition(".")[0] in STARTING_MODULES for alias in node.names)
    if isinstance(node, ast.ImportFrom):
        return (node.module or "").partition(".")[0] in STARTING_MODULES
    return isinstance(node, ast.Attribute) and node.attr in STARTING_ATTRIBUTES


def places_of(name: str) -> list[str]:
    """Return each line of the package with a name as a whole word."""
    word = re.compile(rf"\b{re.escape(name)}\b")
    return [
        f"{path}:{number}"
        for path, text in modules().items()
        for number, line in enumerate(text.splitlines(), start=1)
        if word.search(line)
    ]


def figures_of_text() -> dict[str, float]:
    """Return the figures from the text of the code."""
    files, functions = list(map(lines_of, modules())), lengths_of_functions()
    scene = [lines_of(path) for path in modules() if path.parts[:2] == SCENE]
    return {
        "lines of code": sum(map(code_lines_of, modules())),
        "lines": sum(files),
        "lines of C": lines_of_c(),
        f"modules above {LONG} lines": sum(lines > LONG for lines in files),
        "lines of a module, median": statistics.median(files),
        "lines of a module, p90": statistics.quantiles(files, n=10)[-1],
        "lines of a function, median": statistics.median(functions),
        "lines of a function, p90": statistics.quantiles(functions, n=10)[-1],
        "questions whether a body is of a class": questions_of_class(BODIES),
        "questions whether a stop is of a class": questions_of_class(STOPS),
        "modules that start processes": len(starters()),
        "modules of the scene": len(scene),
        "lines of the scene": sum(scene),
        "lines of the longest module of the scene": max(scene),
    }


def figures_of_uses() -> dict[str, float]:
    """Return the numbers of functions and files of the package that each use runs."""
    counts = counts_of_uses()
    return {
        f"{what}, {use}": count
        for use, pair in counts.items()
        for what, count in zip(("functions", "files"), pair, strict=True)
    }


def kept() -> Mapping[str, Any]:
    """Return the ceilings, and the names that are gone."""
    return tomllib.loads(KEPT.read_text(encoding="utf-8"))


def behind(figures: Mapping[str, float], ceilings: Mapping[str, float]) -> dict[str, float]:
    """Return the figures so far below their ceilings that the ceilings have to follow."""
    return {
        name: figure
        for name, figure in figures.items()
        if not name.endswith(STAYING) and figure < (1.0 - MAY_LAG) * ceilings[name]
    }


def with_ceilings(text: str, figures: Mapping[str, float]) -> str:
    """Return the text of the ceilings' file with the figures as new ceilings."""
    for name, figure in figures.items():
        text = re.sub(rf'^"{re.escape(name)}" = \S+', f'"{name}" = {figure:g}', text, flags=re.MULTILINE)
    return text


def main() -> None:
    """Print the table next to the ceilings; with `--write` lower the ceilings."""
    figures, ceilings = figures_of_text() | figures_of_uses(), kept()["ceilings"]
    for name, figure in figures.items():
        print(f"{name:48s} {figure:8g}   ceiling {ceilings[name]:8g}")
    for name in kept()["gone"]:
        print(f"{name:48s} {len(places_of(name)):8d}   gone")
    if sys.argv[1:] == ["--write"]:
        text = KEPT.read_text(encoding="utf-8")
        KEPT.write_text(with_ceilings(text, behind(figures, ceilings)), encoding="utf-8")


if __name__ == "__main__":
    main()
