"""Long rests, held or pressed, by their exact flow: the same motion as by series, with release at the force's zero."""

import math
import time

import mpmath as mp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.structure import DONE, Modes, Stop, Structure
from support.tolerance import SEQUENCE

from vibroimpact.fmus.core import beam_modes

FEW = settings(max_examples=60, derandomize=True, suppress_health_check=list(HealthCheck))
Array = np.ndarray

#: Rest under a preload that a slow force overcomes once a period.
SLOW, PRELOAD, FORCE = 0.1, 1.0, 1.2
PERIOD = 2.0 * math.pi / SLOW


def released_at(damping_ratio: float, stiffness: float, damping: float) -> float:
    """Return the time at which the force of a pressed mass of 1 falls to zero, started on its response; 30 digits."""
    with mp.workdps(30):
        k, c = 1 + mp.mpf(stiffness), 2 * mp.mpf(damping_ratio) + mp.mpf(damping)
        response = mp.mpf(FORCE) / (k - mp.mpf(SLOW) ** 2 + 1j * c * mp.mpf(SLOW))
        force = (mp.mpf(stiffness) + 1j * mp.mpf(damping) * mp.mpf(SLOW)) * response
        level = mp.mpf(stiffness) * mp.mpf(PRELOAD) / k
        # level + |force| cos(w t + phase) = 0
        return float((mp.acos(-level / abs(force)) - mp.arg(force)) / mp.mpf(SLOW))


@pytest.mark.parametrize("stiffness", [1e6, 1e9, 1e12])
@pytest.mark.parametrize("ratio", [0.0, 0.1, 3.0])
def test_a_mass_at_rest_on_a_stiff_stop_is_released_at_the_zero_of_its_force(
    stiffness: float, ratio: float
) -> None:
    damping = 2.0 * ratio * math.sqrt(stiffness)
    k, c = 1.0 + stiffness, 0.1 + damping
    response = FORCE / (k - SLOW**2 + 1j * c * SLOW)
    stop = Stop([1.0], 0.0, law="kelvin_voigt", stiffness=stiffness, damping=damping)
    modes = Modes([1.0], 0.05, [FORCE], SLOW)
    with Structure(modes, [stop], PRELOAD / k + response.real, (1j * SLOW * response).real) as body:
        began = time.process_time()
        assert body.advance(0.5 * PERIOD, held=[PRELOAD]) == DONE
        # by series a stop of 1e12 N/m takes 6 s
        assert time.process_time() - began < 1.0
        end = body.impacts[0, 1] + body.impacts[0, 7]
        # its ringing, which is due to rounding of the start, releases it earlier
        assert end == pytest.approx(released_at(0.05, stiffness, damping), rel=1e-11)


@pytest.mark.parametrize("stiffness", [1e9, 1e12, 1e15])
def test_what_a_stiff_stop_carries_is_the_load_on_it(stiffness: float) -> None:
    # a ball of 1 kg on a stop, under its weight and a force that never lifts it
    stop = Stop([1.0], 0.0, law="kelvin_voigt", stiffness=stiffness, damping=0.2 * math.sqrt(stiffness))
    with Structure(Modes([0.0], 0.0, [1.0], 3.0), [stop], 11.0 / stiffness, 0.0) as body:
        assert body.advance(20.0, held=[10.0]) == DONE
        assert body.statuses == ("yielding",)
        assert body.forces[0] == pytest.approx(10.0 + math.cos(60.0), rel=1e-6)


#: Three masses of 1 kg, springs of 1 N/m to each other and to the ground; the middle mass has a damper to the ground.
SPRINGS = 2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
DAMPER = 0.4


def between_stiff_stops(stiffness: float, damping: float) -> tuple[mp.matrix, mp.matrix]:
    """Return the response of the three masses, pressed outwards to two stops, to the slow force and to the preload."""
    with mp.workdps(30):
        still = mp.matrix(SPRINGS.tolist())
        still[0, 0] += mp.mpf(stiffness)
        still[2, 2] += mp.mpf(stiffness)
        damped = mp.diag([mp.mpf(damping), mp.mpf(DAMPER), mp.mpf(damping)])
        slow = mp.mpf(SLOW)
        response = mp.lu_solve(
            still - slow**2 * mp.eye(3) + 1j * slow * damped, mp.matrix([0, mp.mpf("0.3"), mp.mpf(FORCE)])
        )
        return response, mp.lu_solve(still, mp.matrix([-2 * PRELOAD, 0, PRELOAD]))


