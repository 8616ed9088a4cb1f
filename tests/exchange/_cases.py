"""What is exchanged: bodies with stops, each a scene, the FMU exported of it, and the dataset of its own run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal, build_replay
from vibroimpact.orchestrator.campaign import run_scene
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.scene import Scene

RATE = 512.0
"""Samples per second: a step has no rounding, neither in binary nor in the nanoseconds that libcosim counts."""

COUNT = 4000
OUTPUTS = ("displacement", "velocity")

Rows = NDArray[np.float64]

STOPS = [
    {"position": 0.1, "law": "restitution", "restitution": 0.6},
    {"position": -0.15, "side": "lower", "law": "kelvin_voigt", "stiffness": 2e3, "damping": 1.0},
]
BODIES: dict[str, dict[str, Any]] = {
    "oscillator": {
        "body": {"mass": 2.0, "stiffness": 8.0, "damping_ratio": 0.02},
        "forcing": {"amplitude": 3.0, "angular_frequency": 1.7},
        "stop": STOPS,
    },
    "chain of 3": {
        "body": {"kind": "chain", "masses": [1.0, 2.0, 1.5], "stiffnesses": [40.0, 20.0, 30.0]},
        "forcing": {"amplitude": [0.0, 2.0, 1.0], "angular_frequency": 2.0},
        "stop": [{**stop, "mass": 2} for stop in STOPS],
    },
    "beam of 4 modes with a stop": {
        "body": {
            "kind": "beam",
            "modes": 4,
            "length": 0.25,
            "youngs_modulus": 7e10,
            "density": 2700.0,
            "width": 0.02,
            "thickness": 0.002,
            "damping_ratio": 0.02,
        },
        "forcing": {"amplitude": 0.5, "angular_frequency": 150.0},
        "stop": [{"position": 0.004, "law": "restitution", "restitution": 0.6}],
    },
}
IMPACT_STOP, REPLAY = "impact stop", "replay"
NAMES = (*BODIES, IMPACT_STOP, REPLAY)
ANSWERS = ("applied_force", "applied_stiffness", "applied_damping")
PLAYED = ("base", "base_rate", "sparse", "sparse_rate")


def outputs(name: str) -> tuple[str, ...]:
    """Return the outputs that are compared."""
    return {IMPACT_STOP: ANSWERS, REPLAY: PLAYED}.get(name, OUTPUTS)


def made(name: str, fmi: str, folder: Path, platform: str | None = None) -> tuple[Path, Rows]:
    """Return the FMU of a case, and what its outputs are after each step by our own run."""
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
        answer = [1e4 * 0.01 + 3.0 * 0.5, 1e4, 3.0]
        export_fmu("impact_stop", path, fmi=fmi, starts=starts, platform=platform)
        return path, np.tile(answer, (COUNT, 1))
    scene = _scene(BODIES[name])
    run_scene(scene, folder / "run.nc")
    samples = open_dataset(folder / "run.nc").vibroimpact.samples()
    rows = np.column_stack([samples[output].values for output in OUTPUTS])[1 : COUNT + 1]
    return export_scene(scene, path, fmi=fmi, platform=platform), rows


def _replay(fmi: str, path: Path, platform: str | None) -> tuple[Path, Rows]:
    """Return an FMU of noise at twice the rate with a gap, and of a slow channel on instants of its own."""
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
    rows = (bridged[now], (np.diff(bridged) * 2.0 * RATE)[now], np.interp(at, instants, slow), slopes)
    return build_replay(signals, path, fmi=fmi, platform=platform), np.column_stack(rows)


@dataclass(frozen=True, slots=True)
class Pair:
    """Two oscillators with stops that are coupled, by connections that carry what is known at the start of a step.

    Attributes
    ----------
    parameters : mapping of str to mapping of str to number
        Start values of each.
    connections : sequence of (str, str)
        From an output to an input.
    units : str
        What a connection between different units is multiplied by.
    """

    parameters: dict[str, dict[str, Any]]
    connections: tuple[tuple[str, str], ...]
    units: str = ""


UPPER = {"contact[1].law": "restitution", "contact[1].restitution": 0.6}
LOWER = {
    "contact[2].law": "kelvin_voigt",
    "contact[2].side": "lower",
    "contact[2].stiffness": 2e3,
    "contact[2].damping": 1.0,
}
# the force begins at 0, since FMPy gives inputs 0 in the first step
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
PAIR_OUTPUTS = tuple(f"{name}.{output}" for name in "ab" for output in OUTPUTS)


def made_pair(name: str, fmi: str, folder: Path) -> tuple[dict[str, Path], Rows]:
    """Return the FMUs of a pair, and what its outputs are after each step of our own importer's Jacobi exchange."""
    pair = PAIRS[name]
    gain = {"gain": 1.0, "gain_unit": pair.units} if pair.units else {}
    scene = Scene.from_dict(
        {
            "component": {one: {"fmu": "Oscillator", "parameters": p} for one, p in pair.parameters.items()},
            "connection": [{"from": source, "to": sink, **gain} for source, sink in pair.connections],
            "record": {"recorded_time": COUNT / RATE, "variables": list(PAIR_OUTPUTS), "rate": RATE},
            "execution": {"how": "coupled", "macro_step": 1.0 / RATE, "exchange": "jacobi"},
        }
    )
    run_scene(scene, folder / "pair.nc")
    samples = open_dataset(folder / "pair.nc").vibroimpact.samples()
    rows = np.column_stack([samples[output.replace(".", "_")].values for output in PAIR_OUTPUTS])[
        1 : COUNT + 1
    ]
    still = {"displacement_start": 0.0}  # else an export that nothing moves starts displaced
    fmus = {
        one: export_fmu("oscillator", folder / f"{one}.fmu", fmi=fmi, starts=still | parameters)
        for one, parameters in pair.parameters.items()
    }
    return fmus, rows


def _scene(tables: dict[str, Any]) -> Scene:
    period = 2.0 * np.pi / tables["forcing"]["angular_frequency"]
    record = {
        "recorded_periods": int(np.ceil((COUNT + 1) / RATE / period)),
        "time_series": {"rate": RATE, "variables": list(OUTPUTS)},
    }
    return Scene.from_dict({**tables, "record": record})


def difference(rows: Rows, expected: Rows) -> float:
    """Return the largest difference, as a part of the largest value of the same output."""
    return float(np.max(np.abs(rows - expected).max(axis=0) / np.abs(expected).max(axis=0)))
