"""Laws of every free decay: units and clocks do not matter, and damping takes energy out."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.decay.decrement import logarithmic_decrement
from vibroimpact.analysis.decay.exponential import fit_exponential
from vibroimpact.analysis.decay.laws import TERMS, damping_law
from vibroimpact.analysis.decay.motion import Coefficients, half_swings
from vibroimpact.analysis.decay.samples import DecaySamples

TURN = np.arange(0.0, 100.0, 0.25)


@settings(max_examples=40)
@given(
    st.floats(-6.0, 6.0),
    st.floats(-5.0, 5.0),
    st.floats(-3.0, 3.0),
    st.floats(0.002, 0.08),
    st.integers(0, 1000),
)
def test_the_damping_ratio_does_not_depend_on_units_clock_or_offset(
    size: float, pace: float, offset: float, ratio: float, seed: int
) -> None:
    noise = 0.01 * np.random.default_rng(seed).normal(size=len(TURN))
    motion = np.exp(-ratio * TURN) * np.cos(TURN) + noise
    scale, clock = 10.0**size, 10.0**pace
    plain = DecaySamples(TURN, motion)
    other = DecaySamples(TURN * clock, scale * (motion + offset))
    for estimate in (fit_exponential, logarithmic_decrement):
        one, two = estimate(plain).damping_ratio, estimate(other).damping_ratio
        np.testing.assert_allclose(two.value, one.value, rtol=1e-6)
        np.testing.assert_allclose(two.standard_error, one.standard_error, rtol=1e-4)


@settings(max_examples=60)
@given(st.floats(0.0, 0.2), st.floats(0.0, 0.3), st.floats(0.0, 0.2), st.floats(-0.2, 0.3))
def test_no_damping_law_ever_adds_energy(
    viscous: float, coulomb: float, quadratic: float, cubic: float
) -> None:
    assume(viscous + coulomb + quadratic > 1e-3)
    omega, start = np.ones(1), np.ones(1)
    known = Coefficients(omega, *(np.array([value]) for value in (viscous, coulomb, quadratic, cubic)))
    nodes = half_swings(np.zeros(1), start, known, 60.0)
    place, speed = nodes.displacement[:, :, 0], nodes.velocity[:, :, 0]
    energy = (0.5 * speed**2 + 0.5 * place**2 + 0.25 * cubic * place**4).ravel()
    assert np.all(np.isfinite(energy))
    # Seventeen points a swing are exact to 1e-6 for a loss of a quarter; the last point leaves the cubic spring out.
    dead = np.abs(place).ravel() <= 3.0 * coulomb
    assert np.all(np.diff(energy)[~dead[1:]] <= 1e-6)


@given(st.permutations(TERMS), st.integers(1, 3))
def test_a_law_has_one_name_whatever_the_order(terms: list[str], count: int) -> None:
    chosen = terms[:count]
    law = damping_law(" + ".join(chosen))
    assert law == damping_law("+".join(reversed(chosen)))
    assert set(law.terms) == set(chosen)