@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e8, 1e12])
@pytest.mark.parametrize("ratio", [0.0, 0.1, 3.0])
def test_a_chain_between_two_stiff_stops_is_released_at_the_zero_of_its_force(
    stiffness: float, ratio: float
) -> None:
    # the two stops' own modes are equal except for their coupling by the chain; energies are recorded
    damping = 2.0 * ratio * math.sqrt(stiffness)
    response, still = between_stiff_stops(stiffness, damping)
    square, shapes = np.linalg.eigh(SPRINGS)
    natural, law = np.sqrt(square), {"law": "kelvin_voigt", "stiffness": stiffness, "damping": damping}
    stops = [Stop(shapes[2], 0.0, **law), Stop(shapes[0], 0.0, side="lower", **law)]
    modes = Modes(
        natural,
        0.0,
        shapes.T @ [0.0, 0.3, FORCE],
        SLOW,
        coupling=shapes.T @ np.diag([0.0, DAMPER, 0.0]) @ shapes,
    )
    start = np.array([float(mp.re(response[i]) + still[i]) for i in range(3)])
    speed = np.array([float(mp.re(1j * SLOW * response[i])) for i in range(3)])
    with mp.workdps(30):
        force = (mp.mpf(stiffness) + 1j * mp.mpf(damping) * mp.mpf(SLOW)) * response[2]
        level = mp.mpf(stiffness) * still[2]
        released = (mp.acos(-level / abs(force)) - mp.arg(force)) / mp.mpf(SLOW)

        def power(t: mp.mpf) -> mp.mpf:
            turn, slow = mp.expj(mp.mpf(SLOW) * t), 1j * mp.mpf(SLOW)
            loads = [-2 * PRELOAD, mp.mpf("0.3") * mp.re(turn), PRELOAD + mp.mpf(FORCE) * mp.re(turn)]
            return mp.fsum(load * mp.re(slow * x * turn) for load, x in zip(loads, response, strict=True))

        def drag(t: mp.mpf) -> mp.mpf:
            return mp.mpf(DAMPER) * mp.re(1j * mp.mpf(SLOW) * response[1] * mp.expj(mp.mpf(SLOW) * t)) ** 2

        half = released / 2
        work, loss = float(mp.quad(power, [0, half])), float(mp.quad(drag, [0, half]))
    with Structure(modes, stops, shapes.T @ start, shapes.T @ speed, energies=True) as body:
        held, began = shapes.T @ [-2.0 * PRELOAD, 0.0, PRELOAD], time.process_time()
        assert body.advance(float(half), held=held) == DONE
        assert body.forcing_work == pytest.approx(work, rel=1e-12)
        assert body.damping_loss == pytest.approx(loss, rel=1e-12)
        assert body.advance(0.5 * PERIOD - float(half), held=held) == DONE
        # by series a stop of 1e12 N/m takes 60 s
        assert time.process_time() - began < 1.0
        end = body.impacts[0, 1] + body.impacts[0, 7]
        # displacements of order 1 determine the depth in a stop only up to their rounding
        assert end == pytest.approx(float(released), abs=1e-11 + 4e-15 * stiffness)


def clamped_beam(modes: int) -> tuple[Modes, Array]:
    """Return a clamped-free beam in units of its first mode, pressed and lifted at its tip; and the tip's shape."""
    found = beam_modes("clamped_free", modes)
    natural = (np.asarray(found.eigenvalues) / found.eigenvalues[0]) ** 2
    tip = np.asarray(found.shapes([1.0]))[0]
    return Modes(natural, 0.1, tip, 0.2), tip


def test_a_rest_of_many_modes_costs_like_a_flight() -> None:
    modes, tip = clamped_beam(64)
    seconds, ends = [], []
    for by_series in (False, True):
        with Structure(modes, [Stop(tip, 0.0, restitution=0.3)], extrema=True, by_series=by_series) as body:
            began = time.process_time()
            assert body.advance(16.0 * math.pi if not by_series else 8.0 * math.pi) == DONE
            seconds.append(time.process_time() - began)
            ends.append(body.sticks)
    # the exact flow covers twice the time; 2 ms and 0.8 s on one machine
    assert seconds[0] < 0.1 * seconds[1]
    early = ends[0][: len(ends[1])]
    # three chatters, each of which multiplies rounding
    assert np.abs(early[:, 1:3] - ends[1][:, 1:3]).max() <= 4.0 * SEQUENCE


def test_a_rest_that_is_cut_keeps_its_energy() -> None:
    shape = np.array([1.0, -0.8, 0.5, 0.3])
    speed = np.array([0.1, 0.2, -0.1, 0.3])
    speed -= shape * (shape @ speed) / (shape @ shape)
    load, errors = 20.0 * shape, []
    for by_series in (False, True):
        stop = Stop(shape, 0.0, restitution=0.0)
        with Structure(Modes([0.7, 1.9, 3.1, 5.0]), [stop], 0.0, speed, by_series=by_series) as body:
            whole = body.energy - load @ body.displacement
            for _ in range(1000):
                body.advance(10.0, held=load)
            assert body.statuses == ("held",)
            errors.append(abs(body.energy - load @ body.displacement - whole) / whole)
    assert errors[0] <= 3e-14
    assert errors[0] < errors[1]


