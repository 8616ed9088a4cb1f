"""Points in lanes move as in the scalar engines; every instruction set and cut gives the same bits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.component_fmu import OscillatorFmu, forced, stop
from support.lane_points import (
    IMPACT,
    PEAK,
    PERIOD,
    TURN,
    Columns,
    Results,
    drawn,
    drawn_coupled,
    drawn_yielding,
    follow_alone,
    oscillators,
    run,
    taken,
)
from support.tolerance import LONG_PHASE, ORBIT

from vibroimpact.fmus.core.lanes import Instructions, LanesEnd, PointState, instructions
from vibroimpact.fmus.errors import UsageError

SIZES = [(1, 1), (1, 2), (1, 4), (2, 1), (3, 2), (8, 1), (2, 4), (5, 3)]
#: Largest difference of a point: a rounding after some dozen impacts, each of which may multiply it.
FLIGHTS = 1e-9
#: Largest difference after ten impacts of chaos, each of which multiplies a rounding by ten or so at most.
CHAOS = 1e-10
#: Number of impacts that are compared between many stops, and their largest difference.
FIRST, NEAR = 5, 1e-8
#: Most events of one point: elastic bodies between two stops would go on for long.
MOST = 300
PHASE, VELOCITY = 0.3665212101960540571, 0.7910497883492130773
"""Phase and velocity of the impacts of P(1,1) of m = k = 1, zeta .1, F .5, w 1, r .7, stop 1: closed form."""

COUPLED = [(2, 1), (3, 2), (5, 4), (8, 1), (8, 2)]
YIELDING = [(1, False), (2, False), (2, True)]
"""Numbers of contacts; whether the second stop is rigid, beside a Kelvin-Voigt stop."""
IN_CONTACT = 1e-7
"""Largest relative difference of a largest force: the rounding of the stop's position over the depth, times impacts."""

HERE = [each for each in Instructions if each and instructions() >= each]


def differences(points: Columns, found: Results, place: int) -> float:
    """Return the largest difference of a point's rows and last state from those of the scalar engine."""
    with follow_alone(points, place, impact_limit=MOST) as body:
        begin = points["begin"][place] * (1.0 - 1e-12)
        rows, impacts, periods = found.rows[place], body.impacts, body.periods
        impacts, periods = impacts[impacts[:, 1] >= begin], periods[periods[:, 1] >= begin]
        own = [rows[(rows[:, 0] == kind) & ~np.isnan(rows[:, 4])] for kind in (IMPACT, PERIOD)]
        assert [len(each) for each in own] == [len(impacts), len(periods)]
        pairs = [(own[0], impacts), (own[1][:, 2:], periods[:, 2:])]
        pairs += [(found.columns["final_q"][:, place], body.displacement)]
        return max((float(np.abs(one - other).max()) for one, other in pairs if len(one)), default=0.0)


@pytest.mark.parametrize(("modes", "contacts"), SIZES)
def test_random_bodies_do_in_lanes_what_the_scalar_engine_makes_of_them(modes: int, contacts: int) -> None:
    points = drawn(40, modes, contacts, seed=10 * modes + contacts)
    found = run(points, impact_limit=MOST)
    places = np.flatnonzero(found.has_run)
    assert len(places) >= 20
    assert max(differences(points, found, int(place)) for place in places) <= FLIGHTS


@pytest.mark.parametrize(("modes", "contacts"), SIZES)
def test_every_instruction_set_and_every_cut_gives_the_same_bits(modes: int, contacts: int) -> None:
    points = drawn(40, modes, contacts, seed=20 * modes + contacts)
    whole = run(points, impact_limit=MOST)
    for chosen in HERE:
        assert run(points, impact_limit=MOST, instructions=chosen).same_as(whole)
    assert run(points, impact_limit=MOST, most_seconds=0.0).same_as(whole)
    backwards = np.arange(40)[::-1]
    for places in (backwards, backwards[:13], backwards[:1]):
        part = run(taken(points, places), impact_limit=MOST)
        assert np.array_equal(part.columns["final_q"], whole.columns["final_q"][:, places], equal_nan=True)
        assert all(
            np.array_equal(rows, whole.rows[place], equal_nan=True)
            for rows, place in zip(part.rows, places, strict=True)
        )


