"""Damping laws: their motion, their choice, and the coverage of their intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.decay_motion import Damped

from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.exponential import first_guess, fit_exponential
from vibroimpact.analysis.decay.law_fit import choose_law, fit_law
from vibroimpact.analysis.decay.laws import ALL_LAWS, damping_law, spoken
from vibroimpact.analysis.decay.motion import Coefficients, decaying_motion
from vibroimpact.analysis.decay.samples import DecaySamples
from vibroimpact.fmus.errors import EstimationError, UsageError

# Released from 10: each law alone takes about two thirds of the amplitude in 30 s.
RATES = {"viscous": 0.04, "coulomb": 0.9, "quadratic": 0.006}
START = 10.0
TIME = np.arange(0.0, 30.0, 0.06)


def body(*terms: str) -> Damped:
    # In sums of terms each takes its share, so that the motion lasts.
    return Damped(**{term: RATES[term] / len(terms) for term in terms})


def measured(motion: np.ndarray, noise: float, seed: int) -> DecaySamples:
    return DecaySamples(
        TIME, 2.0 + motion + noise * np.random.default_rng(seed).normal(size=len(motion)), "m"
    )


@pytest.mark.parametrize("law", ALL_LAWS, ids=lambda law: law.name)
def test_the_motion_of_each_law_is_that_of_an_adaptive_integrator(law) -> None:
    # Reference: scipy's DOP853, restarted at every turning point, also with a cubic spring. In the last swing before
    # friction holds the body, a viscous term of equal loss replaces quadratic damping: an error of 5e-6 of the start.
    known = Damped(**{term: RATES[term] for term in law.terms}, cubic=-1e-3)
    columns = (known.omega, known.viscous, known.coulomb, known.quadratic, known.cubic)
    coefficients = Coefficients(*(np.array([value]) for value in columns))
    moved = decaying_motion(np.zeros(1), np.array([START]), coefficients, TIME)[:, 0]
    np.testing.assert_allclose(moved, known.motion(START, TIME), rtol=0.0, atol=1e-5 * START)


def test_friction_holds_the_body_off_its_equilibrium_for_good() -> None:
    # Only friction damps: the amplitude falls by 2 c / omega^2 in each swing (energy), then it stays.
    friction, omega = 4.0, 4.0
    nothing = np.zeros(1)
    coefficients = Coefficients(np.array([omega]), nothing, np.array([friction]), nothing, nothing)
    drop = 2.0 * friction / omega**2
    late = np.array([50.0, 500.0])
    for start in (2.3, 2.6, 0.7, 0.2):
        moved = decaying_motion(nothing, np.array([start]), coefficients, late)[:, 0]
        place = start
        while abs(place) > 0.5 * drop:
            place = -np.sign(place) * (abs(place) - drop)
        np.testing.assert_allclose(moved, place, atol=1e-9)


@pytest.mark.parametrize("law", ALL_LAWS, ids=lambda law: law.name)
def test_a_noisy_decay_is_given_its_own_law_and_it_is_adequate(law) -> None:
    truth = body(*law.terms)
    choice = choose_law(measured(truth.motion(START, TIME), 0.05, 7))
    best = choice.best
    assert set(law.terms) <= set(best.law.terms)
    assert best.test.adequate, best.test.words()
    for term in best.law.terms:
        found = best.coefficients[term]
        # Four standard errors: one false alarm in ten thousand; a term missing in the truth is then zero.
        assert abs(found.value - getattr(truth, term)) < 4.0 * found.standard_error
    alone = [fit for fit in choice.fits if not set(law.terms) <= set(fit.law.terms)]
    assert all(fit.aic > best.aic + 2.0 or not fit.physical for fit in alone)


def test_the_wrong_law_is_called_inadequate_and_its_structure_is_measured() -> None:
    truth = body("coulomb").motion(START, TIME)
    choice = choose_law(measured(truth, 0.02, 3), [damping_law("viscous")])
    assert not choice.best.test.adequate
    assert any("none of the laws is adequate" in line for line in choice.words()) is False
    assert "inadequate" in " ".join(choice.words())
    # The residual without noise, known here: the difference of the motions.
    left = np.sqrt(np.mean((choice.best.fitted - 2.0 - truth) ** 2))
    assert choice.best.test.structure == pytest.approx(left, rel=0.05)
    assert choice.best.test.noise_floor == pytest.approx(0.02, rel=0.15)


def test_no_adequate_law_is_said_in_words() -> None:
    # A frequency that depends on the amplitude is in none of the laws; a cubic spring explains it.
    truth = Damped(viscous=0.04, cubic=4e-4).motion(START, TIME)
    samples = measured(truth, 0.02, 5)
    laws = [damping_law("viscous"), damping_law("viscous+coulomb")]
    assert "none of the laws is adequate" in " ".join(choose_law(samples, laws).words())
    with_cubic = choose_law(samples, laws, cubic=True)
    assert with_cubic.best.test.adequate
    found = with_cubic.best.coefficients["cubic"]
    assert abs(found.value - 4e-4) < 4.0 * found.standard_error
    assert found.standard_error < 4e-5


def test_a_law_that_would_feed_energy_in_is_never_chosen() -> None:
    # Coulomb motion bends the logarithm of the envelope down; in viscous + quadratic only a negative quadratic term can
    # do that.
    choice = choose_law(
        measured(body("coulomb").motion(START, TIME), 0.02, 1),
        [damping_law("viscous+quadratic"), damping_law("viscous")],
    )
    assert choice.best.law.name == "viscous"
    assert not choice.fits[-1].physical
    assert "left out for a negative coefficient: viscous + quadratic" in " ".join(choice.words())


def test_intervals_of_a_law_hold_the_truth_nineteen_times_in_twenty() -> None:
    law = damping_law("viscous+coulomb")
    truth = body(*law.terms)
    motion = truth.motion(START, TIME)
    draws, inside, scaled = 40, {term: 0 for term in law.terms}, {term: [] for term in law.terms}
    for seed in range(draws):
        samples = measured(motion, 0.1, 100 + seed)
        fit = fit_law(samples, law, fit_exponential(samples), first_guess(samples).envelope)
        for term in law.terms:
            found = fit.coefficients[term]
            low, high = found.interval
            inside[term] += low <= getattr(truth, term) <= high
            scaled[term].append((found.value - getattr(truth, term)) / found.standard_error)
    for term in law.terms:
        # Binomial: 38 of 40 expected, standard deviation 1.4; the errors are not much too large either.
        assert inside[term] >= 34
        assert 0.65 < np.std(scaled[term]) < 1.35


def test_laws_are_named_in_any_order_and_misspellings_are_helped() -> None:
    assert damping_law("quadratic + Viscous").name == "viscous+quadratic"
    assert spoken(damping_law("coulomb+viscous")) == "viscous + Coulomb"
    with pytest.raises(UsageError, match='Did you mean "viscous"'):
        damping_law("viscos")
    with pytest.raises(UsageError, match="each term once"):
        damping_law("viscous+viscous")


def test_a_start_so_damped_that_no_turning_point_is_finite_is_refused() -> None:
    samples = measured(body("viscous").motion(START, TIME), 0.01, 5)
    guess = first_guess(samples)
    overdamped = replace(fit_exponential(samples, guess), decay_rate=Estimate(1e5, 1.0))
    with pytest.raises(EstimationError, match="motion that no decaying cosine is near to"):
        fit_law(samples, damping_law("viscous"), overdamped, guess.envelope)
