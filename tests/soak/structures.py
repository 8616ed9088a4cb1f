"""Random scenes of several bodies of every kind: energy balances, every run ends, nothing is beyond a rigid stop.

Scenes of free oscillators that meet only each other run as components, too: the first impacts are the same. Odd seeds
have forces of any signals, moving stops and growing motions. Their events stay the same where the run is cut or sampled
at another rate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from support.balances import energy_problem, limits_of, room_problem
from support.cut_recordings import problem_of_cuts
from support.drawn_forces import forced_structure, stop_motion
from support.drawn_structures import drawn_structure

import vibroimpact as vi
from vibroimpact.analysis.dataset.naming import file_name_of
from vibroimpact.orchestrator.run.dataset import further_points
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.body_models.structure import label_of

CASES = 20_000
SAMPLE = 6
SECONDS = 20.0
#: Rounding of a displacement, m.
ROUNDING = 1e-11
#: Impacts that two forms share before their rounding parts them, and the largest difference of their times.
SHARED, APART = 6, 1e-8
#: Another rate of samples, 1/s, and impacts in all below which rounding is not multiplied to `FINAL` of the state.
OTHER_RATE, FEW, FINAL = 2.3, 12, 1e-7
#: Largest factor by which a motion that grows multiplies rounding in a comparison of states.
MOST_GROWTH = 1e4
#: Slowest impact, m/s, that cannot be one of those that rounding makes a touch or none.
FAINT = 1e-5
#: Impacts at the end of a run that may bounce for ever.
LAST = 100
#: Speed of faint impacts, m/s, and most of them within a time, s, that rounding may drive.
FAINTEST, MOST_FAINTEST, ONE_END = 1e-8, 500, 1e-3
#: Time of the last of them over that of the first, up to which they are chatters of several contacts that end together.
DECAYED = 0.1
IMPACT_LIMIT, ERROR, UNBOUNDED = 2, 3, 6
CRUSHED = "expected room between their stops"
"""End of a run between stops of which one moves onto the other."""


def check(seed: int) -> str | None:
    """Return the fault of the scene of a seed."""
    return fault(seed, forced_structure(seed) if seed % 2 else drawn_structure(seed))


def fault(seed: int, tables: dict[str, Any]) -> str | None:
    """Return the fault of a scene; odd seeds compare its run with those that are cut."""
    is_forced, scene = bool(seed % 2), Scene.from_dict(tables)
    found = vi.run(scene)
    return (
        _outcome_problem(tables, found)
        or energy_problem(tables, found)
        or room_problem(tables, scene, found)
        or _extremes_problem(scene, found)
        or _rounding_problem(tables, found)
        or (_repeats_problem(seed, tables, scene, found) if is_forced else _components_problem(tables, found))
    )


def _outcome_problem(tables: dict[str, Any], found: xr.Dataset) -> str | None:
    outcome, message = int(found.outcome), str(found.message.item())
    moves = any(stop_motion(stop, np.ones(1)).any() for stop in tables.get("stop", []))
    if outcome < ERROR or outcome == UNBOUNDED or (outcome == ERROR and moves and CRUSHED in message):
        return None
    return f"outcome {outcome}: {message}"


def _extremes_problem(scene: Scene, found: xr.Dataset) -> str | None:
    """Return the observed point whose samples exceed its extremes.

    A run that ends early has no row of its last period, and is not compared.
    """
    if int(found.outcome) >= IMPACT_LIMIT:
        return None
    names = ("", *(f"_{name}" for name in further_points(scene)))
    for observed, name in zip(scene.record.observed, names, strict=False):
        column = f"displacement_max{name}"
        if column not in found or not found.sizes["period"]:
            continue
        way = found[file_name_of(f"displacement[{label_of(observed)}]")].values
        high, low = found[column].values.max(), found[column.replace("max", "min")].values.min()
        if way.max() > high + ROUNDING or way.min() < low - ROUNDING:
            return f"{label_of(observed)}: samples from {way.min()} to {way.max()}, extremes {low} and {high}"
    return None


def _rounding_problem(tables: dict[str, Any], found: xr.Dataset) -> str | None:
    """Return the speed of impacts that rounding alone drives, of contacts that are not elastic."""
    elastic = [k for k, each in enumerate(limits_of(tables), start=1) if each.get("restitution") == 1.0]
    loses = ~np.isin(found.impact_contact.values, elastic)
    times = found.impact_time.values[loses & (found.impact_velocity.values < FAINTEST)]
    for first in np.flatnonzero(times[MOST_FAINTEST:] - times[:-MOST_FAINTEST] < ONE_END).tolist():
        row = times[first : first + MOST_FAINTEST]
        if row[-1] - row[-LAST] > DECAYED * (row[LAST] - row[0]):
            return f"more than {MOST_FAINTEST} impacts below {FAINTEST} m/s within {ONE_END} s do not end"
    return None


def _bounces_for_ever(tables: dict[str, Any], found: xr.Dataset) -> bool:
    """Whether a run ended in impacts of elastic contacts, as low as the rounding of many impacts before left them."""
    elastic = [k for k, each in enumerate(limits_of(tables), start=1) if each.get("restitution") == 1.0]
    contacts, speeds = found.impact_contact.values[-LAST:], found.impact_velocity.values[-LAST:]
    return len(contacts) == LAST and bool(np.isin(contacts, elastic).all() and (speeds < FAINT).all())


def _repeats_problem(seed: int, tables: dict[str, Any], scene: Scene, found: xr.Dataset) -> str | None:
    """Return the difference between the run and one of another rate, or one that is cut."""
    if int(found.outcome) not in (0, 1):
        return None
    other = vi.run(scene.with_values({"record.time_series.rate": OTHER_RATE}))
    if int(other.outcome) != int(found.outcome):
        if int(other.outcome) == IMPACT_LIMIT and _bounces_for_ever(tables, other):
            return None
        return f"outcome {int(found.outcome)}, at another rate {int(other.outcome)}: {other.message.item()}"
    speeds = found.impact_velocity.values
    if found.sizes["impact"] + found.sizes["stick"] < FEW and not (speeds < FAINT).any():
        one, again = found.final_state.values, other.final_state.values
        allowed = FINAL * _growth(scene, float(found.time[-1]) if found.sizes["sample"] else 1.0)
        if not np.allclose(one, again, rtol=0.0, atol=allowed * (np.abs(one).max() + 1e-3)):
            return f"final state {one.tolist()}, at another rate {again.tolist()}"
    share = np.random.default_rng(seed).random()
    problem = problem_of_cuts(scene, "fused", share, float(found.time[-1]) if found.sizes["sample"] else 1.0)
    return None if problem is None else f"cut: {problem}"


def _growth(scene: Scene, time: float) -> float:
    """Return the factor by which the free motion grows within a time, at most `MOST_GROWTH`."""
    assert isinstance(scene.body, StructureBody)
    assembly = scene.body.assembly
    natural, count = np.array(assembly.frequencies), len(assembly.frequencies)
    flow = np.block(
        [[np.zeros((count, count)), np.eye(count)], [-np.diag(natural * np.abs(natural)), -assembly.damping]]
    )
    rate = max(0.0, float(np.linalg.eigvals(flow).real.max()))
    return float(min(np.exp(rate * time), MOST_GROWTH))


def _components_problem(tables: dict[str, Any], found: xr.Dataset) -> str | None:
    """Compare the first impacts with those of components, where free oscillators meet only each other rigidly.

    Components that rest on each other overlap and part by their steps: impacts after the first rest are not compared.
    """
    bodies, contacts = tables["body"], tables["contact"]
    plain = all("kind" not in body for body in bodies) and not tables.keys() & {"link", "stop", "forcing"}
    if not plain or any("law" in contact or contact["clearance"] < 1e-3 for contact in contacts):
        return None
    owners = [tuple(contact["between"]) for contact in contacts]
    if len(owners) != len({frozenset(pair) for pair in owners}):
        return None
    component = {
        body["name"]: {
            "fmu": "Oscillator",
            "parameters": {key: value for key, value in body.items() if key != "name"},
        }
        for body in bodies
        if any(body["name"] in pair for pair in owners)
    }
    coupled = Scene.from_dict(
        {
            "scene": tables["scene"],
            "component": component,
            "contact": contacts,
            "record": {"recorded_time": tables["record"]["recorded_time"]},
            "execution": {"macro_step": 0.5},
        }
    )
    other = vi.run(coupled)
    last = float(found.stick_start.values.min(initial=np.inf)) + APART
    ours, theirs = (
        times[times <= last][:SHARED] for times in (found.impact_time.values, other.impact_time.values)
    )
    if len(ours) != len(theirs) or not np.allclose(ours, theirs, rtol=0.0, atol=APART):
        return f"impacts at {ours}, those of components at {theirs}"
    return None