@pytest.mark.parametrize(("modes", "contacts"), [(1, 2), (2, 1), (3, 2), (6, 3)])
def test_modes_without_a_spring_do_in_lanes_what_the_scalar_engine_makes_of_them(
    modes: int, contacts: int
) -> None:
    points = drawn(30, modes, contacts, seed=60 + 10 * modes + contacts)
    points["stiffness"][0, :20] = points["stiffness"][-1, 15:25] = 0.0
    loose = points["stiffness"] == 0.0
    points["held"][loose] = 0.0
    points["decay"][loose] *= np.broadcast_to(np.arange(30) % 2, loose.shape)[loose]
    found = run(points, impact_limit=MOST)
    places = np.flatnonzero(found.has_run & loose.any(axis=0))
    assert len(places) >= 5
    assert max(differences(points, found, int(place)) for place in places) <= FLIGHTS
    for chosen in HERE:
        assert run(points, impact_limit=MOST, instructions=chosen).same_as(found)


@pytest.mark.parametrize(("modes", "contacts"), COUPLED)
def test_modes_that_damp_each_other_do_in_lanes_what_the_scalar_engine_makes_of_them(
    modes: int, contacts: int
) -> None:
    points = drawn_coupled(40, modes, contacts, seed=80 + 10 * modes + contacts)
    found = run(points, impact_limit=MOST, rate=2.0)
    places = np.flatnonzero(found.has_run)
    assert len(places) >= 12
    assert max(differences(points, found, int(place)) for place in places) <= FLIGHTS
    for chosen in HERE:
        assert run(points, impact_limit=MOST, rate=2.0, instructions=chosen).same_as(found)
    backwards = run(taken(points, np.arange(40)[20::-1]), impact_limit=MOST)
    assert np.array_equal(backwards.columns["final_q"], found.columns["final_q"][:, 20::-1], equal_nan=True)


@given(seed=st.integers(0, 10_000), modes=st.integers(2, 8), contacts=st.integers(0, 4))
@settings(deadline=None, max_examples=15)
def test_first_flights_of_coupled_modes_are_those_of_the_scalar_engine(
    seed: int, modes: int, contacts: int
) -> None:
    points = drawn_coupled(8, modes, contacts, seed)
    points["begin"] = np.zeros(8)
    found = run(points, impact_limit=FIRST, extrema=False, periods=False)
    for place in np.flatnonzero(found.has_run):
        rows = found.rows[place]
        with follow_alone(points, int(place), impact_limit=FIRST) as body:
            impacts = body.impacts[: len(rows)]
            assert rows[:, 1:6] == pytest.approx(impacts[:, 1:6], abs=NEAR)
            assert found.columns["final_q"][:, place] == pytest.approx(body.displacement, abs=NEAR)


def test_damping_of_each_mode_alone_moves_the_same_bits_as_a_matrix_and_as_a_ratio() -> None:
    points = drawn(24, 3, 2, seed=5)
    points["stiffness"][0, :6] = points["held"][0, :6] = 0.0
    matrix = np.stack([np.diag(2.0 * decay) for decay in points["decay"].T], axis=-1)
    ratio = run(points, impact_limit=MOST, rate=3.0)
    assert run({**points, "coupling": matrix}, impact_limit=MOST, rate=3.0).same_as(ratio)


