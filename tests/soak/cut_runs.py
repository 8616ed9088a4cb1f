"""Runs that are cut anywhere: impacts, contacts and rests of successive recordings add up to those of the whole run.

Bodies of every kind and law run fused and coupled, and many points run in lanes and in the loop. Other runs have bodies
that hit each other, or bodies of other tools. A cut meets open contacts, rest or chatter.
"""

from __future__ import annotations

import json
import random
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from support import fmu_factory
from support.cut_recordings import FAINT, MOST_EVENTS, counts_differ, problem_of_cuts, recorded

from vibroimpact.analysis.dataset.columns import RunColumns, columns_of
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.run.point import driver_of
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count

CASES, SAMPLE = 5000, 4
SECONDS = 60.0

FIRST_IMPACTS = 3
"""Impacts of a coupled run that are compared with those of the fused one."""
POINTS = 6
"""Points of a sweep."""
SCALE = 0.3
"""Displacement of the stops, m; the bodies move about twice as far."""
PAIR_ROOM = {"restitution": 1e-6, "yields": 1e-2}
"""Largest difference of one event's time between two runs of a pair, s: a cut changes the steps of a contact."""
RESTING = "bodies at rest on each other"
"""Remark of a run whose pairs overlap in rest: the steps decide whether the pair bounces at the release."""

Tables = dict[str, Any]


def check(seed: int) -> str | None:
    """Return the difference between the cut and the whole run of this seed; None without one."""
    draw = random.Random(seed)
    check_one = draw.choices((_fused, _coupled, _many_points, _pair, _foreign_body), (10, 2, 4, 2, 2))[0]
    return check_one(draw)


# ---- one body ----


def _fused(draw: random.Random) -> str | None:
    tables = body_tables(draw)
    end = draw.uniform(2.0, 14.0)
    return _cut(tables, "fused", draw.random(), end)


def _coupled(draw: random.Random) -> str | None:
    tables = body_tables(draw, relaxes=False)
    how = {"how": "coupled", "macro_step": draw.uniform(0.01, 0.2)}
    share, end = draw.random(), draw.uniform(1.0, 5.0)
    return _cut(tables | {"execution": how}, "coupled", share, end) or _coupled_is_fused(tables, how, end)


def _coupled_is_fused(tables: Tables, how: Tables, end: float) -> str | None:
    """Compare the first impacts of a coupled run with those of the fused run."""
    first: list[NDArray[np.float64]] = []
    scenes = Scene.from_dict(tables), Scene.from_dict(tables | {"execution": how})
    for scene, execution in zip(scenes, ("fused", "coupled"), strict=True):
        driver = driver_of(scene, execution)
        driver.watch(contacts=len(scene.stops))
        first.append(recorded(driver, scene, 0.0, end).impacts[:FIRST_IMPACTS, [0, 2]])
        driver.close()
    fused, coupled = first
    fastest = float(fused[:, 1].max(initial=0.0))
    if (fused[:, 1] < FAINT).any() or (
        len(fused) == len(coupled) and np.allclose(fused, coupled, rtol=0.0, atol=0.01 * fastest + 1e-3)
    ):
        return None
    return f"{json.dumps(tables)}: {how}: {coupled.tolist()} for {fused.tolist()}"


def _cut(tables: Tables, how: str, share: float, end: float) -> str | None:
    try:
        scene = Scene.from_dict(tables)
        problem = problem_of_cuts(scene, how, share, end, all_at_once=True)
    except VibroimpactError as error:
        problem = str(error)
    return None if problem is None else f"{json.dumps(tables)}: {how}: {problem}"


