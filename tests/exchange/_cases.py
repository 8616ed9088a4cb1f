"""Cases of the exchange: bodies with stops, each as a scene, as an exported FMU, and as the dataset of our own run."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from xarray import Dataset

from exchange._single import described
from exchange._tools import Tool
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal, build_replay
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.run.parameters import exported_floats, integer_parameters
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.keys import dataset_name

RATE = 512.0
"""Samples per second; the step has no rounding error, neither in binary nor in libcosim's nanoseconds."""

COUNT = 4000

Rows = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Case:
    """A body with stops.

    Attributes
    ----------
    tables : mapping of str to table
        Scene without its table `record`.
    rate : float
        Steps per second.
    count : int
        Number of steps.
    """

    tables: dict[str, Any]
    rate: float = RATE
    count: int = COUNT


@dataclass(frozen=True, slots=True)
class Exchanged:
    """An FMU, and its results in our own run.

    Attributes
    ----------
    path : Path
        File of the FMU.
    outputs : tuple of str
        Names of all its outputs.
    step : float
        Communication step, s.
    rows : ndarray, shape (step, output)
        The outputs after each step.
    smooth : tuple of str
        Names of the outputs that an integrator computes too: the continuous ones.
    quiet : ndarray of bool, shape (step,)
        Steps without a contact event within two steps.
    """

    path: Path
    outputs: tuple[str, ...]
    step: float
    rows: Rows
    smooth: tuple[str, ...] = ()
    quiet: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    def read_by(self, tool: Tool, fmi: str) -> Exchanged:
        """Return the reference for a tool: all outputs that it can read."""
        if fmi not in tool.without_integers:
            return self
        kinds = described(str(self.path))
        kept = tuple(name for name in self.outputs if kinds[name][1] != "integer")
        return replace(self, outputs=kept, rows=self.rows[:, [self.outputs.index(name) for name in kept]])

    def integrated(self, count: int) -> Exchanged:
        """Return the reference for an integrator: the smooth outputs of the first steps."""
        columns = [self.outputs.index(name) for name in self.smooth]
        return replace(self, outputs=self.smooth, rows=self.rows[:count, columns], quiet=self.quiet[:count])


STOPS = [
    {"position": 0.1, "law": "restitution", "restitution": 0.6},
    {"position": -0.15, "side": "lower", "law": "kelvin_voigt", "stiffness": 2e3, "damping": 1.0},
]
OSCILLATOR = {"mass": 2.0, "stiffness": 8.0, "damping_ratio": 0.02}
CHAIN = {"kind": "chain", "masses": [1.0, 2.0, 1.5], "stiffnesses": [40.0, 20.0, 30.0]}
BEAM = {
    "kind": "beam",
    "modes": 4,
    "length": 0.25,
    "youngs_modulus": 7e10,
    "density": 2700.0,
    "width": 0.02,
    "thickness": 0.002,
    "damping_ratio": 0.02,
}
BEAM_STOP = {"position": 0.004, "law": "restitution", "restitution": 0.6}
CHATTER = {"position": 0.0, "law": "restitution", "restitution": 0.7}
SHAKEN = "base_acceleration"
MILLISECONDS = 1000.0
"""Samples per second; the step has a rounding error in binary."""
LONG = 10_000

CASES = {
    "oscillator": Case(
        {"body": OSCILLATOR, "forcing": {"amplitude": 3.0, "angular_frequency": 1.7}, "stop": STOPS}
    ),
    "chain of 3": Case(
        {
            "body": CHAIN,
            "forcing": {"amplitude": [0.0, 2.0, 1.0], "angular_frequency": 2.0},
            "stop": [{**stop, "mass": 2} for stop in STOPS],
        }
    ),
    "beam of 4 modes with a stop": Case(
        {"body": BEAM, "forcing": {"amplitude": 0.5, "angular_frequency": 150.0}, "stop": [BEAM_STOP]}
    ),
    "oscillator, shaken base": Case(
        {
            "body": OSCILLATOR,
            "forcing": {"kind": SHAKEN, "amplitude": 1.5, "angular_frequency": 1.7},
            "stop": STOPS,
        },
        MILLISECONDS,
        LONG,
    ),
    "chain, shaken base": Case(
        {
            "body": CHAIN,
            "forcing": {"kind": SHAKEN, "amplitude": 1.0, "angular_frequency": 2.0},
            "stop": [{**stop, "mass": 2} for stop in STOPS],
        },
        MILLISECONDS,
    ),
    "beam, shaken base": Case(
        {
            "body": BEAM,
            "forcing": {"kind": SHAKEN, "amplitude": 40.0, "angular_frequency": 150.0},
            "stop": [BEAM_STOP],
        },
        MILLISECONDS,
        500,
    ),
    "chatter": Case(
        {
            "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05, "displacement_start": -0.1},
            "forcing": {"amplitude": 1.0, "angular_frequency": 0.2},
            "stop": [CHATTER],
        },
        MILLISECONDS,
        LONG,
    ),
}
IMPACT_STOP, REPLAY = "impact stop", "replay"
NAMES = (*CASES, IMPACT_STOP, REPLAY)


