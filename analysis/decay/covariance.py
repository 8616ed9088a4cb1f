"""Standard errors of a least-squares fit whose residual is not white."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def coloured_covariance(jacobian: Floats, residual: Floats, correlation: int) -> tuple[Floats, float]:
    """Return the covariance of the parameters of a fit whose residuals may be correlated, and its freedom.

    The sandwich `(J'J)^-1 S (J'J)^-1` with `S = sum_l (1 - |l| / (L + 1)) sum_i s_i s_(i+l)'`, `s_i = J_i r_i`
    (Newey and West). Correlation among neighbours counts at the frequency at which the parameter acts: an
    amplitude is as uncertain as the residual is strong near the frequency of the oscillation. Where this is
    less than the formula for white residuals gives, the white one is kept, parameter by parameter: a fit
    removes from its residual what resembles its parameters, and the sandwich alone would be too sure.

    Parameters
    ----------
    jacobian : ndarray of float, shape (sample, parameter)
    residual : ndarray of float, shape (sample,)
    correlation : int
        Samples over which the residual may be correlated, at least: some periods of the oscillation.
        More is taken where the scores are correlated over longer.

    Returns
    -------
    covariance : ndarray of float, shape (parameter, parameter)
    freedom : float
        Degrees of freedom of a variance that was summed over L lags: 3 n / (2 (L + 1)), for Student's t.
    """
    samples, parameters = jacobian.shape
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    unit = jacobian / scale
    bread = np.linalg.pinv(unit.T @ unit)
    freedom = max(samples - parameters, 1)
    white = bread * float(residual @ residual) / freedom
    scores = unit * residual[:, None]
    lags = _lags(scores, correlation)
    # The weighted sum over lags is that of products of sums over L + 1 neighbours, at every place they may have.
    sums = np.cumsum(np.pad(scores, ((lags + 1, lags), (0, 0))), axis=0)
    moving = sums[lags + 1 :] - sums[: -lags - 1]
    meat = moving.T @ moving / (lags + 1.0)
    # Scores add up to zero after a fit, which takes (L + 1) / n from a sum over L lags.
    spared = 1.0 - (lags + 1.0) / samples
    coloured = bread @ meat @ bread * samples / freedom / spared
    inflation = np.sqrt(np.maximum(1.0, np.diag(white) / np.maximum(np.diag(coloured), 1e-300)))
    covariance: Floats = coloured * np.outer(inflation, inflation) / np.outer(scale, scale)
    return covariance, max(1.5 * samples / (lags + 1.0), 1.0)


def _lags(scores: Floats, correlation: int) -> int:
    """Return the number of lags: Andrews' rule for the most correlated score, or the caller's, if larger."""
    before, after = scores[:-1], scores[1:]
    power = np.maximum(np.einsum("ij,ij->j", scores, scores), 1e-300)
    rho = np.clip(np.einsum("ij,ij->j", before, after) / power, -0.97, 0.97)
    rate = float(np.max(4.0 * rho**2 / (1.0 - rho**2) ** 2))
    lags = max(correlation, int(1.1447 * (rate * len(scores)) ** (1.0 / 3.0)))
    return max(1, min(lags, len(scores) // 5))