def body_tables(draw: random.Random, *, relaxes: bool = True) -> Tables:
    """Return the tables of a body at its stops: forced, pressed by a constant force, or free."""
    kind = draw.choice(("oscillator", "oscillator", "chain", "beam"))
    is_driven = (
        draw.random() < 0.8
    )  # a free body without a spring rests on a stop or creeps off it by rounding
    laws = [stop_law(draw, relaxes=relaxes) for _ in range(draw.choice((1, 1, 2, 3)))]
    if kind == "oscillator":
        stops = [
            {"position": draw.choice((SCALE, SCALE, 0.0)), **laws[0]},
            *({"position": -draw.choice((SCALE, 0.05)), "side": "lower", **law} for law in laws[1:2]),
        ]
        start = draw.choice((0.0, stops[0]["position"]))
        if stops[0]["law"] != "restitution":
            start = draw.choice((start, stops[0]["position"] + 0.1))
        body: Tables = {
            "mass": draw.choice((0.2, 1.0)),
            "stiffness": draw.choice((0.0, 0.5, 1.0, 4.0) if is_driven else (0.5, 1.0, 4.0)),
            "damping": draw.choice((0.0, 0.05, 0.3)),
            "displacement_start": start,
            "velocity_start": draw.choice((-0.5, 0.0, 0.7)),
        }
    elif kind == "chain":
        body, stops = _chain(draw, laws)
    else:
        body, stops = _beam(draw, laws)
    tables = {"body": body, "stop": stops}
    return tables | (_driven(draw, body) if is_driven else {"record": {"recorded_time": 1.0}})


