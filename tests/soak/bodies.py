"""Adversarial random bodies: always two kinds of stop on one body, in the places where decisions are hardest.

Oscillators, chains and beams have coincident and opposed stops, no room between them, and symmetric points. They start
on a stop or in it, have no springs, restitution 0 and 1, and stiffnesses over twelve decades. `check` runs one body
and returns its fault.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from support.modes import chain_modes
from support.random_structures import (
    ALL_LAWS,
    COMPLIANT,
    MOST_IMPACTS,
    POWER,
    Array,
    Run,
    Scene,
    apart,
    depth_at,
    follow,
)
from support.structure import IMPACT_LIMIT, Modes, Stop, Structure

from vibroimpact.fmus.core import beam_modes
from vibroimpact.fmus.errors import ComponentError

#: Processor time that a run may take, s.
LONGEST = 2.0
#: Largest duration of a run, in radians of its stiffest stop: time at rest on the stop counts too.
MOST_RADIANS = 1e4
CASES = 20_000
SAMPLE = 12
DURATION = 10.0
STEPS = 97
#: Largest energy error over the turnover; the second for power laws, which are solved to a tolerance of 1e-10 each.
TURNOVER, TURNOVER_POWER = 1e-11, 1e-7
#: Factor on the bound of `apart`, and share of the largest speed for each impact: bounces of 1e-10 m round anew.
LOOSE, EACH_IMPACT = 10.0, 1e-7
#: Largest penetration of a rigid stop, over the displacements that add up there.
PENETRATION = 1e-12


@dataclass(frozen=True)
class Body:
    """The modes of a body and the shapes of its points with stops, shape (points, modes)."""

    natural: Array
    damping_ratio: Array
    points: Array
    coupling: Array | None


def _pick(random: np.random.Generator, *values: float) -> float:
    return float(random.choice(values))


def _oscillator(random: np.random.Generator) -> Body:
    natural = np.array([_pick(random, 0.0, 1.0, 1.0, 7.0)])
    ratio = np.array([_pick(random, 0.0, 0.02, 1.0, 3.0) if natural[0] > 0.0 else 0.0])
    return Body(natural, ratio, np.array([[_pick(random, 0.5, 1.0, 2.0)]]), None)


def _chain(random: np.random.Generator) -> Body:
    n = int(random.integers(2, 4))
    masses, springs = random.choice([0.5, 1.0, 2.0], n), random.choice([0.0, 1.0, 5.0], n)
    found = chain_modes(masses, springs, random.choice([0.0, 0.1, 2.0], n))
    return Body(found.natural, found.damping_ratio, found.shapes, None if found.classical else found.damping)


def _beam(random: np.random.Generator) -> Body:
    count = int(random.integers(1, 5))
    boundary = str(random.choice(["pinned_pinned", "clamped_free", "clamped_clamped", "clamped_pinned"]))
    found = beam_modes(boundary, count)  # type: ignore[arg-type]  # a literal that numpy has drawn
    natural = (np.asarray(found.eigenvalues) / found.eigenvalues[0]) ** 2
    places = np.round(random.uniform(0.1, 0.9, 4), 2)
    places = np.concatenate([places, 1.0 - places, [0.5]])  # symmetric pairs, and a node of every other mode
    return Body(natural, np.full(count, _pick(random, 0.0, 0.02, 0.3)), found.shapes(places), None)


def _law(random: np.random.Generator, law: str) -> dict[str, float | str]:
    if law == "restitution":
        return {"law": law, "restitution": _pick(random, 0.0, 0.0, 0.3, 0.5, 0.9, 1.0)}
    chosen: dict[str, float | str] = {"law": law, "stiffness": float(10.0 ** random.integers(-2, 11))}
    if law != "hertz":
        chosen["damping"] = _pick(random, 0.0, 0.01, 0.1, 3.0)
    if law == "hunt_crossley":
        chosen["exponent"] = _pick(random, 1.0, 1.5, 2.5)
    return chosen


def _stops(random: np.random.Generator, body: Body, q: Array) -> tuple[Stop, ...]:
    laws = ["restitution", str(random.choice(COMPLIANT))]
    laws += [str(law) for law in random.choice(ALL_LAWS, int(random.integers(0, 4)))]
    gaps = (0.0, 0.0, 0.0, 1e-15, 1e-9, 0.01, 0.1)
    stops: list[Stop] = []
    for law in laws:
        shape, side = (
            body.points[int(random.integers(len(body.points)))],
            str(random.choice(["upper", "lower"])),
        )
        if stops and random.random() < 0.3:  # at the point of another stop
            shape = np.asarray(stops[-1].shape)
        gap = _pick(random, *gaps)
        if law in COMPLIANT and random.random() < 0.1:
            gap = -0.01  # pressed in at the start
        position = float(shape @ q) + gap * (1.0 if side == "upper" else -1.0)
        stops.append(Stop(shape, position, side=side, **_law(random, law)))  # type: ignore[arg-type]
    order = random.permutation(len(stops))
    return tuple(stops[k] for k in order)


def fastest(modes: Modes, stops: tuple[Stop, ...], q: Array) -> float:
    """Return the largest rate of the body with its stiffest stop pressed by a unit or as at the start, rad/s."""
    rates = [float(np.max(modes.natural)), modes.angular_frequency]
    for stop in stops:
        mobility = float(np.square(np.asarray(stop.shape)).sum())
        rates.append(np.sqrt(stop.stiffness * mobility))
        if stop.law == "kelvin_voigt":
            rates.append(stop.damping * mobility)
        if stop.law == "hunt_crossley":
            rates.append(stop.stiffness * depth_at(stop, q) ** stop.exponent * stop.damping * mobility)
    return max(1.0, *rates)


def case(seed: int) -> Scene:
    """Return the scene of a seed."""
    random = np.random.default_rng(seed)
    body = (_oscillator, _chain, _beam)[int(random.integers(3))](random)
    n = len(body.natural)
    frequency = _pick(random, 0.0, 0.3, 1.0, 2.5)
    force = body.points.T @ random.choice([0.0, 0.0, 1.0, -0.5, 3.0], len(body.points))
    q = np.zeros(n) if random.random() < 0.7 else np.round(0.1 * random.normal(size=n), 2)
    p = np.round(random.normal(size=n), 1) * _pick(random, 0.0, 1.0, 1.0)
    if random.random() < 0.2 and n > 1:
        p[1::2] = 0.0  # beams: symmetric motion
    modes = Modes(body.natural, body.damping_ratio, force, frequency, 0.0, body.coupling)
    stops = _stops(random, body, q)
    return Scene(modes, stops, q, p, min(DURATION, MOST_RADIANS / fastest(modes, stops, q)))


def _energy_problem(scene: Scene) -> str | None:
    """Follow the scene in steps with its energies; return missing energy, penetration or a pulling contact."""
    power = any(stop.law in POWER for stop in scene.stops)
    with scene.body(energies=True) as body:
        start = turnover = body.energy
        work = loss = contact = 0.0
        for step in range(STEPS):
            left = max(1, MOST_IMPACTS - len(body.impacts))
            ended = body.advance(scene.duration * (step + 1) / STEPS - body.time, most_impacts=left)
            turnover += (
                abs(body.forcing_work - work)
                + abs(body.contact_loss - contact)
                + abs(body.damping_loss - loss)
            )
            work, loss, contact = body.forcing_work, body.damping_loss, body.contact_loss
            balance = body.energy - start - (work - loss - contact)
            allowed = (TURNOVER_POWER if power else TURNOVER) * (turnover + body.energy + scene.stored)
            # each impact puts the body on its stop: the loads do work over the rounding of its position
            allowed += 1e-15 * max(1.0, scene.speed) ** 2 * (1.0 + 0.01 * len(body.impacts))
            if not abs(balance) <= allowed:
                return f"energy off by {balance:.3g} of {turnover:.3g} at {body.time:.6g} s"
            found = _state_problem(scene, body)
            if found or ended == IMPACT_LIMIT:
                return found
    return None


def _state_problem(scene: Scene, body: Structure) -> str | None:
    if not np.all(body.forces >= 0.0):
        return f"a stop pulls: {body.forces} at {body.time:.6g} s"
    for k, stop in enumerate(scene.stops):
        sign = 1.0 if stop.side == "upper" else -1.0
        terms = np.asarray(stop.shape) * body.displacement
        beyond = sign * (terms.sum() - stop.position)
        size = abs(stop.position) + np.abs(terms).sum() + 0.1 * scene.speed
        if stop.law == "restitution" and beyond > PENETRATION * size:
            return f"{beyond:.3g} beyond stop {k + 1} at {body.time:.6g} s"
    if np.any(body.sticks[:, 2] < body.sticks[:, 1]):
        return "a stick ends before it begins"
    return None


def _timed(scene: Scene, steps: int) -> tuple[Run, float]:
    began = time.process_time()
    run = follow(scene, [scene.duration], stepped=[scene.duration * (i + 1) / steps for i in range(steps)])
    return run, time.process_time() - began


def check(seed: int) -> str | None:
    """Run the scene of this seed in one step and in 97; return the fault, or None."""
    try:
        return _problem(case(seed))
    except ComponentError as error:
        return str(error)


def _problem(scene: Scene) -> str | None:
    one, seconds = _timed(scene, 1)
    if seconds > LONGEST:
        return f"took {seconds:.1f} s"
    many, seconds = _timed(scene, STEPS)
    if seconds > LONGEST:
        return f"took {seconds:.1f} s in {STEPS} steps"
    # rounding decided otherwise where the numbers of impacts differ; `apart` judges the other runs
    if IMPACT_LIMIT not in (one.ended, many.ended) and one.counts == many.counts:
        rounded = EACH_IMPACT * scene.speed * sum(map(sum, one.counts))
        for _, difference, allowed in apart(scene, one, many, [scene.duration]):
            if not difference <= LOOSE * allowed + rounded:
                return f"one step or {STEPS}: apart by {difference:.3g}, allowed {allowed:.3g}"
    return _energy_problem(scene)
