"""FMPy's own importer (`simulate_fmu`) with this package's FMUs: co-simulation in FMI 3.0 and 2.0, and CVode.

The setting of co-simulation is the output interval, FMPy's step. Between two rows the FMU is exact, but it reports only
its last impact: FMPy misses all but one of several impacts between two rows. The setting of model exchange is the
tolerance of CVode, whose rows come at events too. The measured time excludes unpacking and reading of descriptions.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Any

import fmpy
import numpy as np

from peers.problems import Problem
from peers.ways import Clock, Found, LateError, Run, Way
from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.ways.all_ways import INTEGRATOR_TOLERANCES
from vibroimpact.orchestrator.study.ways.trials import ROWS_A_PERIOD

ROWS = (1.0, 16.0, 256.0)
"""Rows of co-simulation per forcing period."""
OUTPUT = (
    "displacement",
    "velocity",
    *(f"contact[1].{name}" for name in ("count", "last_time", "last_velocity", "stick_start")),
)


def _run(
    folder: str, problem: Problem, options: Mapping[str, Any], clock: Clock
) -> Callable[[], np.ndarray[Any, Any]]:
    description = fmpy.read_model_description(folder)
    values = {**float_parameters(problem.scene, None), **integer_parameters(problem.scene)}

    def step_finished(time: float, recorder: Any) -> bool:
        clock.check()
        return True

    def rows() -> np.ndarray[Any, Any]:
        clock.start()
        found: np.ndarray[Any, Any] = fmpy.simulate_fmu(
            folder,
            validate=False,
            model_description=description,
            start_values=dict(values),
            stop_time=problem.end,
            output=list(OUTPUT),
            step_finished=step_finished,
            **options,
        )
        return found

    return rows


def opened(version: str, kind: str, problem: Problem, setting: float, clock: Clock) -> Run:
    """Return a function that simulates a problem by one version and kind of its FMU."""
    folder = str(unpack(fmu_path(problem.scene.body.FMU, version)).folder)
    if kind == "CoSimulation":
        options: dict[str, Any] = {
            "output_interval": problem.period / setting,
            "early_return_allowed": version == "3.0",
        }
    else:
        interval = problem.period / (ROWS_A_PERIOD * problem.modes**2)
        options = {"solver": "CVode", "relative_tolerance": setting, "output_interval": interval}
    simulated = _run(folder, problem, {"fmi_type": kind, **options}, clock)

    def run() -> Found:
        try:
            rows = simulated()
        except LateError:
            raise
        except Exception as error:
            # FMPy raises a plain Exception when a solver gives up
            raise ArithmeticError(f"FMPy: {error}") from error
        new = np.flatnonzero(np.diff(rows["contact[1].count"], prepend=0) > 0)
        times, speeds = rows["contact[1].last_time"][new], rows["contact[1].last_velocity"][new]
        final = (float(rows["displacement"][-1]), float(rows["velocity"][-1]))
        starts = rows["contact[1].stick_start"]
        rests = [start for start, _ in itertools.groupby(starts[np.isfinite(starts) & (starts > 0.0)])]
        return Found(
            Observation(np.column_stack([times, speeds, np.ones(len(new))]), final=final), np.array(rests)
        )

    return run


def ways() -> list[Way]:
    """Return co-simulation in both versions, and model exchange."""

    def stepped(version: str) -> Way:
        return Way(
            f"FMPy, our FMU, co-simulation {version}",
            "FMPy",
            "rows a period",
            lambda problem: ROWS,
            lambda problem, setting, clock: opened(version, "CoSimulation", problem, setting, clock),
            ours=True,
        )

    integrated = Way(
        "FMPy, our FMU, model exchange",
        "FMPy",
        "tolerance",
        lambda problem: INTEGRATOR_TOLERANCES,
        lambda problem, setting, clock: opened("3.0", "ModelExchange", problem, setting, clock),
    )
    return [stepped("3.0"), stepped("2.0"), integrated]
