"""The dataset of runs: what a scene says of names, units and groups, handed to the dataset's writer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import Direction, RunRecord, build_dataset, file_names
from vibroimpact.orchestrator.empty_record import sample_variables
from vibroimpact.orchestrator.scene import Scene

EXTREMA = ("displacement_max", "displacement_min")
STROBE = ("strobe_displacement", "strobe_velocity")
BASE_ACCELERATION_UNIT = "m s-2"


def dataset_of_runs(
    scene: Scene,
    values: Sequence[Mapping[str, float]],
    directions: Sequence[Direction],
    indices: Sequence[int],
    records: Sequence[RunRecord],
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Return the one-dimensional dataset of runs.

    Parameters
    ----------
    scene : Scene
        The scene they belong to.
    values : sequence of mapping
        Swept values of each run, by key.
    directions, indices : sequence
        Direction of the sweep and place in the campaign of each run.
    records : sequence of RunRecord
        What became of each.
    attrs : mapping
        Attributes of the file.
    """
    keys = [axis.key for axis in scene.sweep]
    names = dict(zip(keys, file_names([scene.sweep_coordinate_name(key) for key in keys]), strict=True))
    return build_dataset(
        records,
        coordinates={
            name: np.array([point[key] for point in values], dtype=np.float64) for key, name in names.items()
        },
        direction=directions,
        run_index=np.array(indices),
        sample_variables=sample_variables(scene),
        units=scene.units,
        attrs=attrs,
        unit_of=_units(scene, names),
        omit=_omitted(scene),
        event_components=[c.name for c in scene.general.components] if scene.general is not None else (),
        connections=_energy_connections(scene),
    )


def _units(scene: Scene, names: Mapping[str, str]) -> dict[str, str]:
    """Units that the names do not say."""
    if scene.units != "SI":
        return {}
    if scene.general is not None:
        units = dict(scene.general.units)
        return units | {file: units[key] for key, file in names.items() if key in units}
    if scene.forcing is not None and scene.forcing.kind == "base_acceleration":
        file = names.get("forcing.amplitude")
        swept = {file: BASE_ACCELERATION_UNIT} if file is not None else {}
        return {"forcing": BASE_ACCELERATION_UNIT} | swept
    return {}


def _omitted(scene: Scene) -> tuple[str, ...]:
    record = scene.record
    return (() if record.extrema else EXTREMA) + (() if record.strobe else STROBE)


def _energy_connections(scene: Scene) -> tuple[str, ...]:
    if scene.general is None:
        return ()
    # only general scenes need FMPy, which takes long to import
    from vibroimpact.orchestrator.importer.energy import force_connections

    return force_connections(scene.general.components, scene.general.connections)