def made(name: str, fmi: str, folder: Path, platform: str | None = None) -> Exchanged:
    """Return the FMU of a case, with its outputs after each step of our own run."""
    path = folder / "exported.fmu"
    if name == REPLAY:
        return _replay(fmi, path, platform)
    if name == IMPACT_STOP:
        starts = {
            "law": "kelvin_voigt",
            "stiffness": 1e4,
            "damping": 3.0,
            "displacement": 0.01,
            "velocity": 0.5,
        }
        export_fmu("impact_stop", path, fmi=fmi, starts=starts, platform=platform)
        answer = {
            "applied_force": 1e4 * 0.01 + 3.0 * 0.5,
            "applied_stiffness": 1e4,
            "applied_damping": 3.0,
            "applied_restitution": 1.0,
        }
        names = tuple(outputs_of(path))
        return Exchanged(path, names, 1.0 / RATE, np.tile([answer[name] for name in names], (COUNT, 1)))
    return _body(name, fmi, path, platform)


def outputs_of(path: Path) -> dict[str, str]:
    """Return the outputs of an FMU, each with its variability."""
    variables = read_description(path).modelVariables
    return {v.name: v.variability for v in variables if v.causality == "output"}


def _body(name: str, fmi: str, path: Path, platform: str | None) -> Exchanged:
    ours, case = our_run(name), CASES[name]
    export_scene(ours.scene, path, fmi=fmi, platform=platform)
    outputs = outputs_of(path)
    smooth = tuple(output for output, variability in outputs.items() if variability == "continuous")
    rows = np.column_stack([ours.found[output] for output in outputs])
    return Exchanged(path, tuple(outputs), 1.0 / case.rate, rows, smooth, ours.quiet)


@dataclass(frozen=True, slots=True)
class OurRun:
    """Our own run of a case: the scene, each output of its FMU after each step, its impacts, and its quiet steps."""

    scene: Scene
    found: dict[str, Rows]
    impacts: Dataset
    quiet: NDArray[np.bool_]


@cache
def our_run(name: str) -> OurRun:
    """Return our own run of a case; the result is cached."""
    case = CASES[name]
    period = 2.0 * np.pi / case.tables["forcing"]["angular_frequency"]
    record = {"recorded_periods": int(np.ceil((case.count + 1) / case.rate / period))}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        scene = Scene.from_dict({**case.tables, "record": record})
        outputs = outputs_of(export_scene(scene, folder / "outputs.fmu"))
        sampled = {output: series for output in outputs if (series := _series_of(output))}
        times = {"rate": case.rate, "variables": list(sampled.values())}
        run_scene(
            Scene.from_dict({**case.tables, "record": {**record, "time_series": times}}), folder / "run.nc"
        )
        with open_dataset(folder / "run.nc") as run:
            found = {output: run[dataset_name(series)].values for output, series in sampled.items()}
            impacts, quiet = run.vibroimpact.impacts().load(), _quiet(run, case)
        found |= _by_importer(scene, [output for output in outputs if output not in sampled], case, folder)
    steps = slice(1, case.count + 1)
    return OurRun(scene, {output: values[steps] for output, values in found.items()}, impacts, quiet)


def _series_of(name: str) -> str:
    """Return the name in a time series for an output of a body; empty if a time series lacks it."""
    if match := re.fullmatch(r"contact\[(\d+)\]\.(displacement|velocity|force)", name):
        return f"contact_{match[2]}[{match[1]}]"
    plain = r"(displacement|velocity|acceleration)(\[\d+\])?|energy\..*|modal_(displacement|velocity)\[\d+\]"
    return name if re.fullmatch(plain, name) else ""


