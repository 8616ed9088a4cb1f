"""Whether a linear replay is to be trusted: a verdict in words from scores on records it was, and was not, fitted on.

The error of a replay per standard deviation of the measured signal is sqrt(1 - VAF/100): 11 % for a VAF of 98.8,
50 % for one of 75. A linear model whose parameters are right leaves noise; what it leaves beyond that is motion it
does not describe (contact, friction, frequencies that drift), and no parameter will mend it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

MOST_ERROR = 0.25
"""Largest error per standard deviation of the measured signal, about VAF 94: the geometric mean between an error in
which a motion is recognised and no more (.5, VAF 75) and that of a good linear replay of a real structure (.12)."""
LEAST_SKILL = 0.5
"""A model must leave less than this share of the residual energy of a prediction without dynamics."""
MOST_LOSS = 2.0
"""Residual energy on other records per that on its own, above which the fit has learnt its record."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a replay is to be trusted.

    Attributes
    ----------
    words : str
        One sentence.
    trusted : bool
    reasons : tuple of str
        One line for each criterion that failed, or that should be known.
    """

    words: str
    trusted: bool
    reasons: tuple[str, ...]


def trust(
    fitted: Mapping[str, float],
    others: Mapping[str, float] | None = None,
    baseline: Mapping[str, float] | None = None,
    *,
    most_error: float = MOST_ERROR,
) -> Verdict:
    """Say whether a linear replay is to be trusted.

    It is, where all of these hold:

    1. there is a record that it was not fitted on, and that has an event;
    2. on each such record, and on its own, the error sqrt(1 - VAF/100) is at most `most_error`;
    3. on each such record it leaves at most half of the residual energy of the prediction without dynamics
       (`naive_variance`: no response, or the drive times the gain that suits the record best).

    Where the residual energy on other records is more than twice that on its own, this is said too: the fit has
    learnt its record, and its standard errors do not hold for others.

    Parameters
    ----------
    fitted, others : mapping of str to float
        Variance accounted for, percent, by record: those that parameters were fitted on, and those not. NaN where a
        record has nothing to be scored.
    baseline : mapping of str to float, optional
        Score of the prediction without dynamics on the same records, percent.
    most_error : float
        Error that the user can live with.

    Examples
    --------
    >>> trust({"a0": 98.9}, {"a1": 98.8}, {"a1": 11.0}).trusted
    True
    >>> print(trust({"05": 75.0}).words)
    Do not trust this linear replay: even on 05, which it was fitted on, it errs by 50 % (VAF 75.0 %).
    """
    scored = {name: value for name, value in (others or {}).items() if np.isfinite(value)}
    reasons = [
        *_own(fitted, most_error),
        *_other(scored, most_error),
        *_skill(scored or fitted, baseline or {}),
    ]
    if not scored:
        reasons.append(
            "there is no record with an event that it was not fitted on: give one to be scored, or fit on a part"
        )
    trusted = not reasons
    if trusted:
        name = min(scored, key=lambda key: scored[key])
        words = (
            f"This linear replay is to be trusted for events like these: on {name}, which it was not fitted on, it "
            f"errs by {_said(scored[name])}."
        )
    else:
        words = f"Do not trust this linear replay: {reasons[0]}."
    return Verdict(words, trusted, (*reasons, *_loss(fitted, scored)))


def _error(variance: float) -> float:
    """Return the error per standard deviation of the measured signal."""
    return float(np.sqrt(np.maximum(0.0, 1.0 - variance / 100.0)))


def _said(variance: float) -> str:
    return f"{100 * _error(variance):.0f} % (VAF {variance:.1f} %)"


def _own(fitted: Mapping[str, float], most_error: float) -> list[str]:
    # a NaN is no good score either
    return [
        f"even on {name}, which it was fitted on, it errs by {_said(value)}"
        for name, value in fitted.items()
        if not _error(value) <= most_error
    ]


def _other(scored: Mapping[str, float], most_error: float) -> list[str]:
    return [
        f"on {name}, which it was not fitted on, it errs by {_said(value)}"
        for name, value in scored.items()
        if not _error(value) <= most_error
    ]


def _skill(scored: Mapping[str, float], baseline: Mapping[str, float]) -> list[str]:
    return [
        f"on {name} it leaves more than half of what a prediction without dynamics leaves (VAF {value:.1f} % against "
        f"{baseline[name]:.1f} %)"
        for name, value in scored.items()
        if name in baseline and 100.0 - value > LEAST_SKILL * (100.0 - min(baseline[name], 100.0))
    ]


def _loss(fitted: Mapping[str, float], scored: Mapping[str, float]) -> list[str]:
    if not fitted or not scored:
        return []
    own, other = 100.0 - min(fitted.values()), 100.0 - min(scored.values())
    if other <= MOST_LOSS * own:
        return []
    return [
        f"it leaves {other:.2g} % of the variance of records it was not fitted on, against {own:.2g} % of its own: "
        "it has learnt its record, and the standard errors of the fit do not hold for others"
    ]