@st.composite
def rests(draw: st.DrawFn) -> tuple[Modes, list[Stop], Array, float]:
    """Draw bodies pressed to a rigid or a Kelvin-Voigt stop, their loads, and the duration of their run."""
    n = draw(st.integers(1, 10))
    numbers = st.lists(st.floats(0.1, 1.0), min_size=n, max_size=n).map(np.array)
    natural = 0.3 + np.cumsum(draw(numbers)) * draw(st.sampled_from([1.0, 3.0]))
    ratio = draw(st.sampled_from([0.0, 0.01, 0.3, 0.8])) * draw(numbers)
    shape, frequency = draw(numbers), draw(st.floats(0.05, 0.5))
    if n > 2:  # a node of one mode, or nearly
        shape[draw(st.integers(0, n - 1))] = draw(st.sampled_from([0.5, 0.0, 1e-9, 1e-17]))
    mobility = float(shape @ shape)
    stop = Stop(shape, draw(st.sampled_from([0.0, 0.3])), restitution=0.2)
    if draw(st.booleans()):
        stiffness = 10.0 ** draw(st.floats(2.0, 6.0))
        damping = draw(st.sampled_from([0.0, 0.1, 1.0, 3.0])) * 2.0 * math.sqrt(stiffness / mobility)
        stop = Stop(shape, stop.position, law="kelvin_voigt", stiffness=stiffness, damping=damping)
    stops = [stop]
    if draw(st.booleans()):  # further stops that may be met
        stops.append(Stop(draw(numbers), 1.0 + draw(st.floats(0.0, 2.0)), restitution=0.5))
    force = 0.3 * draw(st.floats(0.0, 1.0)) * shape
    return Modes(natural, ratio, force, frequency), stops, 1.5 * shape, draw(st.floats(0.5, 2.0)) / frequency


@st.composite
def coupled_rests(draw: st.DrawFn) -> tuple[Modes, list[Stop], Array, float]:
    """Draw bodies pressed to one to four stops, damped at single points, strongly, or by their modes."""
    n = draw(st.integers(1, 7))
    numbers = st.lists(st.floats(0.1, 1.0), min_size=n, max_size=n).map(np.array)
    signs = st.lists(st.sampled_from([-1.0, 1.0]), min_size=n, max_size=n).map(np.array)
    natural = 0.3 + np.cumsum(draw(numbers)) * draw(st.sampled_from([1.0, 3.0]))
    frequency, ratio, coupling = draw(st.floats(0.05, 0.5)), 0.0, None
    if draw(st.booleans()):
        point = draw(numbers) * draw(signs)
        coupling = draw(st.sampled_from([0.0, 0.01, 0.1])) * np.diag(natural**2)
        coupling += draw(st.sampled_from([0.01, 0.3, 3.0])) * np.outer(point, point)
    else:
        ratio = draw(st.sampled_from([0.0, 0.01, 0.3, 3.0])) * draw(numbers)
    stops, load = [], np.zeros(n)
    for _ in range(draw(st.integers(1, min(n, 4)))):
        shape = draw(numbers) * draw(signs)
        load += shape / (shape @ shape)
        if draw(st.booleans()):
            stops.append(Stop(shape, 0.0, restitution=0.2))
            continue
        stiffness = 10.0 ** draw(st.floats(2.0, 5.0))
        damping = draw(st.sampled_from([0.0, 0.1, 1.0])) * 2.0 * math.sqrt(stiffness / (shape @ shape))
        stops.append(Stop(shape, 0.0, law="kelvin_voigt", stiffness=stiffness, damping=damping))
    force = 0.2 * draw(st.floats(0.0, 1.0)) * load
    modes = Modes(natural, ratio, force, frequency, coupling=coupling)
    return modes, stops, 1.5 * load, draw(st.floats(0.5, 2.0)) / frequency


@FEW
@given(
    st.one_of(rests(), coupled_rests()),
    st.sampled_from([1, 3, 40]),
    st.booleans(),
    st.sampled_from([0.0, 0.02, -0.02]),
)
def test_a_rest_is_the_same_motion_as_by_series(
    scene: tuple[Modes, list[Stop], Array, float], steps: int, energies: bool, slope: float
) -> None:
    modes, stops, load, duration = scene
    runs = []
    for by_series in (False, True):
        with Structure(modes, stops, extrema=True, energies=energies, by_series=by_series) as body:
            for step in range(steps):
                held = (1.0 + slope * step / steps) * load
                body.advance(duration / steps, held=held, held_rate=slope / duration * load, most_impacts=60)
            end = [*body.displacement, *body.velocity, body.displacement_max, body.displacement_min]
            end += [body.forcing_work, body.damping_loss, body.contact_loss]
            runs.append((body.time, body.statuses, np.array(end), body.impacts, body.sticks))
    (at, statuses, end, impacts, sticks), (_, by, last, hits, rested) = runs
    # possible growth of rounding after this number of impacts
    allowed = 1e-11 * 1.3 ** min(len(hits), 60)
    if at < duration * (1.0 - 1e-9):
        return  # the impact limit ended the run
    assert statuses == by
    assert np.abs(end - last).max() <= allowed * (1.0 + np.abs(last).max())
    assert impacts.shape == hits.shape
    assert sticks.shape == rested.shape
    assert np.abs(impacts[:, 1] - hits[:, 1]).max(initial=0.0) <= allowed
    assert np.abs(sticks[:, 1:3] - rested[:, 1:3]).max(initial=0.0) <= allowed
