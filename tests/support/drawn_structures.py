"""Random scenes of several bodies of every kind, with links, contacts, stops, forces and observed points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vibroimpact.orchestrator.scene.body_models.structure import observed_variables

Tables = dict[str, Any]
KINDS = ("oscillator", "oscillator", "chain", "beam")
OWN_KINDS = (*KINDS, *("modes",) * 4)
"""Kinds of bodies of a scene, each as often as it stands here; the second with bodies of one's own."""
BOUNDARIES = ("clamped-free", "pinned-pinned", "clamped-clamped", "clamped-pinned")
SAMPLES = 60
MOST_IMPACTS = 2000
ENERGIES = ("kinetic", "potential", "forcing_work", "damping_loss", "contact_loss")


def pick(random: np.random.Generator, *values: Any) -> Any:
    """Return one of some values."""
    return values[int(random.integers(len(values)))]


def number(random: np.random.Generator, low: float, high: float) -> float:
    """Return a number of three digits between two."""
    return float(np.round(random.uniform(low, high), 3))


def numbers(random: np.random.Generator, low: float, high: float, count: int) -> list[float]:
    """Return some numbers of three digits between two."""
    return [number(random, low, high) for _ in range(count)]


def _body(random: np.random.Generator, name: str, kinds: Sequence[str]) -> tuple[Tables, list[str]]:
    """Return a body and the points of it that move."""
    kind = pick(random, *kinds)
    if kind == "modes":
        return _own_body(random, name)
    if kind == "oscillator":
        springs = {"stiffness": pick(random, 0.0, 1.0, number(random, 0.1, 30.0))}
        springs |= {"damping": pick(random, 0.0, number(random, 0.0, 0.3))}
        start = {"velocity_start": pick(random, 0.0, number(random, -1.0, 1.0))}
        return {"name": name, "mass": number(random, 0.1, 3.0)} | springs | start, [name]
    if kind == "chain":
        count = int(random.integers(1, 4))
        springs = {
            "stiffnesses": numbers(random, 0.1, 5.0, count),
            "dampings": numbers(random, 0.0, 0.2, count),
        }
        masses = {"masses": numbers(random, 0.1, 2.0, count)}
        return {"name": name, "kind": "chain"} | masses | springs, [
            f"{name}.{i}" for i in range(1, count + 1)
        ]
    beam = {
        "length": 1.0,
        "mass_per_length": number(random, 0.5, 2.0),
        "flexural_rigidity": number(random, 0.1, 2.0),
    }
    beam |= {
        "boundary": pick(random, *BOUNDARIES),
        "modes": int(random.integers(1, 4)),
        "damping_ratio": 0.02,
    }
    return {"name": name, "kind": "beam"} | beam, [f"{name}.{place}" for place in ("0.3", "0.55", "0.8")]


def _own_body(random: np.random.Generator, name: str) -> tuple[Tables, list[str]]:
    """Return a body by its modes: rigid ones, equal ones, ones that feed energy, and coupled damping among them."""
    count = int(random.integers(1, 7))
    natural, ratios = numbers(random, 0.3, 20.0, count), numbers(random, -0.03, 0.1, count)
    natural[0] = pick(random, 0.0, natural[0], natural[0])
    natural[-1] = pick(random, natural[0], natural[-1], natural[-1])
    body: Tables = {"name": name, "kind": "modes", "angular_frequencies": natural}
    body |= pick(random, {}, {"damping_ratio": 0.02}, {"damping_ratio": ratios})
    if random.random() < 0.5:
        dashpots = random.normal(size=(count, pick(random, 1, count)))
        body["damping_matrix"] = (0.1 * dashpots @ dashpots.T).tolist()
    points = ("p", "q", "r")[: int(random.integers(1, 4))]
    body["shapes"] = {
        point: (pick(random, 0.05, 1.0, 3.0) * random.normal(size=count)).tolist() for point in points
    }
    body["participation"] = numbers(random, -1.0, 1.0, count)
    body |= pick(random, {}, {"velocity_start": [number(random, -1.0, 1.0)]})
    return body, [f"{name}.{point}" for point in points]