def test_a_dashpot_moves_a_mode_without_a_spring_only_if_no_other_mode_moves_with_it() -> None:
    points = drawn_coupled(12, 3, 1, seed=7)
    points["stiffness"][0] = points["held"][0] = 0.0
    points["coupling"][0, :, :6] = points["coupling"][:, 0, :6] = points["decay"][0, :6] = 0.0
    found = run(points, impact_limit=MOST)
    coupled = points["coupling"][0, 1] != 0.0
    assert not found.has_run[coupled].any()
    assert found.has_run[:6].sum() >= 3
    assert max(differences(points, found, int(place)) for place in np.flatnonzero(found.has_run)) <= FLIGHTS


def test_lanes_leave_modes_that_damp_each_other_next_to_critical_damping() -> None:
    points = taken(drawn_coupled(1, 2, 1, seed=3), np.zeros(3, np.int64))
    points["stiffness"][:] = [[1.0], [4.0]]
    # one dashpot of these shapes gives s^2 + c s + k a double root at s = -3/2: 1 = sum of c_i s / (s^2 + k_i)
    second = 1.0 / (1.5 / 3.25 * (1.75 / 6.25**2) / (1.25 / 3.25**2) + 1.5 / 6.25)
    shape = np.sqrt([second * (1.75 / 6.25**2) / (1.25 / 3.25**2), second])
    for place, factor in enumerate((1.0, 1.0 + 1e-9, 0.5)):
        points["coupling"][..., place] = factor * np.outer(shape, shape)
    points["decay"] = 0.5 * np.einsum("iip->ip", points["coupling"])
    assert run(points).has_run.tolist() == [False, False, True]


def test_a_constant_force_on_a_mode_without_a_spring_brings_it_back_at_the_times_of_free_fall() -> None:
    speed, restitution, load = 2.0, np.array([0.7, 0.8, 0.95]), 1.5
    points = oscillators(
        3, 0, 5, stiffness=0.0, decay=0.0, force=0.0, held=load, angular_frequency=TURN / 2.0, position=1.0,
        restitution=restitution, start_q=0.0, start_p=-speed,
    )  # fmt: skip
    found = run(points)
    first = math.hypot(speed, math.sqrt(2.0 * load))
    assert found.has_run.all()
    for rows, factor in zip(found.rows, restitution, strict=True):
        impacts = rows[rows[:, 0] == IMPACT]
        speeds = first * factor ** np.arange(len(impacts))
        returns = np.cumsum(2.0 * speeds[1:] / load)
        assert len(impacts) >= 3
        assert impacts[:, 3] == pytest.approx(speeds, rel=1e-12)
        assert impacts[:, 1] == pytest.approx((speed + first) / load + np.append(0.0, returns), rel=1e-13)


@pytest.mark.parametrize(("contacts", "rigid"), YIELDING)
def test_random_bodies_on_stops_that_yield_do_in_lanes_what_the_scalar_engine_makes_of_them(
    contacts: int, *, rigid: bool
) -> None:
    points = drawn_yielding(60, contacts, seed=40 + contacts + rigid, rigid=rigid)
    found = run(points, impact_limit=MOST)
    places = np.flatnonzero(found.has_run)
    assert len(places) >= 50
    for place in places:
        assert differences(points, found, int(place)) <= FLIGHTS
        with follow_alone(points, int(place), impact_limit=MOST) as body:
            begin, peaks = points["begin"][place] * (1.0 - 1e-12), body.peaks
            peaks, own = peaks[peaks[:, 1] >= begin, 3], found.rows[place]
            assert own[own[:, 0] == PEAK, 3] == pytest.approx(peaks, rel=IN_CONTACT)


