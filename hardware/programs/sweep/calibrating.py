"""The calibration of a sweep: a file, or tables in the file of the sweep itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tomli_w
from numpy.typing import NDArray

from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.programs.sweep.analysis import Scale
from vibroimpact.hardware.programs.sweep.settings import SweepSettings
from vibroimpact.hardware.rig.calibration import Calibration, read_calibrations
from vibroimpact.orchestrator.scene.problems import Problem, lines_of, quoted, read_table, unknown_key

Floats = NDArray[np.float64]


def calibrations_of(settings: SweepSettings) -> dict[str, Calibration]:
    """Return the calibrations of a sweep by the names of its inputs.

    UsageError: a calibration is wrong or for another input, or the displacement has none in a unit of length.
    """
    if isinstance(settings.calibration, str):
        file = Path(settings.source).parent / settings.calibration
        found = read_calibrations([file], settings.measured)
        source = str(file)
    else:
        found, source = _inline(settings), settings.source
    place = settings.place_of("displacement")
    assert place is not None  # the file was checked
    name = settings.inputs[place].name
    if name not in found:
        raise UsageError(
            f"{source}: {name}: expected a calibration of the displacement, got none. "
            f'Write [calibration.{name}] with unit = "m" and sensitivity, V/m.'
        )
    if measured_unit(found[name].unit).si != "m":
        raise UsageError(f"{source}: {name}.unit: expected one of length, got {found[name].unit}.")
    return found


def _inline(settings: SweepSettings) -> dict[str, Calibration]:
    assert isinstance(settings.calibration, dict)
    terminals = {each.name: each.terminal for each in settings.inputs}
    problems: list[Problem] = []
    found = {}
    for name, table in settings.calibration.items():
        if name not in terminals:
            problems.append(unknown_key(("calibration", name), list(terminals)))
            continue
        one = read_table(Calibration, table, ("calibration", name), problems)
        if one is not None:
            found[name] = one
            if one.terminal not in ("", terminals[name]):
                expected = f"{terminals[name]}, where {name} is measured"
                problems.append(Problem(f"calibration.{name}.terminal", expected, quoted(one.terminal)))
    if problems:
        raise UsageError("\n".join(lines_of(problems, settings.source)))
    return found


def calibration_text(found: dict[str, Calibration]) -> str:
    """Return calibrations as TOML, to be kept with the data."""
    return tomli_w.dumps({name: one.model_dump() for name, one in found.items()})


def displacement_scale(settings: SweepSettings, found: dict[str, Calibration]) -> Scale:
    """Return the conversion from the volts of the displacement to m."""
    place = settings.place_of("displacement")
    assert place is not None
    calibration = found[settings.inputs[place].name]
    factor = measured_unit(calibration.unit).factor

    def metres(volts: Floats, time: Floats, /) -> Floats:
        return factor * calibration.to_units(volts, time)

    return metres
