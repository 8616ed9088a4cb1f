"""The command `vibroimpact modes`: prints the modes of a structure, and writes and draws them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset.outputs import refuse_outputs, writing
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.operations.modes import ShowModes
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.request import Weights
from vibroimpact.orchestrator.study.structure_modes import (
    AT_NODE,
    AUTO,
    Choices,
    dataset_of,
    effective_ratios,
    flexibilities,
    modes_of,
    refuse_ending,
    write_modes,
)

_MOST_LISTED = 8
"""Largest number of points in the printed tables."""
_TABLES = {
    "point": 'weights such as {"12.z"=1, "17.z"=-1}',
    "rayleigh": "a table such as {mass=0.1, stiffness=1e-5}",
}
"""Tables of numbers that options take, by the name of the option."""


def show_modes(options: ShowModes) -> None:
    """Print the modes of a structure, and write and draw them.

    UsageError, SceneError: the file, an option or a place is wrong; nothing is written then.
    """
    choices = Choices(
        stiffness=options.stiffness,
        mass=options.mass,
        damping=options.damping,
        freedoms=options.freedoms,
        points=_points(options.points) if options.points else None,
        modes=_count(options.modes),
        tolerance=options.tolerance,
        residual=None if options.residual else False,
        base=options.base,
        damping_ratio=options.damping_ratio,
        rayleigh=None if options.rayleigh is None else _table("rayleigh", options.rayleigh),
    )
    _refuse_places(options, choices)
    with Terminal(stderr=True).status(f"Modes of {options.file}"):
        found = modes_of(
            options.file,
            choices,
            body=options.body,
            changes=tuple(options.changes or ()),
            figure=options.figure is not None
            or (options.output is not None and options.output.suffix == ".nc"),
        )
    _print(found, str(options.file))
    if options.output is not None:
        with writing(options.output):
            write_modes(options.output, found, named=choices.points)
        say(f"Modes written to {options.output}.")
    if options.figure is not None:
        from vibroimpact.analysis import figures  # half a second, which a table alone does not need

        drawn = figures.draw(dataset_of(found))
        with writing(options.figure):
            figures.save(drawn, options.figure)
        say(f"Figure written to {options.figure}.")


def _refuse_places(options: ShowModes, choices: Choices) -> None:
    """Raise UsageError for files that cannot be written, or that are there and may not be replaced."""
    output = options.output
    read = [options.file, *(Path(each) for each in (choices.mass, choices.damping, choices.freedoms) if each)]
    if output is not None:
        refuse_ending(output)
    refuse_outputs(read, output, options.figure, ending="" if output is None else output.suffix)
    if output is not None and output.exists() and not options.force:
        raise UsageError(
            f"{output}: expected a new file, got one that is there. Choose another name, or overwrite it with --force."
        )


def _count(text: str | None) -> Any:
    """Return a number of modes; a word other than `auto` raises UsageError."""
    if text is None or text == AUTO:
        return text
    if not text.isascii() or not text.isdigit():
        raise UsageError(f"--modes: expected 1 to 64 or {AUTO}, got {text[:60]!r}.")
    return int(text[:9])


def _points(texts: list[str]) -> dict[str, str | Weights]:
    """Return points from `NAME=FREEDOM` and `NAME={"12.z"=1, "17.z"=-1}`."""
    found: dict[str, str | Weights] = {}
    for text in texts:
        name, _, at = (part.strip() for part in text.partition("="))
        if not at or name in found:
            got = f"{name!r} again" if name in found else repr(text[:60])
            raise UsageError(f"--point: expected NAME=FREEDOM such as tip=12.z, each name once, got {got}.")
        found[name] = _table("point", at) if at.startswith("{") else at
    return found


def _table(option: str, text: str) -> Weights:
    """Return a table of numbers in the text of an option; another text raises UsageError."""
    try:
        found = parse_toml(f"at = {text}")["at"]
    except (ValueError, KeyError):
        found = None
    if not isinstance(found, dict) or not all(type(each) in (int, float) for each in found.values()):
        raise UsageError(f"--{option}: expected {_TABLES[option]}, got {text[:60]!r}.")
    return {name: float(number) for name, number in found.items()}


def _print(modes: Modes, title: str) -> None:
    """Print a row for each mode and for each point, the error of the reduction, and the remarks."""
    terminal = wide_terminal()
    listed = list(modes.shapes)[:_MOST_LISTED]
    taken = (">effective mass, kg",) if modes.participation is not None else ()
    heads = ">frequency, Hz", ">damping ratio", *taken, *(f">at {name}, kg" for name in listed)
    terminal.print(table(f"Modes: {title}", ">mode", *heads, "<", rows=_rows(modes, listed)))
    rows = list(_flexibilities(modes, listed))
    heads = ">m/N", ">without residual vectors", ">these add"
    terminal.print(table("Static flexibility of the elastic modes", "<point", *heads, rows=rows))
    if modes.masses:
        say(_total_mass(modes))
    if len(modes.shapes) > len(listed):
        say(f"The first {len(listed)} of {counted(len(modes.shapes), 'point')} are listed.")
    if modes.error is not None:
        say(f"The flexibility at the points has a relative error of {modes.error:.1e} by the reduction.")
    for remark in modes.remarks:
        say(remark)


def _total_mass(modes: Modes) -> str:
    """Return the mass that moves along each axis, the centre of mass, and the share of the effective masses."""
    kinds: dict[str, list[str]] = {}
    for axis, mass in modes.masses.items():
        kinds.setdefault(f"{mass:.5g} kg", []).append(axis)
    said = "; ".join(f"{mass} along {', '.join(axes)}" for mass, axes in kinds.items())
    if modes.centre:
        said += f", with its centre at ({', '.join(f'{each:.4g}' for each in modes.centre)}) m"
    if modes.participation is not None:
        said += f". The modes move {float((modes.participation**2).sum()):.5g} kg with the base"
    return f"Mass that the matrices move: {said}."


def _mass(value: float, largest: float) -> str:
    """Return an effective mass as text; 0 below the rounding of the largest."""
    if math.isnan(value):
        return "-"
    return f"{value:.4g}" if value > AT_NODE**2 * largest else "0"


def _rows(modes: Modes, listed: list[str]) -> Iterator[tuple[str, ...]]:
    ratios = effective_ratios(modes)
    kept = len(modes.natural) - modes.residual_vectors
    masses = dataset_of(modes)["point_mass"].values
    taken = np.zeros(0) if modes.participation is None else modes.participation**2
    largest = taken.max(initial=0.0)
    for place, natural in enumerate(modes.natural):
        moved = (_mass(each, largest) for each in taken[place : place + 1])
        at = (_mass(masses[row, place], 0.0) for row in range(len(listed)))
        kind = "residual vector" if place >= kept else "" if natural > 0.0 else "rigid body"
        numbers = f"{natural / (2.0 * math.pi):.7g}", f"{ratios[place]:.4g}", *moved, *at
        yield str(place + 1), *numbers, kind


def _flexibilities(modes: Modes, listed: list[str]) -> Iterator[tuple[str, ...]]:
    for name, flexibility, without in zip(listed, *flexibilities(modes), strict=False):
        added = flexibility - without
        share = f"{100.0 * added / flexibility:.3g} %" if flexibility > 0.0 else "-"
        yield name, f"{flexibility:.5g}", f"{without:.5g}", share
