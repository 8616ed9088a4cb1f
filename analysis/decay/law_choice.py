"""Which damping law a free decay follows, if any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.decay.exponential import ExponentialDecay, fit_exponential
from vibroimpact.analysis.decay.law_fit import LawFit, fit_law
from vibroimpact.analysis.decay.laws import ALL_LAWS, DampingLaw, spoken
from vibroimpact.analysis.decay.samples import DecaySamples
from vibroimpact.analysis.decay.windows import first_guess
from vibroimpact.fmus.errors import EstimationError


@dataclass(frozen=True, slots=True)
class LawChoice:
    """Damping laws fitted to one decay, ranked.

    Attributes
    ----------
    fits : tuple of LawFit
        Best first by AIC; laws with a negative coefficient come after all others.
    effective_samples : float
        Independent samples by the residual of the best law; the same number for all laws.
    lost : tuple of DampingLaw
        Laws whose fit ended in damping beyond any swing.
    """

    fits: tuple[LawFit, ...]
    effective_samples: float
    lost: tuple[DampingLaw, ...] = ()

    @property
    def best(self) -> LawFit:
        """The law of the lowest AIC among those that take energy out only."""
        return self.fits[0]

    @property
    def best_by_effective_samples(self) -> LawFit:
        """The law of the lowest AIC when correlated samples are counted as the fewer that they are worth."""
        eligible = [fit for fit in self.fits if fit.physical] or list(self.fits)
        return min(eligible, key=lambda fit: fit.effective_aic(self.effective_samples))

    def weights(self) -> tuple[float, ...]:
        """Return Akaike weights of the fits, by the effective number of samples; 0 where a law is no damping."""
        scores = np.array(
            [fit.effective_aic(self.effective_samples) if fit.physical else np.inf for fit in self.fits]
        )
        if not np.any(np.isfinite(scores)):
            return (0.0,) * len(self.fits)
        share = np.exp(-0.5 * (scores - np.min(scores)))
        return tuple((share / np.sum(share)).tolist())

    def words(self) -> tuple[str, ...]:
        """Return what was found, in sentences."""
        return tuple(_sentences(self))


def choose_law(
    samples: DecaySamples,
    laws: Sequence[DampingLaw] = ALL_LAWS,
    *,
    cubic: bool = False,
    start: ExponentialDecay | None = None,
) -> LawChoice:
    """Fit damping laws to a free decay and rank them by Akaike's criterion.

    Parameters
    ----------
    samples : DecaySamples
    laws : sequence of DampingLaw
        All seven, unless named.
    cubic : bool
        Fit a cubic stiffness with every law.
    start : ExponentialDecay, optional
        The decaying cosine of the same samples, where it is known already.

    Raises
    ------
    EstimationError
        Nothing oscillates, or no law can be fitted.

    Examples
    --------
    >>> time = np.arange(0.0, 40.0, 0.05)
    >>> noise = 0.02 * np.random.default_rng(2).normal(size=time.size)
    >>> choice = choose_law(DecaySamples(time, 3.0 * np.exp(-0.05 * time) * np.cos(4.0 * time) + noise))
    >>> choice.best.law.name, choice.best.test.adequate
    ('viscous', True)
    """
    envelope = first_guess(samples).envelope
    start = fit_exponential(samples) if start is None else start
    found, lost = [], []
    for law in laws:
        try:
            found.append(fit_law(samples, law, start, envelope, cubic=cubic))
        except EstimationError:
            lost.append(law)
    if not found:
        raise EstimationError(
            f"{samples.name}: expected a decay that some law fits, got none. Narrow the window."
        )
    ranked = sorted(found, key=lambda fit: (not fit.physical, fit.aic))
    return LawChoice(tuple(ranked), ranked[0].test.effective_samples, tuple(lost))


def _sentences(choice: LawChoice) -> list[str]:
    best, other = choice.best, choice.best_by_effective_samples
    said = [f"{spoken(best.law)} {'has the lowest AIC' if len(choice.fits) > 1 else 'was asked for'}."]
    if not best.physical:
        said.append(
            "a coefficient of it is negative: it feeds energy in; no law here is a damping of this motion."
        )
    said.append(f"{spoken(best.law)} is {best.test.words()}.")
    if len(choice.fits) > 1 and not best.test.adequate:
        good = [fit for fit in choice.fits if fit.test.adequate and fit.physical]
        said.append(
            "none of the laws is adequate: coefficients and errors describe the best of the wrong models."
            if not good
            else f"adequate by its residual: {', '.join(spoken(fit.law) for fit in good)}."
        )
    count = len(best.fitted)
    if len(choice.fits) > 1 and choice.effective_samples < 0.8 * count:
        said.append(
            f"AIC assumes white residuals; these are correlated, and {count} samples are worth "
            f"{choice.effective_samples:.0f}: with that number "
            + (f"{spoken(other.law)} wins." if other is not best else f"{spoken(best.law)} stays the first.")
        )
    odd = [spoken(fit.law) for fit in choice.fits if not fit.physical]
    if odd and best.physical:
        said.append(f"left out for a negative coefficient: {', '.join(odd)}.")
    if choice.lost:
        said.append(f"could not be fitted: {', '.join(spoken(law) for law in choice.lost)}.")
    unsettled = [spoken(fit.law) for fit in choice.fits if not fit.settled]
    if unsettled:
        said.append(f"not settled within the limit of steps: {', '.join(unsettled)}.")
    return said
