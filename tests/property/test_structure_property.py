"""Invariants of bodies of many modes with stops of every law, over random bodies, stops and forces.

No reference is needed: each property follows from the equations of motion alone (equations.md 1.3, 5, 6). Where two
runs must agree to rounding, the growth of rounding is measured on the same scene (random_structures.apart).
"""

from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.random_structures import (
    COMPLIANT,
    MOST_IMPACTS,
    RIGID,
    Array,
    Run,
    Scene,
    apart,
    follow,
    scenes,
)
from support.structure import DONE, IMPACT_LIMIT, Modes, Stop, Structure
from support.tolerance import ROUNDING

FEW = settings(max_examples=40, derandomize=True, suppress_health_check=list(HealthCheck))

#: Largest penetration of a rigid stop, over the displacements that add up to its position.
PENETRATION = 1e-12
#: Error of the energies integrated by quadrature, over the turnover of energy.
TURNOVER = 1e-12
#: The same for contacts with power laws, which are solved to a tolerance of 1e-10 in each of their segments.
TURNOVER_POWER = 1e-8

fractions = st.lists(st.floats(0.01, 0.99), min_size=1, max_size=6)


def assert_same(scene: Scene, one: Run, other: Run, times: list[float]) -> None:
    if IMPACT_LIMIT not in (
        one.ended,
        other.ended,
    ):  # rounding decides which of two runs has one more bounce
        assert one.times == other.times
    for time, difference, allowed in apart(scene, one, other, times):
        assert difference <= allowed, f"at {time} s apart by {difference:.3g}, allowed {allowed:.3g}"


def grid(scene: Scene, count: int = 8) -> list[float]:
    return [scene.duration * (i + 1) / count for i in range(count)]


@FEW
@given(scenes(), fractions)
def test_a_motion_in_several_steps_is_the_motion_in_one(scene: Scene, parts: list[float]) -> None:
    times = [scene.duration]
    whole = follow(scene, times)
    assert_same(scene, whole, follow(scene, times, stepped=[scene.duration * x for x in parts]), times)


def mirrored(scene: Scene) -> Scene:
    modes = replace(scene.modes, force=-np.asarray(scene.modes.force))
    other = {"upper": "lower", "lower": "upper"}
    stops = tuple(replace(s, position=-s.position, side=other[s.side]) for s in scene.stops)
    return replace(scene, modes=modes, stops=stops, q=-scene.q, p=-scene.p)


@FEW
@given(scenes())
def test_the_mirror_image_of_a_scene_moves_as_the_mirror_image_bit_for_bit(scene: Scene) -> None:
    one, image = follow(scene, grid(scene)), follow(mirrored(scene), grid(scene))
    assert one.times == image.times
    assert one.counts == image.counts
    for state, mirror in zip(one.states, image.states, strict=True):
        assert np.array_equal(state, -mirror)


def rescaled(scene: Scene, mass: float, length: float, time: float) -> Scene:
    """Return the scene in other units: mass, length and time multiplied."""
    root = np.sqrt(mass)
    modes = replace(
        scene.modes,
        natural=np.asarray(scene.modes.natural) / time,
        force=np.asarray(scene.modes.force) * (root * length / time**2),
        angular_frequency=scene.modes.angular_frequency / time,
        coupling=None if scene.modes.coupling is None else np.asarray(scene.modes.coupling) / time,
    )
    force = mass * length / time**2
    stops = []
    for stop in scene.stops:
        exponent = {"hertz": 1.5, "hunt_crossley": stop.exponent}.get(stop.law, 1.0)
        per_rate = time / length if stop.law == "hunt_crossley" else mass / time
        stops.append(
            replace(
                stop,
                shape=np.asarray(stop.shape) / root,
                position=stop.position * length,
                yield_velocity=stop.yield_velocity * length / time,
                stiffness=stop.stiffness * force / length**exponent,
                damping=stop.damping * per_rate,
            )
        )
    return Scene(
        modes,
        tuple(stops),
        scene.q * (root * length),
        scene.p * (root * length / time),
        scene.duration * time,
    )


scales = st.integers(-8, 8).map(
    lambda n: 4.0**n
)  # powers of 4: their roots are powers of 2, without rounding


def in_old_units(run: Run, modes: int, mass: float, length: float, time: float) -> Run:
    unit = np.sqrt(mass) * length
    factors = np.concatenate([np.full(modes, unit), np.full(modes, unit / time)])
    return replace(
        run, times=[t / time for t in run.times], states=[np.asarray(s / factors) for s in run.states]
    )


