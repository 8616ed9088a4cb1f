"""Operation `energies`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneOrDataset


@study(
    "orchestrator.orbits.energies:EnergiesOfRuns",
    Door("energies", also=("progress: Progress | None = None",), without=("output",)),
)
class Energies(Operation):
    """Show the energy flow between the modes of an impacting body: by force, damping and impacts.

    Exact integrals cover the periodic orbit of each run. The body is an oscillator, a chain, a beam or several
    bodies on restitution stops. A scene is run first. A run without a periodic orbit (chaos, sticking, no impacts) is
    listed with the reason.

    Example: vibroimpact energies examples/thesis/figure_6_15.toml --figure energies.png
    """

    file: SceneOrDataset
    output: DatasetFile = None
    figure: FigureFile = None
    run: Annotated[
        int | None, Option(help="run_index of a run whose impacts are listed one by one.", min=0)
    ] = None
    changes: Changes = None
    force: Force = False