@pytest.mark.parametrize(("contacts", "rigid"), YIELDING)
def test_stops_that_yield_have_the_same_bits_in_every_instruction_set_and_cut(
    contacts: int, *, rigid: bool
) -> None:
    points = drawn_yielding(40, contacts, seed=50 + contacts + rigid, rigid=rigid)
    whole = run(points, impact_limit=MOST)
    for chosen in HERE:
        assert run(points, impact_limit=MOST, instructions=chosen).same_as(whole)
    assert run(points, impact_limit=MOST, most_seconds=0.0).same_as(whole)
    backwards = np.arange(40)[::-1]
    part = run(taken(points, backwards), impact_limit=MOST)
    assert np.array_equal(part.columns["final_q"], whole.columns["final_q"][:, backwards], equal_nan=True)
    for recorded in ({"extrema": False}, {"impacts": False}, {"rate": 7.3}):
        other = run(points, impact_limit=MOST, **recorded)
        assert np.array_equal(other.columns["final_q"], whole.columns["final_q"], equal_nan=True)


def test_a_mass_rebounds_from_a_kelvin_voigt_stop_as_the_closed_form_says() -> None:
    # equations.md 6.9: restitution and duration until the force is 0, for a mass on a soft spring
    ratio, rate, soft = np.array([0.0, 0.1, 0.5, 0.9]), 1e3, 1e-12
    points = oscillators(
        4, 0, 1, decay=0.0, force=0.0, angular_frequency=1.0, stiffness=soft, position=1.0, restitution=0.0,
        contact_stiffness=rate**2, contact_damping=2.0 * ratio * rate, start_q=0.0, start_p=2.0,
    )  # fmt: skip
    points["begin"] = np.zeros(4)
    found = run(points)
    impacts = np.array([rows[rows[:, 0] == IMPACT][0] for rows in found.rows])
    turned = np.sqrt(1.0 - ratio**2)
    assert impacts[:, 6] == pytest.approx(np.exp(-2.0 * ratio * np.arccos(ratio) / turned), abs=1e-11)
    assert impacts[:, 7] == pytest.approx(2.0 * np.arccos(ratio) / (rate * turned), rel=1e-10)
    assert impacts[:, 4] == pytest.approx(2.0 * (1.0 + impacts[:, 6]), rel=1e-10)
    assert impacts[:, 3] == pytest.approx(2.0, rel=1e-11)


def test_a_contact_that_is_open_at_the_end_has_an_impact_without_an_end() -> None:
    points = oscillators(
        8, 0, 1, decay=0.05, force=0.0, held=2.0, angular_frequency=TURN / 10.0, position=1.0, restitution=0.0,
        contact_stiffness=9.0, contact_damping=0.5, start_q=np.linspace(0.0, 0.4, 8), start_p=0.0,
    )  # fmt: skip
    points["begin"] = np.zeros(8)
    found = run(points)
    assert found.has_run.all()
    for place, rows in enumerate(found.rows):
        with follow_alone(points, place) as body:
            assert body.statuses == ("yielding",)
            ended = body.impacts
        last = rows[rows[:, 0] == IMPACT][-1]
        assert len(ended) + 1 == np.count_nonzero(rows[:, 0] == IMPACT)
        assert np.isfinite(last[[1, 2, 3]]).all()
        assert np.isnan(last[[4, 6, 7]]).all()


@pytest.mark.parametrize(("modes", "contacts"), SIZES)
def test_a_record_changes_no_bit_of_the_motion(modes: int, contacts: int) -> None:
    points = drawn(40, modes, contacts, seed=30 * modes + contacts)
    whole = run(points, impact_limit=MOST)
    ends = ("state", "reached", "final_q", "final_p")
    records = [{"extrema": False}, {"impacts": False}, {"extrema": False, "impacts": False}]
    if modes == 1:  # strobes cut the flights of several modes
        records.append({"extrema": False, "periods": False})
    for recorded in records:
        other = run(points, impact_limit=MOST, **recorded)
        assert all(np.array_equal(other.columns[name], whole.columns[name], equal_nan=True) for name in ends)
        for one, rows in zip(whole.rows, other.rows, strict=True):
            strobes, impacts = (rows[rows[:, 0] == kind] for kind in (PERIOD, IMPACT))
            assert len(strobes) == 0 or np.array_equal(strobes[:, 4:], one[one[:, 0] == PERIOD][:, 4:])
            assert len(impacts) == 0 or np.array_equal(impacts, one[one[:, 0] == IMPACT])


