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
    """Say how energy goes between the modes of an impacting body: what force, damping and impacts give and take.

    Of an oscillator, a chain or a beam on restitution stops, over the periodic orbit of each run, by exact integrals. A
    scene is run first. A run without a periodic orbit (chaos, sticking, no impacts) is told with its reason.

    Example: vibroimpact energies examples/thesis/figure_6_15.toml --figure energies.png
    """

    file: SceneOrDataset
    output: DatasetFile = None
    figure: FigureFile = None
    run: Annotated[int | None, Option(help="run_index of one run, of which each impact is told.", min=0)] = (
        None
    )
    changes: Changes = None
    force: Force = False