@FEW
@given(scenes(("restitution", "kelvin_voigt")), scales, scales, scales)
def test_units_rescaled_by_powers_of_two_rescale_the_result_bit_for_bit(
    scene: Scene, mass: float, length: float, time: float
) -> None:
    one = follow(scene, grid(scene))
    scene_there = rescaled(scene, mass, length, time)
    other = follow(scene_there, [t * time for t in grid(scene)])
    back = in_old_units(other, len(scene.q), mass, length, time)
    assert one.times == back.times
    assert one.counts == back.counts
    for state, image in zip(one.states, back.states, strict=True):
        assert np.array_equal(state, image)


@FEW
@given(scenes(COMPLIANT), st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.floats(0.01, 100.0))
def test_any_units_of_compliant_stops_rescale_the_result(
    scene: Scene, mass: float, length: float, time: float
) -> None:
    times = [scene.duration]
    one = follow(scene, times)
    other = follow(rescaled(scene, mass, length, time), [scene.duration * time])
    back = in_old_units(other, len(scene.q), mass, length, time)
    assert_same(scene, one, replace(back, times=one.times), times)


@FEW
@given(scenes(), st.permutations(range(3)))
def test_the_order_in_which_stops_are_listed_does_not_matter(scene: Scene, order: list[int]) -> None:
    kept = [k for k in order if k < len(scene.stops)]
    other = replace(scene, stops=tuple(scene.stops[k] for k in kept))
    one, two = follow(scene, grid(scene)), follow(other, grid(scene))
    assert_same(scene, one, two, grid(scene))


@FEW
@given(scenes(forced=True), st.integers(1, 1000))
def test_a_start_some_forcing_periods_later_changes_nothing(scene: Scene, periods: int) -> None:
    # time enters only as the phase of the force; 2 pi is no whole number, so the phase is rounded once
    angle = 2.0 * np.pi * periods
    later = replace(scene, modes=replace(scene.modes, phase=scene.modes.phase + angle))
    one, other = follow(scene, grid(scene)), follow(later, grid(scene))
    noise = angle * ROUNDING / 1e-13  # in nudges
    for time, difference, allowed in apart(scene, one, other, grid(scene)):
        assert difference <= allowed * (1.0 + noise), f"at {time} s"


@FEW
@given(scenes(RIGID))
def test_no_body_is_beyond_a_rigid_stop_and_no_stop_pulls(scene: Scene) -> None:
    with scene.body(extrema=True) as body:
        for time in grid(scene, 200):
            if body.advance(time - body.time, most_impacts=MOST_IMPACTS) != DONE:
                break
            assert np.all(body.forces >= 0.0)
            for stop in scene.stops:
                sign = 1.0 if stop.side == "upper" else -1.0
                size = abs(stop.position) + np.abs(np.asarray(stop.shape) * body.displacement).sum()
                beyond = sign * (np.asarray(stop.shape) @ body.displacement - stop.position)
                assert beyond <= PENETRATION * size
            # the first stop's point is the observed one: its extreme covers the instants in between as well
            first = scene.stops[0]
            largest = body.displacement_max if first.side == "upper" else -body.displacement_min
            size = abs(first.position) + np.abs(np.asarray(first.shape)).sum() * scene.speed / 0.3
            edge = first.position if first.side == "upper" else -first.position
            assert largest - edge <= PENETRATION * size


def stored(scene: Scene, body: Structure) -> float:
    """Return the energy in the springs of the compliant stops at the current depth, J."""
    energy = 0.0
    for stop in scene.stops:
        sign = 1.0 if stop.side == "upper" else -1.0
        depth = max(0.0, sign * float(np.asarray(stop.shape) @ body.displacement - stop.position))
        power = {"kelvin_voigt": 1.0, "hertz": 1.5, "hunt_crossley": stop.exponent}.get(stop.law)
        if power is not None:
            energy += stop.stiffness * depth ** (power + 1.0) / (power + 1.0)
    return energy


@FEW
@given(scenes(forced=False))
def test_without_a_force_energy_never_grows_under_any_law(scene: Scene) -> None:
    # of a stop's power F d', K d^n d' is stored, the rest is lost: F <= K d^n on the way out
    with scene.body() as body:
        before = start = body.energy + stored(scene, body)
        for time in grid(scene, 100):
            if body.advance(time - body.time, most_impacts=MOST_IMPACTS) != DONE:
                break
            assert np.all(body.forces >= 0.0)
            now = body.energy + stored(scene, body)
            power = any(stop.law in ("hertz", "hunt_crossley") for stop in scene.stops)
            assert now <= before + (TURNOVER_POWER if power else TURNOVER) * start
            before = now


