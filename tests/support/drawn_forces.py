"""Random scenes of all forces: sines, constants, chirps, pulses, tables, noise; stops that move; motions that grow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from support.drawn_structures import (
    ENERGIES,
    KINDS,
    Tables,
    drawn_structure,
    law_of,
    number,
    numbers,
    pick,
)
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody

LENGTH = 8.0
"""Duration of a record, s, beside common periods of many periods of the first sine."""
SIGNALS = ("sine", "sine", "sine", "sine", "constant", "chirp", "pulse", "table", "random")
Floats = NDArray[np.float64]


def forced_structure(seed: int, kinds: Sequence[str] = KINDS) -> Tables:
    """Return the tables of a valid scene whose forces are of any signals; stops may move, and motions may grow."""
    random = np.random.default_rng([seed, 51])
    is_lone = random.random() < 0.25 and kinds == KINDS
    tables = _lone_body(random) if is_lone else drawn_structure(seed, kinds)
    if random.random() < 0.3:
        _feed(random, tables)
    tables["forcing"] = [_force(random, tables) for _ in range(int(random.integers(1 + is_lone, 7)))]
    sines = [force for force in tables["forcing"] if force["signal"] == "sine"]
    natural = _natural_frequencies(tables) if sines else []
    for force in sines:
        force["angular_frequency"] = _frequency(random, sines[0].get("angular_frequency", 1.0), natural)
    used = [force["angular_frequency"] for force in sines]
    for stop in tables.get("stop", []):
        if random.random() < 0.5:
            _move(random, stop, used)
    kept = {key: tables["record"][key] for key in ("time_series", "observed") if key in tables["record"]}
    tables["record"] = kept | _duration(random, tables)
    return tables


def stop_motion(stop: Tables, times: Floats) -> Floats:
    """Return the displacement of a stop from its position at instants of a run, m."""
    angles = stop.get("motion_angular_frequency", 0.0) * times + stop.get("motion_phase", 0.0)
    moved: Floats = stop.get("velocity", 0.0) * times + stop.get("motion_amplitude", 0.0) * np.cos(angles)
    if "motion_times" not in stop:
        return moved
    knots = np.array(stop["motion_times"])
    spline = CubicSpline(knots, stop["motion_values"], bc_type="natural")
    inside = np.clip(times, knots[0], knots[-1])
    moved += spline(inside) + spline(inside, 1) * (times - inside)
    return moved


def _lone_body(random: np.random.Generator) -> Tables:
    """Return a `[body]` with its stops, an oscillator or a chain."""
    count = int(random.choice([1, 1, 2, 3]))
    stiffness = pick(random, 0.0, 1.0, 4.0)
    body: Tables = {"mass": number(random, 0.1, 3.0), "stiffness": stiffness}
    body["damping"] = pick(random, 0.0, 0.05) if stiffness else 0.0
    if count > 1:
        springs = {
            "stiffnesses": numbers(random, 0.1, 5.0, count),
            "dampings": [pick(random, 0.0, 0.05)] * count,
        }
        body = {"kind": "chain", "masses": numbers(random, 0.1, 2.0, count)} | springs
    stops = [
        {"side": side, "position": sign * number(random, 0.02, 0.5)} | law_of(random)
        for side, sign in (("upper", 1.0), ("lower", -1.0))[: int(random.integers(1, 3))]
    ]
    names = [f"energy.{name}" for name in ENERGIES]
    names += [f"contact_displacement[{k}]" for k in range(1, len(stops) + 1)]
    whole = drawn_structure(0)
    record = {"time_series": {"rate": whole["record"]["time_series"]["rate"], "variables": names}}
    kept = {name: whole[name] for name in ("scene", "execution")}
    return {"body": body, "stop": stops, "record": record} | kept


def _bodies(tables: Tables) -> list[Tables]:
    body = tables["body"]
    return body if isinstance(body, list) else [body]


def _feed(random: np.random.Generator, tables: Tables) -> None:
    """Make a spring or a dashpot negative, of a body that has one by its name, or of a link."""
    owners = [each for each in _bodies(tables) if each.get("kind") not in ("beam", "modes")]
    owners += tables.get("link", [])
    if not owners:
        return
    owner, key = pick(random, *owners), pick(random, "stiffness", "damping")
    value = -number(random, 0.01, 0.5)
    if owner.get("kind") != "chain":
        owner[key] = value
        return
    row = owner["stiffnesses" if key == "stiffness" else "dampings"]
    row[int(random.integers(len(row)))] = value


def _natural_frequencies(tables: Tables) -> list[float]:
    """Return the natural angular frequencies of the body that are no zeros, rad/s."""
    free = {name: tables[name] for name in tables if name not in ("forcing", "record")}
    scene = Scene.from_dict(free | {"record": {"recorded_time": 1.0}})
    if isinstance(scene.body, StructureBody):
        return [float(w) for w in scene.body.assembly.frequencies if w > 1e-3]
    body = tables["body"]
    if "masses" not in body:
        return [math.sqrt(body["stiffness"] / body["mass"])] if body["stiffness"] > 0.0 else []
    return []


def _frequency(random: np.random.Generator, first: float, natural: Sequence[float]) -> float:
    """Return the frequency of a sine: any, a simple ratio of the first sine's, or a natural one, or nearly so."""
    kind = random.random()
    if kind < 0.3:
        return float(first * Fraction(int(random.integers(1, 6)), int(random.integers(1, 4))))
    if kind < 0.6 and natural:
        return float(pick(random, *natural) * (1.0 + pick(random, 0.0, 0.0, 1e-12, 1e-6, 1e-3)))
    return float(10.0 ** random.uniform(-0.3, 1.0))


