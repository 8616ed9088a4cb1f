"""Exact integrals over a flight: against an independent integration, and balances that hold at any damping."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vibroimpact.analysis.orbits.flight_work import FlightWork, coupled_flight_work, flight_work

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
START = np.array([0.3, -0.7, 0.5, -0.2])
CASES = [
    (1.0, 0.05, 0.9, 7.0),
    (1.0, 0.0, 1.0, 30.0),
    (3.0, 1.0, 0.9, 7.0),
    (3.0, 1.0 + 1e-9, 0.9, 7.0),
    (2.0, 30.0, 0.5, 7.0),
    (40.0, 0.01, 1.0, 7.0),
    (1e-3, 0.1, 2.0, 3.0),
]


def worked(natural: float, ratio: float, rate: float, length: float, start: Floats = START) -> FlightWork:
    arrays = np.array([natural]), np.array([ratio])
    return flight_work(*arrays, rate, np.array([length]), start.reshape(1, 1, 4))


@pytest.mark.parametrize(("natural", "ratio", "rate", "length"), CASES)
def test_integrals_are_those_of_an_integration_at_any_damping_and_at_resonance(
    natural: float, ratio: float, rate: float, length: float
) -> None:
    def slope(_: float, y: Floats) -> list[float]:
        return [natural * y[1], -natural * y[0] - 2 * ratio * natural * y[1] + y[2], -rate * y[3], rate * y[2],
                y[2] * y[1], y[1] ** 2]  # fmt: skip

    done = solve_ivp(slope, (0.0, length), [*START, 0.0, 0.0], method="LSODA", rtol=1e-12, atol=1e-14).y[
        :, -1
    ]
    found = worked(natural, ratio, rate, length)
    size = max(1.0, float(found.squared.item()))
    np.testing.assert_allclose(found.end.ravel(), done[:2], atol=2e-9 * size)
    assert found.forcing.item() == pytest.approx(done[4], abs=2e-9 * size)
    assert found.squared.item() == pytest.approx(done[5], abs=2e-9 * size)


@pytest.mark.parametrize(("natural", "ratio", "rate", "length"), CASES)
def test_what_a_mode_gains_is_the_work_of_the_force_less_the_loss_to_damping(
    natural: float, ratio: float, rate: float, length: float
) -> None:
    found = worked(natural, ratio, rate, length)
    gained = 0.5 * float((found.end**2).sum() - (START[:2] ** 2).sum())
    loss = 2.0 * ratio * natural * found.squared.item()
    turned_over = abs(found.forcing.item()) + loss + 1.0
    assert gained == pytest.approx(found.forcing.item() - loss, abs=2e-14 * turned_over)


def test_a_flight_in_two_parts_is_the_flight_in_one() -> None:
    natural, ratio, rate = 2.3, 0.07, 1.9
    first = worked(natural, ratio, rate, 1.7)
    turn = np.array([np.cos(rate * 1.7), np.sin(rate * 1.7)])
    force = np.array([START[2] * turn[0] - START[3] * turn[1], START[2] * turn[1] + START[3] * turn[0]])
    second = worked(natural, ratio, rate, 2.6, np.concatenate([first.end.ravel(), force]))
    whole = worked(natural, ratio, rate, 4.3)
    np.testing.assert_allclose(second.end, whole.end, atol=1e-14)
    assert first.forcing.item() + second.forcing.item() == pytest.approx(whole.forcing.item(), abs=1e-14)
    assert first.squared.item() + second.squared.item() == pytest.approx(whole.squared.item(), abs=1e-14)


def test_a_flight_without_length_changes_nothing() -> None:
    found = worked(2.0, 0.1, 1.0, 0.0)
    assert found.end.ravel().tolist() == START[:2].tolist()
    assert found.forcing.item() == found.squared.item() == 0.0


NATURAL, RATIOS = np.array([0.6, 1.6, 4.0]), np.array([0.0, 1.0, 0.03])
STARTS = np.array([[[0.3, -0.7, 0.5, -0.2], [0.1, 0.4, 0.0, 0.3], [-0.2, 0.9, 0.4, 0.1]]] * 2)
LENGTHS = np.array([0.4, 9.0])


def test_modes_that_a_diagonal_matrix_damps_are_those_of_their_damping_ratios() -> None:
    own = flight_work(NATURAL, RATIOS, 0.9, LENGTHS, STARTS)
    found = coupled_flight_work(NATURAL, np.diag(2.0 * RATIOS * NATURAL), 0.9, LENGTHS, STARTS)
    for one, other in zip(found, own, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-13)


def test_coupled_modes_gain_the_work_of_the_force_less_the_loss_to_damping_each_on_its_own() -> None:
    dashpots = np.array([[0.7, -0.4, 1.1], [0.1, 1.3, -0.2]])
    coupling = dashpots.T @ dashpots
    found = coupled_flight_work(NATURAL, coupling, 0.9, LENGTHS, STARTS)
    gained = 0.5 * ((found.end**2).sum(axis=-1) - (STARTS[..., :2] ** 2).sum(axis=-1))
    np.testing.assert_allclose(gained, found.forcing - found.damping, atol=1e-13)
    assert (found.damping.sum(axis=1) > 0.0).all()
    assert found.damping.min() < 0.0, "one mode takes energy from the others"
