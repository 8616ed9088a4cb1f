"""Random bodies of few modes between rigid stops: as points of the lanes, and one by one as structures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from support.structure import Modes, Stop, Structure
from vibroimpact.fmus.core.arrays import address
from vibroimpact.fmus.core.lanes import (
    IMPACT_WIDTH,
    MOST_CONTACTS,
    PERIOD_WIDTH,
    Instructions,
    LanesEnd,
    LanesPlan,
    LanesPoints,
    PointState,
    impacts_by_point,
    lanes_memory,
    run_lanes,
)

Array = NDArray[np.float64]
Columns = dict[str, NDArray[Any]]
TURN = 2.0 * math.pi
IMPACT, PERIOD, PEAK = 1.0, 3.0, 4.0
OF_MODES = ("stiffness", "decay", "force", "held", "observed", "start_q", "start_p")
OF_CONTACTS = (
    *("position", "direction", "restitution", "yield_velocity"),
    *("contact_stiffness", "contact_damping"),
)


@dataclass
class Results:
    """Results of the lanes: columns of `LanesPoints`, and the rows of each point that has run.

    Rows have the layout of `core/body/record.h`: impacts first, then periods, whose time is 0 here.
    """

    columns: Columns
    rows: list[Array]
    ends: list[LanesEnd] = field(default_factory=list)

    @property
    def has_run(self) -> NDArray[np.bool_]:
        """Whether the lanes ran each point."""
        ran: NDArray[np.bool_] = self.columns["state"] == PointState.has_run
        return ran

    def same_as(self, other: Results) -> bool:
        """Whether both results are equal, bit for bit."""
        columns = all(
            np.array_equal(column, other.columns[name], equal_nan=column.dtype == np.float64)
            for name, column in self.columns.items()
        )
        return columns and all(map(_same, self.rows, other.rows))


def _same(one: Array, other: Array) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def run(
    points: Columns,
    *,
    impacts: bool = True,
    extrema: bool = True,
    periods: bool = True,
    each_period: bool = True,
    impact_limit: int = 0,
    rate: float = 0.0,
    instructions: Instructions = Instructions.best,
    room: int = 4096,
    most_seconds: float = 1e9,
) -> Results:
    """Run points to their end, through as many calls as needed.

    Parameters
    ----------
    points : dict of str to ndarray
        Arrays of `LanesPoints.GIVEN`, the last axis over the points.
    impacts, extrema, periods, each_period, impact_limit, rate, instructions
        Fields of the plan. All points are sampled: the contacts, then the observed point.
    room : int
        Number of rows that fit into one call.
    most_seconds : float
        Longest duration of one call, s.
    """
    count, modes, contacts = (
        points["angular_frequency"].size,
        len(points["stiffness"]),
        len(points["position"]),
    )
    results: Columns = {
        "state": np.zeros(count, np.uint8),
        "outcome": np.zeros(count, np.int8),
        "rows_of": np.zeros(count, np.int64),
        "periods_of": np.zeros(count, np.int64),
        **{name: np.full(count, np.nan) for name in ("reached", "displacement", "velocity")},
        **{name: np.full((modes, count), np.nan) for name in ("final_q", "final_p")},
    }
    block: Columns = {"rows": np.zeros((room, IMPACT_WIDTH)), "owner": np.zeros(room, np.int64)}
    yields = sum(2**k for k, stiffness in enumerate(points["contact_stiffness"]) if stiffness.any())
    sampled, coupled = 2**contacts - 1 + 2**MOST_CONTACTS, "coupling" in points
    plan = LanesPlan(
        modes,
        contacts,
        impacts,
        extrema,
        periods,
        each_period,
        instructions,
        coupled,
        len(points.get("further_force", ())),
        impact_limit,
        yields,
        sampled,
        rate,
    )
    most = _most_periods(points) if each_period else 1
    table = np.full((PERIOD_WIDTH, count, most), np.nan)
    state = LanesPoints(
        count=count, begun_below=count, most_periods=most, rows_room=room, most_seconds=most_seconds
    )
    if rate:
        longest = np.nanmax(points["end"] - points["begin"], initial=0.0)
        results["samples_of"] = np.zeros(count, np.int64)
        values = 2 * contacts + 2
        results["samples"] = np.full((values, count, math.floor(longest * rate) + 2), np.nan)
        state.most_samples = results["samples"].shape[2]
    given = {name: np.ascontiguousarray(points[name]) for name in LanesPoints.GIVEN if name in points}
    for name, array in (given | results | block | {"periods": table}).items():
        setattr(state, name, address(array))
    memory = lanes_memory(plan)
    ends: list[LanesEnd] = []
    rows: list[Array] = []
    owners: list[NDArray[np.int64]] = []
    while not ends or ends[-1] in (LanesEnd.listen, LanesEnd.full):
        ends.append(run_lanes(plan, state, memory))
        rows.append(block["rows"][: state.rows_used].copy())
        owners.append(block["owner"][: state.rows_used].copy())
        state.rows_used = 0
    ran = results["state"] == PointState.has_run
    found = impacts_by_point(list(zip(rows, owners, strict=True)), results["rows_of"])
    own = [
        np.concatenate([_written(IMPACT, impacts[:, :-1]), _written(PERIOD, periods), _peaks(impacts)])
        for impacts, periods in zip(
            np.split(found, np.cumsum(results["rows_of"])[:-1]),
            (table[:, point, : results["periods_of"][point]].T for point in range(count)),
            strict=True,
        )
    ]
    assert not results["rows_of"][~ran].any()
    return Results(results, own, ends)


def _most_periods(points: Columns) -> int:
    turns = (points["end"] - points["begin"]) * points["angular_frequency"] / TURN
    return math.ceil(np.max(turns, initial=0.0, where=np.isfinite(turns)) + 1.0)


def _written(kind: float, values: Array) -> Array:
    """Return rows of a kind as a body writes them; a period has no time."""
    columns = values if kind == IMPACT else np.insert(values, 0, 0.0, axis=1)
    return np.pad(np.insert(columns, 0, kind, axis=1), ((0, 0), (0, 8 - columns.shape[1] - 1)))


def _peaks(impacts: Array) -> Array:
    """Return the rows of the largest forces of ended contacts, as a body writes them."""
    ended = impacts[~np.isnan(impacts[:, -1])]
    return np.pad(np.insert(ended[:, [0, 4, 7]], 0, PEAK, axis=1), ((0, 0), (0, 4)))


def taken(points: Columns, places: NDArray[np.int64]) -> Columns:
    """Return the points at some places."""
    return {name: array[..., places] for name, array in points.items()}


def drawn(
    count: int, modes: int, contacts: int, seed: int, *, transient: int = 3, recorded: int = 4
) -> Columns:
    """Draw points: light to strong damping, including critical damping; forced, from phases of all quarters.

    Parameters
    ----------
    count, modes, contacts : int
        Sizes.
    seed : int
        Seed of the random numbers.
    transient, recorded : int
        Forcing periods before the recording, and in it.
    """
    random = np.random.default_rng(seed)
    natural = np.sort(np.exp(random.uniform(-0.7, 1.0 if modes == 1 else 2.0, (modes, count))), axis=0)
    ratio = random.uniform(0.0, 0.1, (modes, count))
    strong = random.random((modes, count)) < 0.2
    ratio[strong] = random.choice([0.0, 0.9999, 1.0, 1.3, 2.5], strong.sum())
    shape = random.uniform(0.4, 1.2, (max(contacts, 1), modes, count))
    shape[:, 1:] *= random.choice([-1.0, 1.0], (max(contacts, 1), modes - 1, count))
    position = np.array([[1.0], [-1.0], [1.0], [-1.0]])[:contacts] * random.uniform(
        0.2, 1.5, (contacts, count)
    )
    frequency = np.exp(random.uniform(-1.0, 1.2, count))
    phase = np.where(random.random(count) < 0.5, 0.0, random.uniform(-4.0, 4.0, count))
    first = transient + (phase % TURN > 0.0)
    lag = (phase % TURN) / frequency
    return {
        "stiffness": natural**2,
        "decay": ratio * natural,
        "force": random.uniform(-1.5, 1.5, (modes, count)),
        "held": random.choice([0.0, 0.2], (modes, count)),
        "angular_frequency": frequency,
        "phase": phase,
        "shape": shape[:contacts],
        "impulse": shape[:contacts].copy(),
        "observed": shape[0].copy(),
        "position": position,
        "direction": np.sign(position),
        "restitution": random.uniform(0.3, 1.0, (contacts, count)),
        "yield_velocity": random.choice([0.0, 0.0, 0.4], (contacts, count)),
        "contact_stiffness": np.zeros((contacts, count)),
        "contact_damping": np.zeros((contacts, count)),
        "start_q": random.uniform(-0.05, 0.05, (modes, count)),
        "start_p": random.uniform(-0.5, 0.5, (modes, count)),
        "begin": first * (TURN / frequency) - lag,
        "end": (first + recorded) * (TURN / frequency) - lag,
        "first": np.ones(count, np.uint8),
    }


def drawn_coupled(
    count: int, modes: int, contacts: int, seed: int, *, transient: int = 3, recorded: int = 4
) -> Columns:
    """Draw points of `drawn` with dashpots between random places, in place of most of the modes' own damping.

    Dampings reach from none to far above critical; some points have fewer dashpots than modes.
    """
    random = np.random.default_rng(seed)
    points = drawn(count, modes, contacts, seed, transient=transient, recorded=recorded)
    coupling = np.zeros((modes, modes, count))
    for point, natural in enumerate(np.sqrt(points["stiffness"]).T):
        dashpots = random.normal(size=(random.integers(1, modes + 1), modes)) * np.sqrt(natural)
        coupling[..., point] = random.choice([0.0, 1e-3, 0.05, 0.3, 1.0, 4.0]) * dashpots.T @ dashpots / modes
        if random.random() < 0.5:
            coupling[..., point] += np.diag(2.0 * points["decay"][:, point])
    decay = 0.5 * np.einsum("iip->ip", coupling)
    return {**points, "coupling": coupling, "decay": decay}


def drawn_yielding(
    count: int, contacts: int, seed: int, *, rigid: bool = False, recorded: int = 4
) -> Columns:
    """Draw points of one mode with Kelvin-Voigt stops.

    Stiffnesses are 0.3 to 1e8 times the body's, dampings up to twice critical. A fifth of the stops have no damping.
    With `rigid`, the second stop stays rigid.
    """
    random = np.random.default_rng(seed)
    points = drawn(count, 1, contacts, seed, recorded=recorded)
    soft = contacts - rigid
    mobility = (points["shape"] * points["impulse"])[:soft, 0]
    rate = points["stiffness"] * 10.0 ** random.uniform(-0.5, 8.0, (soft, count))
    ratio = random.choice([0.0, 0.02, 0.1, 0.5, 1.0, 2.0], (soft, count), p=[0.2, 0.2, 0.2, 0.2, 0.1, 0.1])
    points["contact_stiffness"][:soft] = rate / mobility
    points["contact_damping"][:soft] = 2.0 * ratio * np.sqrt(rate) / mobility
    return points


def oscillators(count: int, transient: int, recorded: int, **values: object) -> Columns:
    """Return oscillators of mass 1 and stiffness 1 with one stop, forced from phase 0."""
    points = taken(drawn(1, 1, 1, 0), np.zeros(count, np.int64))
    given = {"held": 0.0, "phase": 0.0, "shape": 1.0, "impulse": 1.0, "observed": 1.0, "stiffness": 1.0}
    for name, value in {**given, "yield_velocity": 0.0, "direction": 1.0, **values}.items():
        points[name] = np.broadcast_to(np.asarray(value, dtype=np.float64), points[name].shape).copy()
    period = TURN / points["angular_frequency"]
    return {**points, "begin": transient * period, "end": (transient + recorded) * period}


def with_sines(points: Columns, further: int, seed: int, *, one_period: bool = False) -> Columns:
    """Return points with further sines, of any frequencies or of one common period."""
    random = np.random.default_rng(seed)
    modes, count = points["force"].shape
    ratio = np.exp(random.uniform(-1.2, 1.2, (further, count)))
    if one_period:
        ratio = random.integers(1, 7, (further, count)) / random.integers(1, 4, count)
    return {
        **points,
        "further_force": random.uniform(-1.2, 1.2, (further, modes, count)),
        "further_frequency": ratio * points["angular_frequency"],
        "further_phase": random.uniform(-4.0, 4.0, (further, count)),
    }


def with_undamped_modes(p: Columns) -> Columns:
    """Return a point with two undamped modes for each of its further sines, which move as its steady response.

    The modes are in ascending order. Impulses do not act on the added ones.
    """
    modes, frequency, phase = len(p["stiffness"]), p["further_frequency"], p["further_phase"]
    coupling = p.get("coupling", np.diag(2.0 * p["decay"]))
    steady = [
        np.linalg.solve(np.diag(p["stiffness"] - w**2) + 1j * w * coupling, force.astype(complex))
        for w, force in zip(frequency, p["further_force"], strict=True)
    ]
    start = {"start_q": p["start_q"], "start_p": p["start_p"]}
    added: dict[str, list[float]] = {"start_q": [], "start_p": []}
    for w, a, z in zip(frequency, phase, steady, strict=True):
        start["start_q"] = start["start_q"] - (z * np.exp(1j * a)).real
        start["start_p"] = start["start_p"] - (1j * w * z * np.exp(1j * a)).real
        added["start_q"] += [math.cos(a), math.sin(a)]
        added["start_p"] += [-w * math.sin(a), w * math.cos(a)]
    none = np.zeros(2 * len(frequency))
    stiffness = np.concatenate([p["stiffness"], np.repeat(frequency**2, 2)])
    order = np.argsort(stiffness, kind="stable")

    def shape(row: Array) -> Array:
        own = [part for z in steady for part in (row @ z.real, -(row @ z.imag))]
        return np.concatenate([row, own])[order]

    found = {**p, "stiffness": stiffness[order], "observed": shape(p["observed"])}
    found |= {name: np.concatenate([p[name], none])[order] for name in ("decay", "force", "held")}
    found |= {name: np.concatenate([start[name], added[name]])[order] for name in start}
    found["shape"] = np.array([shape(row) for row in p["shape"]])
    found["impulse"] = np.array([np.concatenate([row, none])[order] for row in p["impulse"]])
    if "coupling" in p:
        whole = np.zeros((len(stiffness), len(stiffness)))
        whole[:modes, :modes] = coupling
        found["coupling"] = whole[np.ix_(order, order)]
    return found


def follow_alone(points: Columns, place: int, *, impact_limit: int = 0) -> Structure:
    """Run one of the points by the scalar engine of bodies of many modes, recorded from its start."""
    p = {name: array[..., place] for name, array in points.items()}
    if "further_force" in p:
        p = with_undamped_modes(p)
    natural = np.sqrt(p["stiffness"])
    moves = natural > 0.0
    ratio = np.where(moves, p["decay"] / np.where(moves, natural, 1.0), 0.0)
    coupling = np.diag(2.0 * p["decay"]) if (p["decay"][~moves] > 0.0).any() else p.get("coupling")
    frequency, phase = float(p["angular_frequency"]), float(p["phase"])
    modes = Modes(natural, ratio, p["force"], frequency, phase, coupling=coupling)
    stops = [
        Stop(
            p["shape"][k],
            float(p["position"][k]),
            side="upper" if p["direction"][k] > 0.0 else "lower",
            restitution=float(p["restitution"][k]),
            yield_velocity=float(p["yield_velocity"][k]),
            impulse=p["impulse"][k],
            law="kelvin_voigt" if p["contact_stiffness"][k] > 0.0 else "restitution",
            stiffness=float(p["contact_stiffness"][k]),
            damping=float(p["contact_damping"][k]),
        )
        for k in range(len(p["position"]))
    ]
    body = Structure(
        modes, stops, p["start_q"], p["start_p"], observed=p["observed"], extrema=True, periods=True
    )
    body.advance(float(p["end"]), held=p["held"], most_impacts=impact_limit)
    return body
