"""The trust in a replay: a verdict in words from scores on records that were used in its fit, and on others.

The error of a replay per standard deviation of the measured signal is sqrt(1 - VAF/100). A VAF of 98.8 is an error of
11 %, a VAF of 75 an error of 50 %. A model with the right parameters leaves noise. A larger residual is motion that
the model does not describe (for a linear model contact, friction, drifting frequencies), and no parameter can remove
it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.replay.held import MOST_ERROR, Held, instant

LEAST_SKILL = 0.5
"""Residual energy, relative to that of a prediction without dynamics, above which a model has no skill."""
MOST_LOSS = 2.0
"""Residual energy on other records over that on its own, above which the fit is specific to its record."""
LEAST_LOSS = 1.0
"""Residual on other records, percent of their variance (an error of 10 %), below which the fit counts as general."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Verdict on a replay.

    Attributes
    ----------
    words : str
        One sentence.
    trusted : bool
    reasons : tuple of str
        One line for each failed criterion, the first of which is in `words`, and for each further remark.
    """

    words: str
    trusted: bool
    reasons: tuple[str, ...]

    @property
    def beside(self) -> tuple[str, ...]:
        """The reasons that `words` does not contain."""
        return self.reasons if self.trusted else self.reasons[1:]


def trust(
    fitted: Mapping[str, float],
    others: Mapping[str, float] | None = None,
    baseline: Mapping[str, float] | None = None,
    *,
    held: Mapping[str, Held] | None = None,
    linear: bool = True,
    most_error: float = MOST_ERROR,
) -> Verdict:
    """Return the verdict whether a replay is to be trusted, and over which span.

    A replay is trusted if all of these hold:

    1. there is a record with an event that was not used in the fit;
    2. on each such record, and on those of the fit, the error sqrt(1 - VAF/100) is at most `most_error`;
    3. on each such record its residual energy is at most half of that of a prediction without dynamics.

    A prediction without dynamics (`naive_variance`) is no response, or the drive times its best gain for the record. A
    residual energy on other records of more than twice that on those of the fit, and of more than 1 %, is reported too.
    The fit is then specific to its records, and its standard errors do not hold for others. Without a fit all records
    are others, provided that the numbers of the scene do not come from them; the verdict states this condition.

    Parameters
    ----------
    fitted, others : mapping of str to float
        Variance accounted for, percent, by record: records used in the fit, and other records. NaN for a record
        without scored samples.
    baseline : mapping of str to float, optional
        Score of the prediction without dynamics on the same records, percent.
    held : mapping of str to Held, optional
        Spans in which the replay holds on the same records; the verdict states the shortest.
    linear : bool
        Whether the model is linear: without stops, and without any dependence on the amplitude.
    most_error : float
        Largest error that the user accepts.

    Examples
    --------
    >>> trust({"a0": 98.9}, {"a1": 98.8}, {"a1": 11.0}).trusted
    True
    >>> print(trust({"05": 75.0}).words)
    Do not trust this linear replay: even on 05, which it was fitted on, it errs by 50 % (VAF 75.0 %).
    >>> print(trust({}, {"05": 75.0}, linear=False).words)
    Do not trust this replay: on 05 it errs by 50 % (VAF 75.0 %).
    """
    scored = {name: value for name, value in (others or {}).items() if np.isfinite(value)}
    other = ", which it was not fitted on," if fitted else ""
    reasons = [
        *_errors("even on", fitted, ", which it was fitted on,", most_error),
        *_errors("on", scored, other, most_error),
        *_skill(scored or fitted, baseline or {}),
    ]
    if not scored:
        missing = "that it was not fitted on: give one to be scored, or fit on a part"
        reasons.append(f"there is no record with an event {missing if fitted else 'to be scored'}")
    judged = {name: span for name, span in (held or {}).items() if name in scored or name in fitted}
    further = (*_breaks(judged, most_error, trusted=not reasons), *_loss(fitted, scored))
    replay = "linear replay" if linear else "replay"
    if reasons:
        return Verdict(f"Do not trust this {replay}: {reasons[0]}.", False, (*reasons, *further))
    name = min(scored, key=lambda key: scored[key])
    these = "this record" if len(scored) == 1 else "these records"
    words = (
        f"This {replay} is to be trusted for events like these{_span(judged, name)}"
        f"{'' if fitted else f', if its numbers do not come from {these}'}: on {name}{other} it errs by "
        f"{_error_text(scored[name])}."
    )
    return Verdict(words, True, further)


def _span(judged: Mapping[str, Held], name: str) -> str:
    """Return the trusted span: that of the record which breaks first, or else that of the named record."""
    broken = {key: held for key, held in judged.items() if held.broken is not None}
    shortest = min(broken.values(), key=lambda held: (held.broken or ())[:1], default=judged.get(name))
    return f", {shortest.words}" if shortest is not None and shortest.spans else ""


def _breaks(judged: Mapping[str, Held], most_error: float, *, trusted: bool) -> list[str]:
    """Return a line for each record: where the replay first exceeds the trusted error, or where alone it does not."""
    lines = []
    for name, held in judged.items():
        if held.broken is None:
            continue
        start, stop, variance = held.broken
        again = any(span[0] > start for span in held.spans)
        until = f" to {instant(stop)} after {held.since}" if again else f" after {held.since} on"
        if trusted:
            lines.append(
                f"on {name} it does not hold from {instant(start)}{until}: there it errs by {_error_text(variance)}"
            )
        elif held.spans:
            lines.append(f"on {name} it errs by at most {100 * most_error:.0f} % only {held.words}")
    return lines


def _error(variance: float) -> float:
    """Return the error per standard deviation of the measured signal."""
    return float(np.sqrt(np.maximum(0.0, 1.0 - variance / 100.0)))


def _error_text(variance: float) -> str:
    return f"{100 * _error(variance):.0f} % (VAF {variance:.1f} %)"


def _errors(where: str, scores: Mapping[str, float], clause: str, most_error: float) -> list[str]:
    # a NaN is not a good score either
    return [
        f"{where} {name}{clause} it errs by {_error_text(value)}"
        for name, value in scores.items()
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
    if other <= max(MOST_LOSS * own, LEAST_LOSS):
        return []
    return [
        f"it leaves {other:.2g} % of the variance of records it was not fitted on, against {own:.2g} % of its own: "
        "it has learnt its record, and the standard errors of the fit do not hold for others"
    ]