@pytest.mark.parametrize(("modes", "contacts"), SIZES)
def test_one_row_for_all_periods_reduces_the_rows_of_each(modes: int, contacts: int) -> None:
    points = drawn(40, modes, contacts, seed=40 * modes + contacts)
    each, reduced = run(points, impact_limit=MOST), run(points, impact_limit=MOST, each_period=False)
    assert np.array_equal(each.columns["periods_of"], reduced.columns["periods_of"])
    for rows, one in zip(each.rows, reduced.rows, strict=True):
        periods, impacts = rows[rows[:, 0] == PERIOD], rows[rows[:, 0] == IMPACT]
        assert np.array_equal(one[one[:, 0] == IMPACT], impacts)
        if len(periods):
            found = one[one[:, 0] == PERIOD][0, 2:7]
            last = periods[-1, 4:6]
            expected = [periods[:, 2].max(), periods[:, 3].min(), *last, periods[:, 6].sum() / len(periods)]
            assert found[2:].tolist() == expected[2:]
            # a strobe that cuts the record of a flight moves its extremes by roundings
            assert found[:2] == pytest.approx(expected[:2], rel=1e-14, abs=1e-14 * np.ptp(found[:2]))


@settings(max_examples=10)
@given(modes=st.integers(2, 8), contacts=st.integers(0, 4), light=st.booleans(), seed=st.integers(0, 10**6))
def test_the_first_impacts_between_many_stops_are_those_of_the_scalar_engine(
    modes: int, contacts: int, light: bool, seed: int
) -> None:
    points = drawn(8, modes, contacts, seed, transient=0)
    points["decay"] *= 1e-3 if light else 1.0
    found = run(points, impact_limit=MOST)
    for place in np.flatnonzero(found.has_run):
        own = found.rows[place][found.rows[place][:, 0] == IMPACT]
        with follow_alone(points, int(place), impact_limit=MOST) as body:
            first = body.impacts[body.impacts[:, 1] >= points["begin"][place] * (1.0 - 1e-12)][:FIRST]
        assert len(first) == min(len(own), FIRST)
        assert own[:FIRST, 5].tolist() == first[:, 5].tolist()
        assert np.abs(own[:FIRST, [1, 3]] - first[:, [1, 3]]).max(initial=0.0) <= NEAR


SAMPLED = [(1, 2, True), (1, 1, False), (1, 4, False), (2, 1, False), (8, 1, False), (5, 3, False)]
"""Numbers of modes and contacts; whether the stops yield."""


@pytest.mark.parametrize(("modes", "contacts", "yields"), SAMPLED)
@pytest.mark.parametrize("rate", [0.9, 7.3])
def test_samples_are_those_of_the_scalar_engine_and_change_no_bit_of_the_motion(
    modes: int, contacts: int, rate: float, *, yields: bool
) -> None:
    points = drawn_yielding(16, contacts, seed=60) if yields else drawn(16, modes, contacts, seed=60)
    points["begin"] = np.maximum(points["begin"], 1e-3)
    plain = run(points, impact_limit=MOST)
    found = run(points, impact_limit=MOST, rate=rate)
    assert all(one.tobytes() == other.tobytes() for one, other in zip(found.rows, plain.rows, strict=True))
    backwards = np.arange(16)[::-1]
    part = run(taken(points, backwards[:13]), impact_limit=MOST, rate=rate).columns["samples"]
    whole = found.columns["samples"][:, backwards[:13], : part.shape[2]]
    assert np.array_equal(part, whole, equal_nan=True)
    for place in np.flatnonzero(found.has_run & (found.columns["outcome"] == 0)):
        begin, end = float(points["begin"][place]), float(points["end"][place])
        count = math.floor((end - begin) * rate * (1.0 + 1e-12)) + 1
        assert found.columns["samples_of"][place] == count
        shapes = np.concatenate([points["shape"][:, :, place], points["observed"][None, :, place]])
        with follow_alone({**points, "end": points["begin"]}, int(place)) as body:
            for n in range(count):
                further = min(begin + n / rate, end) - body.time
                if further > 0.0:
                    body.advance(further, held=points["held"][:, place])
                values = found.columns["samples"][:, place, n]
                assert np.abs(values[0::2] - shapes @ body.displacement).max() <= FLIGHTS
                assert np.abs(values[1::2] - shapes @ body.velocity).max() <= 100.0 * FLIGHTS


