"""Points under several sines in lanes move as in the scalar engine, with phases that stay exact."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from support.lane_points import (
    IMPACT,
    PERIOD,
    TURN,
    Columns,
    Results,
    drawn,
    drawn_coupled,
    follow_alone,
    oscillators,
    run,
    taken,
    with_sines,
)

from vibroimpact.fmus.core.lanes import Instructions, instructions

MOST = 300
"""Most events of one point."""
FIRST, FLIGHTS = 6, 1e-9
"""Number of impacts that are compared, each of which may multiply a rounding; largest difference up to there."""
KINDS = [(1, 1, 2), (1, 2, 4), (1, 4, 1), (1, 0, 7), (2, 1, 2), (3, 2, 3), (5, 3, 4)]
"""Numbers of modes, contacts and further sines."""
HERE = [each for each in Instructions if each and instructions() >= each]


def differences(points: Columns, found: Results, place: int) -> float:
    """Return the largest difference of the first rows of a point from those of the scalar engine."""
    with follow_alone(points, place, impact_limit=MOST) as body:
        begin = points["begin"][place] * (1.0 - 1e-12)
        impacts, periods = (each[each[:, 1] >= begin] for each in (body.impacts, body.periods))
        own, turns = (found.rows[place][found.rows[place][:, 0] == kind] for kind in (IMPACT, PERIOD))
        assert [len(own), len(turns)] == [len(impacts), len(periods)]
        before = np.flatnonzero(body.impacts[:, 1] < begin).size
        compared = max(FIRST - before, 0)
        end = impacts[compared, 1] if len(impacts) > compared else math.inf
        clear = periods[:, 1] + TURN / points["angular_frequency"][place] < end
        pairs = [(own[:compared], impacts[:compared]), (turns[clear, 2:], periods[clear, 2:])]
        return max((float(np.abs(one - other).max()) for one, other in pairs if len(one)), default=0.0)


@pytest.mark.parametrize("one_period", [False, True])
@pytest.mark.parametrize(("modes", "contacts", "further"), KINDS)
def test_bodies_under_sines_do_in_lanes_what_the_scalar_engine_makes_of_them(
    modes: int, contacts: int, further: int, one_period: bool
) -> None:
    points = drawn(24, modes, contacts, seed=modes + contacts, transient=1, recorded=3)
    points = with_sines(points, further, seed=further, one_period=one_period)
    found = run(points, impact_limit=MOST)
    places = np.flatnonzero(found.has_run)
    assert len(places) >= 6
    assert max(differences(points, found, int(place)) for place in places) <= FLIGHTS


def test_coupled_modes_under_sines_do_in_lanes_what_the_scalar_engine_makes_of_them() -> None:
    points = with_sines(drawn_coupled(24, 3, 2, seed=5, transient=1, recorded=3), 2, seed=5)
    found = run(points, impact_limit=MOST)
    places = np.flatnonzero(found.has_run)
    assert len(places) >= 6
    assert max(differences(points, found, int(place)) for place in places) <= FLIGHTS


@pytest.mark.parametrize(("modes", "contacts", "further"), [(1, 1, 2), (1, 2, 3), (2, 1, 2)])
def test_every_instruction_set_cut_and_neighbour_gives_the_same_bits(
    modes: int, contacts: int, further: int
) -> None:
    points = with_sines(drawn(40, modes, contacts, seed=3), further, seed=4)
    harmonics = np.array([2.0, 3.0, 5.0])[:further, None] * points["angular_frequency"]
    points["further_frequency"][:, ::2] = harmonics[:, ::2]
    whole = run(points, impact_limit=MOST, rate=3.0)
    for chosen in HERE:
        assert run(points, impact_limit=MOST, rate=3.0, instructions=chosen).same_as(whole)
    assert run(points, impact_limit=MOST, rate=3.0, most_seconds=0.0).same_as(whole)
    for place in (6, 7):
        alone = run(taken(points, np.array([place])), impact_limit=MOST, rate=3.0)
        assert all(
            np.array_equal(alone.columns[name][..., 0], whole.columns[name][..., place], equal_nan=True)
            for name in ("final_q", "final_p", "reached", "state")
        )


@settings(max_examples=20, deadline=None)
@given(
    ratio=st.sampled_from([1.0, 0.5, 2.0, 3.0, math.sqrt(2.0), 0.3]),
    amplitudes=st.lists(st.floats(-0.4, 0.4), min_size=1, max_size=7),
    phases=st.lists(st.floats(-6.0, 6.0), min_size=7, max_size=7),
    modes=st.sampled_from([1, 2]),
)
def test_sines_of_one_frequency_are_one_sine(
    ratio: float, amplitudes: list[float], phases: list[float], modes: int
) -> None:
    amplitudes = amplitudes[: 7 if modes == 1 else 4]
    points = drawn(8, modes, 1, seed=len(amplitudes), transient=1, recorded=2)
    count = len(amplitudes)
    frequency = ratio * points["angular_frequency"]
    share = np.ones_like(points["force"])

    def under(sizes: list[float], turns: list[float]) -> Results:
        force = np.array(sizes)[:, None, None] * share
        further = np.tile(frequency, (len(sizes), 1))
        phase = np.array(turns)[:, None] * np.ones(8)
        return run({**points, "further_force": force, "further_frequency": further, "further_phase": phase})

    several = under(amplitudes, phases[:count])
    sum_of = sum(size * np.exp(1j * turn) for size, turn in zip(amplitudes, phases, strict=False))
    one = under([abs(sum_of)], [float(np.angle(sum_of))])
    both = several.has_run & one.has_run
    few = both & (one.columns["rows_of"] == several.columns["rows_of"]) & (one.columns["rows_of"] <= 3)
    assert np.abs(several.columns["final_q"] - one.columns["final_q"])[:, few].max(initial=0.0) <= 1e-10


def steady_error(frequency: float, ratios: list[float], phases: list[float], periods: int) -> float:
    """Return the error of a damped mode's displacement after whole periods under sines, from its steady motion."""
    own = [frequency, *(ratio * frequency for ratio in ratios)]
    shape = (len(ratios), 1, 1)
    points = oscillators(1, periods - 1, 1, angular_frequency=frequency, force=1.0, decay=2.0, position=1e9,
                         restitution=1.0, start_q=0.0, start_p=0.0)  # fmt: skip
    points |= {
        "further_force": np.ones(shape),
        "further_frequency": np.array(own[1:])[:, None],
        "further_phase": np.array(phases)[:, None],
    }
    found = run(points, impacts=False, extrema=False)
    assert found.has_run.all()
    with mp.workdps(50):
        end = 2 * mp.pi * periods / mpf(frequency)
        response = sum(
            mp.re(mp.exp(1j * (mpf(w) * end + mpf(a))) / mp.mpc(1 - mpf(w) ** 2, 4 * mpf(w)))
            for w, a in zip(own, [0.0, *phases], strict=True)
        )
        return float(abs(found.columns["final_q"][0, 0] - response))