def law_of(random: np.random.Generator) -> Tables:
    """Return the keys of a law of a stop or a contact."""
    law = pick(random, "restitution", "restitution", "restitution", "kelvin_voigt", "hertz", "hunt_crossley")
    if law == "restitution":
        return {"restitution": pick(random, 0.0, 0.5, 0.9, 1.0, number(random, 0.0, 1.0))}
    found = {"law": law, "stiffness": float(10.0 ** random.integers(0, 5))}
    return found if law == "hertz" else found | {"damping": pick(random, 0.0, 0.1, 1.0)}


def _pair(random: np.random.Generator, points: list[str]) -> list[str]:
    one, other = random.choice(len(points), 2, replace=False)
    return [points[one], points[other]]


def _meeting(random: np.random.Generator, pair: list[str]) -> list[Tables]:
    """Return a contact of two points, or two contacts, a cavity."""
    if random.random() < 0.3:
        both = (pair, pair[::-1])
        return [{"between": each, "clearance": number(random, 0.01, 0.3)} | law_of(random) for each in both]
    clearance = pick(random, 0.0, 1e-9, number(random, 0.01, 0.3), number(random, 0.01, 0.3))
    return [{"between": pair, "clearance": clearance} | law_of(random)]


def drawn_structure(seed: int, kinds: Sequence[str] = KINDS) -> Tables:
    """Return the tables of a valid scene: two to four bodies, at rest or moving, with room between them."""
    random = np.random.default_rng(seed)
    names = ["a", "b", "c", "d"][: int(random.integers(2, 5))]
    made = [_body(random, name, kinds) for name in names]
    points = [point for _, of_body in made for point in of_body]
    links = [
        {"between": pick(random, _pair(random, points), [points[0], "ground"])}
        | {"stiffness": number(random, 0.0, 5.0), "damping": pick(random, 0.0, number(random, 0.0, 0.3))}
        for _ in range(int(random.integers(0, 4)))
    ]
    met = {frozenset(_pair(random, points)) for _ in range(int(random.integers(1, 5)))}
    contacts = [contact for pair in sorted(map(sorted, met)) for contact in _meeting(random, pair)]
    limited = {
        (pick(random, *points), pick(random, "upper", "lower")) for _ in range(int(random.integers(0, 3)))
    }
    stops = [
        {"at": at, "side": side, "position": number(random, 0.02, 0.5) * (1.0 if side == "upper" else -1.0)}
        | law_of(random)
        for at, side in sorted(limited)
    ]
    observed = [pick(random, *points), _pair(random, points)][: int(random.integers(0, 3))]
    names_of_series = [f"energy.{name}" for name in ENERGIES]
    names_of_series += [f"contact_displacement[{k}]" for k in range(1, len(stops) + len(contacts) + 1)]
    names_of_series += [name for name in observed_variables(observed) if name.startswith("displacement")]
    tables: Tables = {
        "scene": {"units": "nondimensional"},
        "body": [body for body, _ in made],
        "contact": contacts,
    }
    tables |= ({"link": links} if links else {}) | ({"stop": stops} if stops else {})
    force = {"amplitude": number(random, 0.0, 2.0), "angular_frequency": number(random, 0.3, 3.0)}
    series = {"rate": 6.0, "variables": names_of_series}
    record: Tables = {"time_series": series} | ({"observed": observed} if observed else {})
    if random.random() < 0.7:
        base = {"kind": "base_acceleration"} if random.random() < 0.3 else {"at": pick(random, *points)}
        tables |= {"forcing": base | force}
        record |= {"transient_periods": int(random.integers(0, 3)), "recorded_periods": 2}
    else:
        record |= {"recorded_time": 8.0}
    return tables | {"record": record, "execution": {"impact_limit": MOST_IMPACTS}}