def test_rows_that_find_no_room_are_asked_for() -> None:
    points = drawn(60, 1, 2, seed=5, recorded=60)
    small, large = run(points, impact_limit=MOST), run(points, impact_limit=MOST, room=100_000)
    assert LanesEnd.full in small.ends
    assert LanesEnd.full not in large.ends
    assert small.same_as(large)


BAD = {
    "stiffness": (math.nan, -1.0, math.inf),
    "decay": (math.nan, -0.1),
    "force": (math.nan, math.inf),
    "angular_frequency": (math.nan, -1.0, 1e-305),
    "phase": (math.inf,),
    "impulse": (0.0, -1.0, math.nan),
    "position": (math.nan, -5.0),
    "direction": (0.0,),
    "restitution": (math.nan, 1.01, -0.01),
    "yield_velocity": (-1.0, math.nan),
    "start_q": (math.nan, 7.0),
    "end": (math.nan, -1.0),
}


@pytest.mark.parametrize("modes", [1, 2])
def test_a_point_that_a_body_refuses_is_left_and_its_neighbours_do_not_know(modes: int) -> None:
    cases = [(name, value) for name, values in BAD.items() for value in values]
    good = drawn(2 * len(cases), modes, 1, seed=3)
    points = {name: array.copy() for name, array in good.items()}
    spoilt = np.arange(0, 2 * len(cases), 2)
    for place, (name, value) in zip(spoilt, cases, strict=True):
        points[name][..., place] = value
    found, others = run(points, impact_limit=MOST), run(taken(good, spoilt + 1), impact_limit=MOST)
    assert np.all(found.columns["state"][spoilt] == PointState.is_left)
    for name in ("state", "outcome", "reached"):
        assert np.array_equal(found.columns[name][spoilt + 1], others.columns[name], equal_nan=True)
    for place, rows in zip(spoilt + 1, others.rows, strict=True):
        assert np.array_equal(found.rows[place], rows, equal_nan=True)


def test_the_impacts_of_a_periodic_orbit_are_those_of_the_closed_form() -> None:
    start = {"start_q": np.linspace(0.2, 0.9, 24), "start_p": np.linspace(-0.5, 0.5, 24)}
    body = {"decay": 0.1, "force": 0.5, "angular_frequency": 1.0, "position": 1.0, "restitution": 0.7}
    found = run(oscillators(24, 400, 3, **body, **start))
    assert found.has_run.all()
    for rows in found.rows:
        impacts = rows[rows[:, 0] == IMPACT]
        assert len(impacts) == 3
        assert np.abs(impacts[:, 2] - PHASE).max() <= ORBIT
        assert np.abs(impacts[:, 3] - VELOCITY).max() <= ORBIT


def test_the_phase_of_a_periodic_orbit_is_as_exact_after_a_quarter_of_a_million_periods() -> None:
    body = {"decay": 0.1, "force": 0.5, "angular_frequency": 1.0, "position": 1.0, "restitution": 0.7}
    found = run(oscillators(8, 250_000, 1, **body, start_q=np.linspace(0.2, 0.9, 8), start_p=0.0))
    phases = [rows[rows[:, 0] == IMPACT][0, 2] for rows in found.rows]
    assert np.abs(np.array(phases) - PHASE).max() <= LONG_PHASE


