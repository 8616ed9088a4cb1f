"""Random bodies, stops and forcing as exported FMUs: FMPy, with no value set, reproduces the scene's run."""

from __future__ import annotations

import math
import random
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import simulate_fmu

from vibroimpact.analysis.dataset import Outcome, open_dataset
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene

CASES, SAMPLE = 1000, 2
SECONDS = 60.0
SAMPLES = 200
MOST_IMPACTS = 6
"""Impacts up to which two runs with different steps are compared: beyond, rounding grows in chaotic motion."""
TOLERANCE = 1e-7
OUTPUTS = ("displacement", "velocity", "acceleration")


def check(seed: int) -> str | None:
    """Return the fault of the export of a random scene; None without one."""
    draw = random.Random(seed)
    tables = drawn_tables(draw)
    try:
        scene = Scene.from_dict(tables)
    except VibroimpactError as error:
        return f"{tables}: {error}"
    fmi = draw.choice(("2.0", "3.0"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run_scene(scene, folder / "run.nc")
        run = open_dataset(folder / "run.nc")
        if run["outcome"].item() not in (Outcome.ok, Outcome.stuck):
            return f"{tables}: outcome {run['outcome'].item()}: {run['message'].item()}"
        path = export_scene(scene, folder / "rig.fmu", fmi=fmi, enumerations=draw.random() < 0.3)
        again = export_fmu(scene.body.FMU, folder / "full.fmu", fmi=fmi, full=True)
        assert again.is_file()
        step = 1.0 / tables["record"]["time_series"]["rate"]
        done = simulate_fmu(
            str(path),
            output=[*OUTPUTS, *(f"contact[{k}].count" for k in range(1, len(scene.stops) + 1))],
            step_size=step,
            output_interval=step,
            stop_time=step * SAMPLES,
        )
        samples = run.vibroimpact.samples()
        return _difference(done, samples, len(scene.stops), tables)


def _difference(done: Any, samples: Any, stops: int, tables: dict[str, Any]) -> str | None:
    count = np.zeros(len(done))
    for k in range(1, stops + 1):
        count += done[f"contact[{k}].count"]
    length = min(SAMPLES, int(np.count_nonzero(count <= MOST_IMPACTS)))
    for output in OUTPUTS:
        ours, theirs = samples[output].values[:length], done[output][:length]
        scale = float(np.abs(ours).max(initial=1e-300))
        # a velocity jumps at an impact: a sample there shows the value before it or after it
        apart = np.sort(np.abs(ours - theirs) / scale)[: length - 2 * MOST_IMPACTS]
        if len(apart) and not float(apart[-1]) <= TOLERANCE:
            return f"{tables}: {output} differs by {apart[-1]:.2g} of its largest within {length} samples"
    return None


def drawn_tables(draw: random.Random) -> dict[str, Any]:
    """Return the tables of a scene of one body."""
    kind = draw.choice(("oscillator", "chain", "beam"))
    body, slowest, scale = {"oscillator": _oscillator, "chain": _chain, "beam": _beam}[kind](draw)
    tables: dict[str, Any] = {"body": body}
    if draw.random() < 0.7:
        speed = scale["length"] * slowest * draw.uniform(-2.0, 2.0)
        count = body.get("modes") or len(body.get("masses", ()))
        body["velocity_start"] = [speed / (k + 1) ** 2 for k in range(count)] if count else speed
    period = 2.0 * math.pi / slowest
    rate = draw.choice((20.0, 51.3)) / period
    record: dict[str, Any] = {"time_series": {"rate": rate, "variables": list(OUTPUTS)}}
    duration = (SAMPLES + 2) / rate
    if draw.random() < 0.7:
        angular_frequency = slowest * draw.uniform(0.3, 2.0)
        amplitude = scale["force"] * draw.uniform(0.2, 2.0)
        bending = scale["length"] * slowest**2
        tables["forcing"] = {"amplitude": amplitude, "angular_frequency": angular_frequency}
        if draw.random() < 0.4:
            # an acceleration that bends the body by about its length scale
            tables["forcing"] |= {"kind": "base_acceleration", "amplitude": bending * draw.uniform(0.2, 2.0)}
        elif kind == "chain":
            tables["forcing"]["amplitude"] = [amplitude * draw.choice((0.0, 1.0)) for _ in body["masses"]]
        record["recorded_periods"] = math.ceil(duration * angular_frequency / (2.0 * math.pi)) + 1
    else:
        record["recorded_time"] = duration
    # a second stop is on the other side: the farther of two on one side would be out of reach
    sides = draw.sample(("upper", "lower"), draw.randrange(3))
    gaps = (0.3, 0.8) if len(sides) == 2 else (0.0, 0.3, 0.8)
    tables["stop"] = [_stop(draw, side, draw.choice(gaps) * scale["length"], body, scale) for side in sides]
    tables["record"] = record
    return tables


def _stop(
    draw: random.Random, side: str, gap: float, body: dict[str, Any], scale: dict[str, float]
) -> dict[str, Any]:
    stop: dict[str, Any] = {"position": gap if side == "upper" else -gap, "side": side}
    stop["law"] = draw.choice(("restitution", "restitution", "kelvin_voigt", "hertz", "hunt_crossley"))
    if stop["law"] == "restitution":
        stop["restitution"] = draw.choice((0.0, 0.5, 0.9, 1.0))
    else:
        stop["stiffness"] = scale["stiffness"] * draw.choice((3.0, 100.0))
    if "masses" in body:
        stop["mass"] = draw.randrange(1, len(body["masses"]) + 1)
    if "modes" in body:
        stop["location"] = draw.choice((0.37, 0.8))
    return stop


def _oscillator(draw: random.Random) -> tuple[dict[str, Any], float, dict[str, float]]:
    mass, stiffness = draw.choice((0.01, 1.0, 30.0)), draw.choice((0.5, 4.0, 900.0))
    body = {"mass": mass, "stiffness": stiffness, "damping_ratio": draw.choice((0.0, 0.05, 1.0, 3.0))}
    return body, math.sqrt(stiffness / mass), {"force": stiffness, "length": 1.0, "stiffness": stiffness}


def _chain(draw: random.Random) -> tuple[dict[str, Any], float, dict[str, float]]:
    count = draw.randrange(1, 7)
    masses = [draw.choice((0.5, 1.0, 3.0)) for _ in range(count)]
    stiffnesses = [draw.choice((5.0, 20.0, 80.0)) for _ in range(count)]
    body = {"kind": "chain", "masses": masses, "stiffnesses": stiffnesses}
    return body, math.sqrt(5.0 / sum(masses)) / count, {"force": 5.0, "length": 0.5, "stiffness": 80.0}


def _beam(draw: random.Random) -> tuple[dict[str, Any], float, dict[str, float]]:
    boundary = draw.choice(("clamped-free", "clamped-clamped", "clamped-pinned", "pinned-pinned"))
    body = {
        "kind": "beam",
        "modes": draw.randrange(1, 7),
        "boundary": boundary,
        "length": 0.25,
        "width": 0.02,
    }
    body |= {"thickness": 0.002, "youngs_modulus": 7e10, "density": 2700.0, "damping_ratio": 0.02}
    return body, 165.0, {"force": 0.5, "length": 0.005, "stiffness": 200.0}
