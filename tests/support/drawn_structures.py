"""Random scenes of several bodies of every kind, with links, contacts, stops, forces and observed points."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroimpact.orchestrator.scene.body_models.structure import observed_variables

Tables = dict[str, Any]
BOUNDARIES = ("clamped-free", "pinned-pinned", "clamped-clamped", "clamped-pinned")
SAMPLES = 60
MOST_IMPACTS = 2000
ENERGIES = ("kinetic", "potential", "forcing_work", "damping_loss", "contact_loss")


def _pick(random: np.random.Generator, *values: Any) -> Any:
    return values[int(random.integers(len(values)))]


def _number(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.round(random.uniform(low, high), 3))


def _numbers(random: np.random.Generator, low: float, high: float, count: int) -> list[float]:
    return [_number(random, low, high) for _ in range(count)]


def _body(random: np.random.Generator, name: str) -> tuple[Tables, list[str]]:
    """Return a body and the points of it that move."""
    kind = _pick(random, "oscillator", "oscillator", "chain", "beam")
    if kind == "oscillator":
        springs = {"stiffness": _pick(random, 0.0, 1.0, _number(random, 0.1, 30.0))}
        springs |= {"damping": _pick(random, 0.0, _number(random, 0.0, 0.3))}
        start = {"velocity_start": _pick(random, 0.0, _number(random, -1.0, 1.0))}
        return {"name": name, "mass": _number(random, 0.1, 3.0)} | springs | start, [name]
    if kind == "chain":
        count = int(random.integers(1, 4))
        springs = {
            "stiffnesses": _numbers(random, 0.1, 5.0, count),
            "dampings": _numbers(random, 0.0, 0.2, count),
        }
        masses = {"masses": _numbers(random, 0.1, 2.0, count)}
        return {"name": name, "kind": "chain"} | masses | springs, [
            f"{name}.{i}" for i in range(1, count + 1)
        ]
    beam = {
        "length": 1.0,
        "mass_per_length": _number(random, 0.5, 2.0),
        "flexural_rigidity": _number(random, 0.1, 2.0),
    }
    beam |= {
        "boundary": _pick(random, *BOUNDARIES),
        "modes": int(random.integers(1, 4)),
        "damping_ratio": 0.02,
    }
    return {"name": name, "kind": "beam"} | beam, [f"{name}.{place}" for place in ("0.3", "0.55", "0.8")]


def _law(random: np.random.Generator) -> Tables:
    law = _pick(random, "restitution", "restitution", "restitution", "kelvin_voigt", "hertz", "hunt_crossley")
    if law == "restitution":
        return {"restitution": _pick(random, 0.0, 0.5, 0.9, 1.0, _number(random, 0.0, 1.0))}
    found = {"law": law, "stiffness": float(10.0 ** random.integers(0, 5))}
    return found if law == "hertz" else found | {"damping": _pick(random, 0.0, 0.1, 1.0)}


def _pair(random: np.random.Generator, points: list[str]) -> list[str]:
    one, other = random.choice(len(points), 2, replace=False)
    return [points[one], points[other]]


def _meeting(random: np.random.Generator, pair: list[str]) -> list[Tables]:
    """Return a contact of two points, or two contacts, a cavity."""
    if random.random() < 0.3:
        both = (pair, pair[::-1])
        return [{"between": each, "clearance": _number(random, 0.01, 0.3)} | _law(random) for each in both]
    clearance = _pick(random, 0.0, 1e-9, _number(random, 0.01, 0.3), _number(random, 0.01, 0.3))
    return [{"between": pair, "clearance": clearance} | _law(random)]


def drawn_structure(seed: int) -> Tables:
    """Return the tables of a valid scene: two to four bodies, at rest or moving, with room between them."""
    random = np.random.default_rng(seed)
    names = ["a", "b", "c", "d"][: int(random.integers(2, 5))]
    made = [_body(random, name) for name in names]
    points = [point for _, of_body in made for point in of_body]
    links = [
        {"between": _pick(random, _pair(random, points), [points[0], "ground"])}
        | {"stiffness": _number(random, 0.0, 5.0), "damping": _pick(random, 0.0, _number(random, 0.0, 0.3))}
        for _ in range(int(random.integers(0, 4)))
    ]
    met = {frozenset(_pair(random, points)) for _ in range(int(random.integers(1, 5)))}
    contacts = [contact for pair in sorted(map(sorted, met)) for contact in _meeting(random, pair)]
    limited = {
        (_pick(random, *points), _pick(random, "upper", "lower")) for _ in range(int(random.integers(0, 3)))
    }
    stops = [
        {"at": at, "side": side, "position": _number(random, 0.02, 0.5) * (1.0 if side == "upper" else -1.0)}
        | _law(random)
        for at, side in sorted(limited)
    ]
    observed = [_pick(random, *points), _pair(random, points)][: int(random.integers(0, 3))]
    names_of_series = [f"energy.{name}" for name in ENERGIES]
    names_of_series += [f"contact_displacement[{k}]" for k in range(1, len(stops) + len(contacts) + 1)]
    names_of_series += [name for name in observed_variables(observed) if name.startswith("displacement")]
    tables: Tables = {
        "scene": {"units": "nondimensional"},
        "body": [body for body, _ in made],
        "contact": contacts,
    }
    tables |= ({"link": links} if links else {}) | ({"stop": stops} if stops else {})
    force = {"amplitude": _number(random, 0.0, 2.0), "angular_frequency": _number(random, 0.3, 3.0)}
    series = {"rate": 6.0, "variables": names_of_series}
    record: Tables = {"time_series": series} | ({"observed": observed} if observed else {})
    if random.random() < 0.7:
        base = {"kind": "base_acceleration"} if random.random() < 0.3 else {"at": _pick(random, *points)}
        tables |= {"forcing": base | force}
        record |= {"transient_periods": int(random.integers(0, 3)), "recorded_periods": 2}
    else:
        record |= {"recorded_time": 8.0}
    return tables | {"record": record, "execution": {"impact_limit": MOST_IMPACTS}}