def _force(random: np.random.Generator, tables: Tables) -> Tables:
    signal = pick(random, *SIGNALS)
    force = {"signal": signal, "amplitude": number(random, -1.0, 1.0)} | _place(random, tables)
    start, duration = pick(random, 0.0, number(random, -1.0, 5.0)), number(random, 0.05, 6.0)
    keys = {
        "sine": {"phase": number(random, -4.0, 4.0)},
        "constant": {},
        "chirp": _chirp(random) | {"start": start, "duration": duration},
        "pulse": _pulse(random, duration) | {"start": start, "duration": duration},
        "table": _table(random) | {"start": start, "interpolation": pick(random, "linear", "cubic")},
        "random": _noise(random) | pick(random, {}, {"start": start, "duration": duration}),
    }
    return force | dict(keys[signal])


def _place(random: np.random.Generator, tables: Tables) -> Tables:
    if random.random() < 0.3 or "masses" in tables["body"]:
        return {"kind": "base_acceleration"}
    if not isinstance(tables["body"], list):
        return {}
    body = pick(random, *tables["body"])
    ends = {
        "chain": f".{int(random.integers(len(body.get('masses', [1]))) + 1)}",
        "beam": ".0.55",
        "modes": ".p",
    }
    return {"at": body["name"] + ends.get(body.get("kind", ""), "")}


def _chirp(random: np.random.Generator) -> Tables:
    low, high = number(random, 0.1, 10.0), number(random, 0.1, 60.0)
    ends = {"angular_frequency": low, "end_angular_frequency": pick(random, high, low)}
    return ends | {"spacing": pick(random, "linear", "logarithmic"), "phase": number(random, -4.0, 4.0)}


def _pulse(random: np.random.Generator, duration: float) -> Tables:
    shape = pick(random, "half_sine", "triangle", "trapezoid")
    rise = {"rise": duration * pick(random, 0.0, 0.3, 0.5)} if shape == "trapezoid" else {}
    return {"shape": shape} | rise


def _knots(random: np.random.Generator, scale: float) -> tuple[list[float], list[float]]:
    count = int(random.integers(2, 12))
    steps = np.round(10.0 ** random.uniform(-1.5, 0.5, count), 4)
    return np.cumsum(steps).tolist(), numbers(random, -scale, scale, count)


def _table(random: np.random.Generator) -> Tables:
    return dict(zip(("times", "values"), _knots(random, 2.0), strict=True))


def _noise(random: np.random.Generator) -> Tables:
    low = number(random, 0.0, 3.0)
    band = [low, low + number(random, 1.0, 20.0)]
    density = {"density": [[band[0], 0.1], [band[1], number(random, 0.1, 1.0)]]}
    noise: Tables = {"seed": int(random.integers(1000))}
    return noise | dict(pick(random, {"band": band}, density))


def _move(random: np.random.Generator, stop: Tables, used: Sequence[float]) -> None:
    """Move a stop; at time 0 it is at its position of before."""
    motions = random.random(3) < 0.5
    if motions[0]:
        away = 1.0 if stop["side"] == "upper" else -1.0
        stop["velocity"] = away * number(random, -0.005, 0.05)
    if motions[1]:
        stop["motion_amplitude"] = number(random, -0.1, 0.1)
        own = float(10.0 ** random.uniform(-0.3, 1.0))
        stop["motion_angular_frequency"] = pick(random, *used, own)
        stop["motion_phase"] = pick(random, 0.0, number(random, -4.0, 4.0))
    if motions[2]:
        stop["motion_times"], stop["motion_values"] = _knots(random, 0.05)
    stop["position"] -= float(stop_motion(stop, np.zeros(1))[0])


def _duration(random: np.random.Generator, tables: Tables) -> Tables:
    """Return the keys of a duration: in periods of a clock, if a force or a stop has a sine."""
    clocks = [force["angular_frequency"] for force in tables["forcing"] if force["signal"] == "sine"]
    clocks += [
        stop["motion_angular_frequency"] for stop in tables.get("stop", []) if "motion_amplitude" in stop
    ]
    if not clocks:
        return {"transient_time": pick(random, 0.0, 1.3), "recorded_time": LENGTH}
    periods = max(1, round(LENGTH * clocks[0] / (2.0 * math.pi) / 2.0))
    return {"transient_periods": int(random.integers(0, 2)), "recorded_periods": periods}