@FEW
@given(scenes(forced=False), st.sampled_from([0.05, 1.0]))
def test_a_surface_that_takes_time_to_come_back_gives_no_energy_either(scene: Scene, time: float) -> None:
    stops = tuple(replace(stop, relaxation_time=time) for stop in scene.stops)
    with replace(scene, stops=stops).body() as body:
        before = start = body.energy
        for end in grid(scene, 100):
            if body.advance(end - body.time, most_impacts=MOST_IMPACTS) != DONE:
                break
            # a pressed stop, or one whose surface is on the way back, holds part of the energy
            if all(status in ("free", "touching", "held") for status in body.statuses):
                assert body.energy <= before + TURNOVER_POWER * start
                before = body.energy


@FEW
@given(scenes())
def test_all_energy_is_accounted_for(scene: Scene) -> None:
    with scene.body(energies=True) as body:
        first, turnover = body.energy, body.energy
        work = loss = contact = 0.0
        power = any(stop.law in ("hertz", "hunt_crossley") for stop in scene.stops)
        for time in grid(scene, 60):
            if body.advance(time - body.time, most_impacts=MOST_IMPACTS) != DONE:
                break
            turnover += abs(body.forcing_work - work) + abs(body.contact_loss - contact)
            turnover += body.damping_loss - loss
            assert body.damping_loss >= loss - ROUNDING * turnover
            work, loss, contact = body.forcing_work, body.damping_loss, body.contact_loss
            balance = body.energy - first - (work - loss - contact)
            # placing a body on its stop to the last bit moves it by a rounding of its displacements
            rounding = ROUNDING * scene.speed**2
            assert (
                abs(balance) <= (TURNOVER_POWER if power else TURNOVER) * (turnover + body.energy) + rounding
            )


vectors = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(np.array)


@FEW
@given(scenes(COMPLIANT, most_modes=1), vectors, vectors, vectors)
def test_the_impulse_of_compliant_stops_is_the_momentum_that_the_body_lost(
    scene: Scene, one: Array, two: Array, velocity: Array
) -> None:
    # modes without springs or dashpots: only the stops change their momenta
    one[0] += 1.5
    two[1] += 1.5
    shapes = (one, -two, two)
    laws = [replace(scene.stops[k % len(scene.stops)], side="upper") for k in range(3)]
    stops = tuple(
        replace(law, shape=shape, position=0.05 * (k + 1))
        for k, (law, shape) in enumerate(zip(laws, shapes, strict=True))
    )
    with Structure(Modes(np.zeros(3)), stops, np.zeros(3), 3.0 * velocity) as body:
        start = body.velocity.copy()
        for _ in range(40):
            body.advance(0.25)
            if any(status == "yielding" for status in body.statuses):
                continue
            given_away = np.zeros(3)
            for row in body.impacts:
                assert row[4] >= 0.0
                given_away -= row[4] * np.asarray(shapes[int(row[5]) - 1])
            size = np.abs(start).max() + np.abs(given_away).max()
            assert np.abs(body.velocity - start - given_away).max() <= TURNOVER_POWER * size


@FEW
@given(scenes(("hertz",), forced=False, most_stops=2))
def test_elastic_hertz_stops_only_lend_energy(scene: Scene) -> None:
    undamped = replace(scene, modes=Modes(scene.modes.natural))
    with undamped.body() as body:
        start = body.energy + stored(scene, body)
        for time in grid(scene, 20):
            body.advance(time - body.time)
            assert abs(body.energy + stored(scene, body) - start) <= TURNOVER_POWER * start


@FEW
@given(scenes(RIGID, forced=False), st.floats(0.3, 0.9))
def test_elastic_stops_conserve_energy_also_when_several_are_hit_at_once(scene: Scene, gap: float) -> None:
    # every stop twice, and all touched at the start: joint impulses from the first instant on
    elastic = [replace(stop, restitution=1.0, yield_velocity=0.0) for stop in scene.stops]
    undamped = replace(scene, modes=Modes(scene.modes.natural), stops=tuple(elastic + elastic[:1]))
    with undamped.body() as body:
        start = body.energy
        for time in grid(scene, 20):
            if body.advance(time - body.time, most_impacts=MOST_IMPACTS) != DONE:
                break
            assert abs(body.energy - start) <= TURNOVER * start * (1 + len(body.impacts))


def test_the_stop_list_has_a_stop_of_every_law() -> None:
    # a strategy that never drew a law would make every test above pass
    drawn: set[str] = set()

    @settings(max_examples=200, derandomize=True, database=None)
    @given(scenes())
    def look(scene: Scene) -> None:
        drawn.update(stop.law for stop in scene.stops)

    look()
    assert drawn == {*RIGID, *COMPLIANT}
    assert isinstance(Stop([1.0]).shape, list)