def _by_importer(scene: Scene, names: list[str], case: Case, folder: Path) -> dict[str, Rows]:
    """Return the outputs that no time series has (counts and impulses of contacts), from a run of our importer."""
    parameters = {**exported_floats(scene), **integer_parameters(scene)}
    tables = {
        "component": {"body": {"fmu": scene.body.FMU, "parameters": parameters}},
        "record": {
            "recorded_time": (case.count + 1) / case.rate,
            "variables": [f"body.{name}" for name in names],
            "rate": case.rate,
        },
        "execution": {"how": "coupled", "macro_step": 1.0 / case.rate},
    }
    run_scene(Scene.from_dict(tables), folder / "importer.nc")
    with open_dataset(folder / "importer.nc") as run:
        return {name: run[dataset_name(f"body.{name}")].values for name in names}


def _quiet(run: Dataset, case: Case) -> NDArray[np.bool_]:
    impacts, sticks = run.vibroimpact.impacts(), run.vibroimpact.sticks()
    begin, end = impacts["impact_time"].values, sticks["stick_end"].values
    events = np.concatenate([begin, begin + impacts["impact_duration"].values, end])
    near = np.floor(events[np.isfinite(events)] * case.rate).astype(int)
    loud = np.unique(near[:, None] + np.arange(-2, 3))
    quiet = np.ones(case.count, bool)
    quiet[loud[(loud >= 0) & (loud < case.count)]] = False
    return quiet


def _replay(fmi: str, path: Path, platform: str | None) -> Exchanged:
    """Return an FMU of noise at twice the rate with a gap, and of a slow channel with instants of its own."""
    random = np.random.default_rng(13)
    times = np.arange(2 * COUNT + 2) / (2.0 * RATE)
    values, instants = random.normal(size=len(times)), (np.cumsum(random.integers(25, 150, 60)) + 0.5) / RATE
    gap = slice(1001, 1300)
    values[gap] = np.nan
    good = np.isfinite(values)
    bridged = np.where(good, values, np.interp(times, times[good], values[good]))
    slow = random.normal(size=len(instants))
    signals = {
        "base": ReplaySignal.evenly(values, "m/s2", 0.5 / RATE),
        "sparse": ReplaySignal(instants, slow, "N"),
    }
    now = slice(2, 2 * COUNT + 1, 2)
    at = times[now]
    inside = (at >= instants[0]) & (at < instants[-1])
    segment = np.clip(np.searchsorted(instants, at, "right") - 1, 0, len(instants) - 2)
    slopes = np.where(inside, (np.diff(slow) / np.diff(instants))[segment], 0.0)
    played = {
        "base": bridged[now],
        "base_valid": good[now],
        "base_rate": (np.diff(bridged) * 2.0 * RATE)[now],
        "sparse": np.interp(at, instants, slow),
        "sparse_valid": inside,
        "sparse_rate": slopes,
    }
    build_replay(signals, path, fmi=fmi, platform=platform)
    names = tuple(outputs_of(path))
    return Exchanged(path, names, 1.0 / RATE, np.column_stack([played[name] for name in names]))


@dataclass(frozen=True, slots=True)
class Pair:
    """Two coupled oscillators with stops; their connections carry the values known at the start of a step.

    Attributes
    ----------
    parameters : mapping of str to mapping of str to number
        Start values of each component.
    connections : sequence of (str, str)
        Pairs of an output and an input.
    units : str
        Factor of a connection between different units.
    """

    parameters: dict[str, dict[str, Any]]
    connections: tuple[tuple[str, str], ...]
    units: str = ""

    def mass(self, component: str) -> float:
        """Return the mass of a component, kg."""
        return float(self.parameters[component].get("mass", 1.0))