def _chain(draw: random.Random, laws: list[Tables]) -> tuple[Tables, list[Tables]]:
    count = draw.randrange(1, 6)
    body = {
        "kind": "chain",
        "masses": [draw.choice((0.5, 1.0, 2.0)) for _ in range(count)],
        "stiffnesses": [draw.choice((0.5, 2.0, 8.0)) for _ in range(count)],
        "dampings": draw.choice((0.0, 0.05, 0.3)),
        "far_stiffness": draw.choice((0.0, 1.0)),
        "velocity_start": [draw.choice((-0.5, 0.0, 0.7)) for _ in range(count)],
    }
    stops = []
    for k, law in enumerate(laws):
        # the farther of two stops on one side at one mass would be out of reach
        side, mass = ("upper", "lower")[k % 2], 1 + (draw.randrange(count) + k // 2) % count
        position = draw.choice((SCALE, 0.1)) * (1 if side == "upper" else -1)
        if not any(stop["mass"] == mass and stop["side"] == side for stop in stops):
            stops.append({"position": position, "side": side, "mass": mass, **law})
    return body, stops


def _beam(draw: random.Random, laws: list[Tables]) -> tuple[Tables, list[Tables]]:
    body = {
        "kind": "beam",
        **{"length": 1.0, "mass_per_length": 1.0, "flexural_rigidity": 1.0},
        "modes": draw.randrange(1, 6),
        "boundary": draw.choice(("clamped-free", "clamped-clamped", "clamped-pinned", "pinned-pinned")),
        "damping_ratio": draw.choice((0.0, 0.02, 0.3)),
        "velocity_start": [draw.choice((-0.7, 0.4, 1.0))],
    }
    stops = [
        {
            "position": draw.choice((0.1, 0.03)) * (-1) ** k,
            "side": ("upper", "lower")[k % 2],
            "location": (0.8, 0.8, 0.45)[k],
            **law,
        }
        for k, law in enumerate(laws)
    ]
    return body, stops


def stop_law(draw: random.Random, *, relaxes: bool = True) -> Tables:
    """Return a contact law of a stop with its parameters."""
    law = draw.choice(("restitution", "restitution", "kelvin_voigt", "hertz", "hunt_crossley"))
    if law == "restitution":
        yields = {"yield_velocity": draw.choice((0.05, 0.5))} if relaxes and draw.random() < 0.2 else {}
        return {"law": law, "restitution": draw.choice((0.0, 0.15, 0.3, 0.7, 0.95, 1.0))} | yields
    stop: Tables = {"law": law, "stiffness": 10.0 ** draw.uniform(0.7, 5.0)}
    if law == "kelvin_voigt":
        # an importer locates the end of a strong dashpot's force only to within its steps
        stop["damping"] = draw.choice((0.0, 0.1, 3.0, 30.0) if relaxes else (0.0, 0.1, 0.5))
        if relaxes:
            stop["relaxation_time"] = draw.choice((0.0, 0.0, 0.1, 2.0))
    if law == "hunt_crossley":
        stop |= {"damping": draw.choice((0.0, 0.1, 2.0)), "exponent": draw.choice((1.0, 1.5, 2.2))}
    return stop


def _driven(draw: random.Random, body: Tables) -> Tables:
    """Return forcing and record of a body; a constant force presses it on a stop, with chatter and rest."""
    kind = draw.choice(("force", "force", "constant", "base_acceleration"))
    amplitude: Any = draw.choice((0.3, 1.0, -1.0, 3.0))
    if "masses" in body and kind != "base_acceleration":
        amplitude = [amplitude, *(draw.choice((0.0, 0.5)) for _ in body["masses"][1:])]
    forcing: Tables = {"amplitude": amplitude, "phase": draw.choice((0.0, 1.0))}
    if kind == "constant":
        return {"forcing": forcing | {"angular_frequency": 0.0}, "record": {"recorded_time": 1.0}}
    forcing |= {"kind": kind, "angular_frequency": draw.uniform(0.3, 4.0)}
    return {"forcing": forcing, "record": {"recorded_periods": 1}}


# ---- many points ----


def _many_points(draw: random.Random) -> str | None:
    """Cut the runs of many points, which go in lanes or in the loop, at an instant or, when forced, at a period."""
    tables = body_tables(draw)
    if draw.random() < 0.5:  # rigid stops can go in lanes
        tables["stop"] = [
            {k: v for k, v in stop.items() if k in ("position", "side", "mass", "location")}
            | {"restitution": draw.choice((0.0, 0.3, 0.8, 0.95, 1.0))}
            for stop in tables["stop"][:2]
        ]
    low = draw.uniform(0.02, 0.3)
    tables["sweep"] = {"stop[1].position": {"start": low, "stop": low + 0.3, "points": POINTS}}
    tables["body"].pop("displacement_start", None)
    tables["execution"] = {"how": draw.choice(("auto", "fused")), "impact_limit": 20_000}
    is_forced = "recorded_periods" in tables["record"]
    if is_forced:
        tables["forcing"]["phase"] = 0.0
        edges: list[float] = [0, draw.randrange(1, 4), draw.randrange(4, 6)]
    else:
        edges = [0.0, draw.uniform(0.05, 5.0), 6.0]
    try:
        windows = [*pairwise(edges), (edges[0], edges[-1])]
        counts = [_counts(tables, is_forced, *window) for window in windows]
    except VibroimpactError as error:
        return f"{json.dumps(tables)}: {error}"
    # chaos multiplies rounding by any factor; lanes that start elsewhere take other steps
    few = [k for k, own in enumerate(zip(*counts, strict=True)) if None not in own and own[-1] < MOST_EVENTS]
    *parts, whole = [[count[k] or 0 for k in few] for count in counts]
    problem = counts_differ(parts, whole)
    return None if problem is None else f"{json.dumps(tables)}: at {edges}, of {few}: {problem}"


def _counts(tables: Tables, is_forced: bool, begin: float, end: float) -> list[int | None]:
    """Return the impacts and rests of each point in a recording; None where one of them is a graze."""
    unit = "periods" if is_forced else "time"
    window = {f"transient_{unit}": begin, f"recorded_{unit}": end - begin}
    scene = Scene.from_dict(tables | {"record": window})
    with open_scene(scene) as runner:
        ran, _ = runner.rows(columns_of_points(expand(scene), 0, run_count(scene.sweep)))
    columns = ran if isinstance(ran, RunColumns) else columns_of(ran)
    assert columns.impacts is not None
    assert columns.sticks is not None
    impacts, counts = columns.impacts, columns.impacts.count + columns.sticks.count
    runs = np.repeat(np.arange(len(counts)), impacts.count)
    faint = set(runs[impacts.rows[:, 2] < FAINT].tolist())
    return [None if run in faint else int(count) for run, count in enumerate(counts)]


# ---- bodies that hit each other, and bodies of other tools ----


def _pair(draw: random.Random) -> str | None:
    """Cut a run of two or three bodies of this package that hit each other."""
    start = draw.choice((0.0, 0.4))
    components: Tables = {
        "table": {
            "fmu": "Oscillator",
            "parameters": {
                **{"mass": 5.0, "stiffness": draw.choice((0.0, 5.0)), "displacement_start": start},
                "velocity_start": draw.choice((-0.5, 0.0, 0.7)),
            },
        },
        "ball": {
            "fmu": "Oscillator",
            "parameters": {
                **{"stiffness": 2.0, "displacement_start": start + draw.choice((0.0, 0.2))},
                "velocity_start": -1.0,
            },
        },
    }
    contacts = [{"between": ["table", "ball"], **pair_law(draw)}]
    if draw.random() < 0.4:
        parameters = {"masses": 2, "mass[1]": 1.0, "mass[2]": 0.5, "stiffness[1]": 3.0, "stiffness[2]": 2.0}
        components["tower"] = {
            "fmu": "Chain",
            "fmi": draw.choice(("2.0", "3.0")),
            "parameters": parameters | {"velocity_start[2]": -0.5},
        }
        contacts.append({"between": ["ball", "tower.mass[2]"], "clearance": 0.9, **pair_law(draw)})
    return _cut_general(draw, {"component": components, "contact": contacts}, 4.0)


def pair_law(draw: random.Random) -> Tables:
    """Return a contact law of two bodies that hit each other."""
    law = draw.choice(("restitution", "kelvin_voigt", "hertz", "hunt_crossley"))
    if law == "restitution":
        return {"restitution": draw.choice((0.0, 0.5, 0.8, 1.0))}
    more = {"damping": draw.choice((0.0, 0.1, 0.5))} if law != "hertz" else {}
    return {"law": law, "stiffness": draw.choice((20.0, 200.0, 3e3))} | more


def _foreign_body(draw: random.Random) -> str | None:
    """Cut a run of a body of another tool, at a compliant stop or at a body of this package."""
    mass = fmu_factory.mass(Path.cwd(), draw.choice(("2.0", "3.0")))
    variables = {"displacement": "x", "velocity": "v", "force": "f", "mass": 1.0}
    parameters = {
        "m": 1.0,
        "k": draw.choice((1.0, 4.0)),
        "v": draw.choice((1.0, -1.0)),
        "load": draw.choice((0.0, 0.5)),
    }
    components: Tables = {"m": {"fmu": mass.name, "parameters": parameters}}
    contact: Tables
    if draw.random() < 0.5:
        law = stop_law(draw, relaxes=False)
        components["stop"] = {
            "fmu": "ImpactStop",
            "parameters": {"position": draw.choice((0.0, 0.2)), **({"law": law.pop("law")} | law)},
        }
        contact = {"body": "m", "stop": "stop", **variables}
    else:
        components["ball"] = {
            "fmu": "Oscillator",
            "parameters": {"displacement_start": 0.2, "stiffness": 2.0},
        }
        contact = {"between": ["m", "ball"], "bodies": {"m": variables}, **pair_law(draw)}
    return _cut_general(draw, {"component": components, "contact": [contact]}, 3.0)


def _cut_general(draw: random.Random, tables: Tables, end: float) -> str | None:
    tables |= {"scene": {"units": "SI"}, "execution": {"macro_step": draw.choice((0.02, 0.05))}}
    is_rigid = any("restitution" in contact for contact in tables["contact"])
    room = PAIR_ROOM["restitution" if is_rigid and len(tables["contact"]) == 1 else "yields"]
    try:
        whole, remark = _events(tables, 0.0, end)
        if RESTING in remark:
            return None
        if len(whole) >= MOST_EVENTS:
            longest = int(np.diff(whole[:MOST_EVENTS]).argmax())
            end = float(whole[longest : longest + 2].mean())
            whole, _ = _events(tables, 0.0, end)
        cuts = [draw.uniform(0.0, end), *([float(draw.choice(whole))] if len(whole) else [])]
        for cut in cuts:
            if not 0.0 < cut < end:
                continue
            both = np.concatenate([_events(tables, 0.0, cut)[0], _events(tables, cut, end)[0]])
            if len(both) != len(whole) or not np.abs(both - whole).max(initial=0.0) <= room:
                return (
                    f"{json.dumps(tables)}: cut at {cut!r} of {end!r} s: {both.tolist()} for {whole.tolist()}"
                )
    except VibroimpactError as error:
        return f"{json.dumps(tables)}: {error}"
    return None


def _events(tables: Tables, begin: float, end: float) -> tuple[NDArray[np.float64], str]:
    """Return the times of the events of a recording, s, and the messages of the run."""
    window = {"transient_time": begin, "recorded_time": end - begin}
    runner = GeneralRunner(Scene.from_dict(tables | {"record": window}, str(Path.cwd() / "scene.toml")))
    try:
        record = runner.run({})
    finally:
        runner.close()
    assert record.events is not None
    return record.events[:, 0], record.message