@settings(max_examples=20, deadline=None)
@given(
    frequency=st.floats(0.3, 3.0),
    ratios=st.lists(st.floats(0.2, 5.0), min_size=1, max_size=4),
    phases=st.lists(st.floats(-6.0, 6.0), min_size=4, max_size=4),
    periods=st.integers(200, 2000),
)
def test_a_phase_is_exact_after_any_number_of_periods(
    frequency: float, ratios: list[float], phases: list[float], periods: int
) -> None:
    assert steady_error(frequency, ratios, phases[: len(ratios)], periods) <= 4e-15 * (1 + len(ratios))


@pytest.mark.parametrize(("frequency", "ratios"), [(1.3, [math.sqrt(2.0), 0.7]), (0.7, [2.0, 3.0])])
def test_a_phase_in_the_millionth_period_is_as_exact_as_in_the_first(
    frequency: float, ratios: list[float]
) -> None:
    assert steady_error(frequency, ratios, [1.0, -2.0], 1_000_000) <= 4e-15


def test_a_sine_of_no_amplitude_changes_nothing_but_roundings() -> None:
    points = drawn(40, 1, 1, seed=8)
    silent = with_sines(points, 2, seed=1)
    silent["further_force"] = np.zeros_like(silent["further_force"])
    one, other = run(points, impact_limit=MOST), run(silent, impact_limit=MOST)
    assert np.array_equal(one.has_run, other.has_run)
    few = one.has_run & (one.columns["rows_of"] <= FIRST)
    assert np.count_nonzero(few) > 10
    difference = one.columns["final_q"] - other.columns["final_q"]
    assert np.abs(difference[:, few]).max() <= 1e-10


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("further_frequency", 0.0),
        ("further_frequency", -1.0),
        ("further_frequency", math.inf),
        ("further_frequency", 1e200),
        ("further_phase", math.nan),
        ("further_force", math.inf),
    ],
)
@pytest.mark.parametrize("modes", [1, 2])
def test_a_point_with_an_impossible_sine_is_left_and_its_neighbours_run(
    modes: int, name: str, value: float
) -> None:
    points = with_sines(drawn(20, modes, 1, seed=2), 2, seed=2)
    whole = run(points)
    points[name] = points[name].copy()
    points[name][..., 3] = value
    found = run(points)
    assert not found.has_run[3]
    others = np.arange(20) != 3
    assert np.array_equal(found.has_run[others], whole.has_run[others])


def test_a_sine_close_to_resonance_keeps_its_digits_in_one_mode() -> None:
    """The tables of one mode need no steady response; bodies of several modes leave such a point."""
    points = with_sines(drawn(24, 1, 1, seed=6, transient=0, recorded=3), 1, seed=6)
    points["decay"] = np.zeros_like(points["decay"])
    points["further_frequency"] = np.sqrt(points["stiffness"]) * (1.0 + 1e-4)
    found = run(points, impact_limit=MOST)
    places = [int(place) for place in np.flatnonzero(found.has_run)]
    assert len(places) >= 6
    assert max(differences(points, found, place) for place in places) <= 1e-8


def test_several_modes_leave_a_sine_at_resonance() -> None:
    points = with_sines(drawn(16, 2, 1, seed=6), 1, seed=6)
    points["decay"] = np.zeros_like(points["decay"])
    points["further_frequency"] = np.sqrt(points["stiffness"][:1])
    assert not run(points, impact_limit=MOST).has_run.any()