UPPER = {"contact[1].law": "restitution", "contact[1].restitution": 0.6}
LOWER = {
    "contact[2].law": "kelvin_voigt",
    "contact[2].side": "lower",
    "contact[2].stiffness": 2e3,
    "contact[2].damping": 1.0,
}
# the force begins at 0, since FMPy gives inputs the value 0 in the first step
FORCED = {"forcing.amplitude": 3.0, "forcing.angular_frequency": 1.7, "forcing.phase": -np.pi / 2}
PAIRS = {
    "one rides on the other": Pair(
        {
            "a": {
                "mass": 2.0,
                "stiffness": 8.0,
                "damping": 0.2,
                **FORCED,
                **UPPER,
                "contact[1].position": 0.3,
            },
            "b": {"stiffness": 30.0, "damping": 0.1, **UPPER, **LOWER, "contact[1].position": 0.05}
            | {"contact[2].position": -0.04},
        },
        (("a.acceleration", "b.base_acceleration"),),
    ),
    "a spring between them": Pair(
        {
            "a": {
                "mass": 2.0,
                "stiffness": 9.0,
                "damping": 0.2,
                **FORCED,
                **UPPER,
                "contact[1].position": 0.3,
            },
            "b": {"stiffness": 4.0, "damping": 0.1, **UPPER, **LOWER, "contact[1].position": 0.05}
            | {"contact[2].position": -0.04},
        },
        (("a.displacement", "b.force"), ("b.displacement", "a.force")),
        units="N/m",
    ),
}


@dataclass(frozen=True, slots=True)
class Coupled:
    """Two FMUs that a tool couples, and their results in our own run.

    Attributes
    ----------
    fmus : mapping of str to Path
        The FMU of each component.
    outputs : tuple of str
        All outputs of both that the tool can read, each with its component.
    rows : ndarray, shape (step, output)
        The outputs after each step.
    """

    fmus: dict[str, Path]
    outputs: tuple[str, ...]
    rows: Rows


def made_pair(name: str, tool: Tool, fmi: str, folder: Path) -> Coupled:
    """Return the FMUs of a pair, and the outputs readable by a tool, by our own importer's Jacobi exchange."""
    still = {"displacement_start": 0.0}  # without a start, an export that nothing moves starts displaced
    fmus = {
        one: export_fmu("oscillator", folder / f"{one}.fmu", fmi=fmi, starts=still | parameters)
        for one, parameters in PAIRS[name].parameters.items()
    }
    outputs = tuple(
        f"{one}.{output}"
        for one, path in fmus.items()
        for output in outputs_of(path)
        if fmi not in tool.without_integers or described(str(path))[output][1] != "integer"
    )
    found = pair_run(name, outputs, folder)
    rows = np.column_stack([found[output] for output in outputs])
    return Coupled(
        fmus, outputs, after_exchange(rows, outputs, PAIRS[name]) if tool.exchanges_first else rows
    )


def pair_run(name: str, outputs: Sequence[str], folder: Path) -> dict[str, Rows]:
    """Return outputs of a pair after each step by our own importer, before the values of the step are exchanged."""
    pair = PAIRS[name]
    gain = {"gain": 1.0, "gain_unit": pair.units} if pair.units else {}
    scene = Scene.from_dict(
        {
            "component": {one: {"fmu": "Oscillator", "parameters": p} for one, p in pair.parameters.items()},
            "connection": [{"from": source, "to": sink, **gain} for source, sink in pair.connections],
            "record": {"recorded_time": COUNT / RATE, "variables": list(outputs), "rate": RATE},
            "execution": {"how": "coupled", "macro_step": 1.0 / RATE, "exchange": "jacobi"},
        }
    )
    run_scene(scene, folder / "pair.nc")
    with open_dataset(folder / "pair.nc") as run:
        samples = run.vibroimpact.samples()
        return {output: samples[dataset_name(output)].values[1 : COUNT + 1] for output in outputs}


def after_exchange(rows: Rows, outputs: Sequence[str], pair: Pair) -> Rows:
    """Return the rows of a tool that exchanges values before it writes a row.

    A force on a free mass changes its acceleration at once, by the change of the force over the mass. No other output
    of these bodies follows an input at once. The absolute acceleration does not depend on the base's acceleration, and
    no body is held by a stop.
    """
    rows = rows.copy()
    for source, sink in pair.connections:
        component, _, variable = sink.partition(".")
        if variable == "force":
            change = np.diff(rows[:, outputs.index(source)], prepend=0.0)
            rows[:, outputs.index(f"{component}.acceleration")] += change / pair.mass(component)
    return rows


def difference(rows: Rows, expected: Rows) -> float:
    """Return the largest difference, relative to the largest value of the same output, or absolute where that is 0."""
    largest = np.abs(expected).max(axis=0)
    return float(np.max(np.abs(rows - expected).max(axis=0) / np.where(largest > 0.0, largest, 1.0)))
