"""The FMI project's Reference-FMUs in our importer, each compared with the result in its own archive."""

from __future__ import annotations

import csv
import os
import shutil
import zipfile
from pathlib import Path

import numpy as np
from fmpy import read_model_description
from fmpy.model_description import ModelDescription, ScalarVariable
from support.places import EXAMPLES

from exchange._cases import Rows
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene

VARIABLE = "VIBROIMPACT_REFERENCE_FMUS"
VERSIONS = ("2.0", "3.0")
EXAMPLE = "bouncing_ball.toml"
BALL = "BouncingBall"
LONGEST = 1e4
"""Longest run, s: a longer experiment is cut to one step."""

Fmus = dict[str, dict[str, Path]]
Table = tuple[list[str], Rows]


def missing() -> str:
    """Return the reason why the FMUs cannot be tried here, empty if they can."""
    folder = os.environ.get(VARIABLE)
    if not folder:
        return f"no folder of them is named by {VARIABLE}"
    return "" if found() else f"{folder}, which {VARIABLE} names, has no FMU"


def found() -> Fmus:
    """Return the FMUs in the folder, or below it, by name and version of FMI."""
    fmus: Fmus = {}
    for path in sorted(Path(os.environ[VARIABLE]).rglob("*.fmu")):
        version = _description(path).fmiVersion[:3]
        if version in VERSIONS:
            fmus.setdefault(path.stem, {})[version] = path
    return fmus


def imported(path: Path, folder: Path) -> float | str:
    """Return the largest difference from the archive's result, relative to its largest value, or the error message.

    Parameters
    ----------
    path : Path
        File of the FMU.
    folder : Path
        Folder for temporary files.
    """
    description = _description(path)
    if description.coSimulation is None:
        return "not for co-simulation"
    names, expected = _result(path)
    scalars = _scalars(description)
    compared = [name for name in names if name in scalars]
    try:
        rows, events = _run(path, compared or scalars[:1], expected[:, 0], folder)
    except VibroimpactError as error:
        # the FMU's own message comes last
        return f"refused: {str(error).splitlines()[0].rpartition(': ')[2]}"
    if not compared:
        return "runs; nothing to compare"
    chosen = expected[:, [0, *(names.index(name) for name in compared)]]
    # an FMU may ask to end before its experiment does; for a sample at an event both sides are right
    ours = {round(time, 9): row for time, *row in rows if not np.any(np.abs(events - time) <= 1e-9)}
    pairs = [(ours[round(time, 9)], row) for time, *row in chosen if round(time, 9) in ours]
    if len(pairs) < len(chosen) / 2:
        return f"{len(pairs)} of {len(chosen)} rows"
    got, there = np.array(pairs).transpose(1, 0, 2)
    return float(np.max(np.abs(got - there) / np.maximum(np.abs(there).max(axis=0), 1e-300)))


def bounces(path: Path, folder: Path) -> list[float]:
    """Return the instants of the ball's bounces, s, by the shipped example with this FMU, at a restitution of 0.7."""
    shutil.copyfile(path, folder / f"{BALL}.fmu")
    shutil.copyfile(EXAMPLES / EXAMPLE, folder / EXAMPLE)
    run_scene(Scene.from_file(folder / EXAMPLE), folder / "bounces.nc")
    events = open_dataset(folder / "bounces.nc").vibroimpact.events(e=0.7)
    return list(map(float, events.event_time.values))


def _description(path: Path) -> ModelDescription:
    return read_model_description(str(path), validate=False)


def _scalars(description: ModelDescription) -> list[str]:
    def is_number(variable: ScalarVariable) -> bool:
        return variable.type not in ("String", "Binary", "Clock") and not variable.dimensions

    chosen = [v for v in description.modelVariables if v.causality != "independent" and is_number(v)]
    return [v.name for v in sorted(chosen, key=lambda v: v.causality not in ("output", "local"))]


def _result(path: Path) -> Table:
    """Return the names and columns of the result in an archive, with 0 in place of texts."""

    def number(text: str) -> float:
        try:
            return float({"true": "1", "false": "0"}.get(text, text))
        except ValueError:
            return 0.0

    with zipfile.ZipFile(path) as archive:
        text = archive.read(f"extra/org.fmi-standard.fmi-ls-ref/{path.stem}_out.csv").decode("utf-8")
    names, *rows = csv.reader(text.splitlines())
    return names, np.array([[number(cell) for cell in row] for row in rows])


def _run(path: Path, names: list[str], time: Rows, folder: Path) -> tuple[Rows, Rows]:
    """Return time and variables of our run of the experiment with these instants, and the instants of events."""
    # differences of times that were written with all digits have rounding errors in the last digits
    end = float(time[-1])
    step = end / round(end / float(np.median(np.diff(time))))
    scene = Scene.from_dict(
        {
            "component": {"x": {"fmu": str(path)}},
            "record": {
                "recorded_time": end,
                "variables": [f"x.{name}" for name in names],
                "rate": 1.0 / step,
            },
            "execution": {"how": "coupled", "macro_step": step},
        }
    )
    run_scene(scene, folder / "run.nc")
    run = open_dataset(folder / "run.nc")
    samples = run.vibroimpact.samples()
    rows = np.column_stack([samples.time.values, *(samples[f"x_{name}"].values for name in names)])
    return rows, run.vibroimpact.events().event_time.values