def test_the_first_ten_impacts_of_chaos_are_those_of_the_oscillator() -> None:
    start = np.linspace(-0.9, -0.1, 12)
    body = {"decay": 0.0, "force": 1.0, "angular_frequency": 2.8, "position": 0.0, "restitution": 0.8}
    points = oscillators(12, 0, 15, **body, start_q=start, start_p=0.1)
    found = run(points)
    for place in np.flatnonzero(found.has_run):
        parameters = forced(1.0, 2.8, 0.0, displacement_start=start[place], velocity_start=0.1)
        with OscillatorFmu({**parameters, **stop(0.0, 0.8), "record.impacts": True}) as o:
            o.step(float(points["end"][place]))
            alone = o.rows()
        impacts = found.rows[place][found.rows[place][:, 0] == IMPACT]
        assert len(impacts) >= 10
        assert np.abs(impacts[:10, 1:] - alone[:10, 1:]).max() <= CHAOS


def test_a_branch_goes_on_from_where_the_point_before_has_ended() -> None:
    body = {"decay": 0.1, "force": 0.5, "angular_frequency": np.linspace(0.8, 1.1, 12), "position": 1.0}
    points = oscillators(12, 4, 3, **body, restitution=0.7, start_q=0.1, start_p=0.2)
    points["first"] = np.array([1, 0, 0, 0] * 3, np.uint8)
    found = run(points)
    assert found.has_run.all()
    for place in range(12):
        alone = taken(points, np.array([place]))
        if not points["first"][place]:
            alone["start_q"], alone["start_p"] = (
                found.columns[name][:, place - 1 : place] for name in ("final_q", "final_p")
            )
        assert np.array_equal(run(alone).rows[0], found.rows[place])


def test_a_point_that_is_left_holds_up_its_branch_alone() -> None:
    points = drawn(9, 1, 1, seed=8)
    points["first"] = np.array([1, 0, 0] * 3, np.uint8)
    points["restitution"][0, 4] = 2.0
    found = run(points, impact_limit=MOST)
    assert found.ends[-1] is LanesEnd.left
    waiting, left = PointState.waits, PointState.is_left
    assert list(found.columns["state"][3:6]) == [PointState.has_run, left, waiting]


def test_a_run_ends_at_its_limit_of_impacts() -> None:
    points = oscillators(
        3, 0, 50, decay=0.0, force=0.0, angular_frequency=1.0, position=0.5, restitution=1.0, start_q=-1.0
    )
    found = run(points, impact_limit=7)
    assert list(found.columns["outcome"]) == [2, 2, 2]
    assert all(np.count_nonzero(rows[:, 0] == IMPACT) == 7 for rows in found.rows)
    assert np.array_equal(
        found.columns["reached"], [rows[rows[:, 0] == IMPACT][-1, 1] for rows in found.rows]
    )


def test_an_instruction_set_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_INSTRUCTIONS", "baseline")
    assert instructions() is Instructions.baseline
    monkeypatch.setenv("VIBROIMPACT_INSTRUCTIONS", "mmx")
    with pytest.raises(UsageError, match=r"VIBROIMPACT_INSTRUCTIONS: expected .*baseline.*, got 'mmx'"):
        instructions()


@pytest.mark.parametrize(("modes", "contacts"), [(0, 1), (9, 1), (1, 5)])
def test_more_modes_or_contacts_than_lanes_have_are_refused(modes: int, contacts: int) -> None:
    with pytest.raises(UsageError, match=f"got {modes}, {contacts} and 0"):
        run(drawn(1, modes, contacts, 0) if contacts < 3 and modes else _sized(modes, contacts))


def _sized(modes: int, contacts: int) -> Columns:
    points = drawn(1, 1, 1, 0)
    return {**points, "stiffness": np.ones((modes, 1)), "position": np.ones((contacts, 1))}
