"""Operation `hard-cases`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study


@study("orchestrator.hard_cases.study:MeasuredCases", Door("hard_cases", without=("names",)))
class HardCases(Operation):
    """Run cases that are hard for solvers of impacts, and print each figure with its bound.

    Grazes, resonance, chatter into rest, nearly rigid stops, units from nano to giga: each against a closed form or a
    conservation law. Exit code 1: a figure is wrong on this machine. A slow case is only reported.

    Example: vibroimpact hard-cases --only grazing-from-above --only chatter --figure hard_cases.png
    """

    only: Annotated[
        list[str] | None,
        Option(
            metavar="NAME",
            python="only: str | Sequence[str] = ()",
            help="Case to run, by default all; may be repeated.",
        ),
    ] = None
    output: DatasetFile = None
    figure: FigureFile = None
    names: Annotated[bool, Option("--list", help="Print the names of the cases and run none.")] = False
    force: Force = False
