"""The choice of a way: the Pareto front, and the cheapest way that reaches a tolerance."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.orchestrator.study.accuracy.measured import Comparison, Measured
from vibroimpact.orchestrator.study.errors import FIRST_IMPACTS
from vibroimpact.orchestrator.study.references import Reference

MOST_REFERENCE_ERROR = 1e-2
"""Relative error of a reference, above which no way is recommended without a tolerance."""
SAME_SCORE = 1.0
"""Difference of scores in percent, up to which two ways explain a recording equally well."""
DEFAULT_TOLERANCE = 1e-6
"""Relative error that the recommended way meets by default, where any way does."""


def pareto_front(measured: Sequence[Measured], quantity: str) -> list[Measured]:
    """Return the ways that no other way beats, being cheaper and at least as exact; other models are left out."""
    able = _comparable(measured, quantity)
    front: list[Measured] = []
    for one in sorted(able, key=lambda one: (one.cost, one.error(quantity))):
        if not front or one.error(quantity) < front[-1].error(quantity):
            front.append(one)
    return front


def cheapest(
    measured: Sequence[Measured], tolerance: float | None, quantity: str, reference: Reference
) -> Measured | None:
    """Return the cheapest way whose error plus the reference's error is within a tolerance, or None.

    The default tolerance is `DEFAULT_TOLERANCE`, or the least error of all ways if that is larger.
    """
    own = error_of_reference(reference, quantity)
    able = _comparable(measured, quantity)
    if tolerance is None and own > MOST_REFERENCE_ERROR:
        return None
    if tolerance is None:
        least = min((one.error(quantity) for one in able), default=math.nan)
        tolerance = max(DEFAULT_TOLERANCE, least + own)
    able = [one for one in able if one.error(quantity) + own <= tolerance]
    return min(able, key=lambda one: one.cost, default=None)


def _comparable(measured: Sequence[Measured], quantity: str) -> list[Measured]:
    """Return the ways with an error over all of the time, without other models and ways that simulated a part."""
    return [
        one
        for one in measured
        if not (one.way.model or one.is_extrapolated) and one.error(quantity) == one.error(quantity)
    ]


def error_of_reference(reference: Reference, quantity: str) -> float:
    """Return the relative error of the reference itself, of a quantity or the largest of all."""
    known = [error for error in reference.error.values() if error == error]
    return reference.error[quantity] if quantity != "all" else max(known, default=math.nan)


def refuse_unreached(study: Comparison) -> None:
    """Raise UsageError unless a way has reached the tolerance; the message has the least error that was reached."""
    if study.chosen is not None or math.isnan(study.tolerance):
        return
    able = _comparable(study.measured, study.quantity)
    own = error_of_reference(study.reference, study.quantity)
    best = min(able, key=lambda one: one.error(study.quantity), default=None)
    reached = "nothing"
    if best is not None:
        reached = (
            f"{best.error(study.quantity) + own:.1e} by {best.way.label}, the reference known to {own:.0e}"
        )
    raise UsageError(
        message(
            Argument("tolerance"),
            f": expected one that a way reaches, got {study.tolerance:g}; reached was {reached}.",
        )
    )


def advice(study: Comparison) -> str:
    """Return the advice on the way to choose, in a sentence."""
    chosen, quantity = study.chosen, study.quantity
    if chosen is None:
        return _why_none(study)
    known = error_of_reference(study.reference, quantity)
    what = "" if quantity == "all" else f" of {quantity.replace('_', ' ')}"
    error, cost = chosen.error_in_words(quantity, known), _seconds(chosen.cost)
    words = f"Take {chosen.way.label}: a relative error{what} of {error} in {cost} a run"
    others = [one for one in _comparable(study.measured, quantity) if one.way.name != chosen.way.name]
    if others:
        other = min(others, key=lambda one: one.cost)
        ratio = other.cost / chosen.cost
        words += f"; {other.way.label} takes {ratio:.2g} times that and errs by {other.error_in_words(quantity, known)}"
    words += _for_the_score(study)
    words += _of_own_modes(study)
    if study.reference.chaotic:
        begin, end = study.reference.scales.window
        part = (
            f"first {FIRST_IMPACTS} impacts or so"
            if study.scene.is_one_body
            else f"first {end - begin:.3g} s"
        )
        words += f". The motion is chaotic: after its {part} only statistics compare"
    return f"{words}."


def _of_own_modes(study: Comparison) -> str:
    """Return the difference of the scene's own number of modes from the most modes; empty where it is not known."""
    own = next((one for one in study.measured if one.way.is_own_model), None)
    if own is None or math.isnan(own.error(study.quantity)):
        return ""
    off = f"{own.error(study.quantity):.1e}"
    chance = f" (by chance alone up to {study.chance:.1e})" if study.chance == study.chance else ""
    return f". With {study.modes_reference} the motion differs from that of the scene by {off}{chance}"


def _for_the_score(study: Comparison) -> str:
    """Return the score of the chosen way and the cheapest way with the same score, in words; empty without scores."""
    chosen = study.chosen
    if chosen is None or not math.isfinite(chosen.variance):
        return ""
    alike = [
        one
        for one in study.measured
        if not (one.way.model or one.errors.failure or one.is_extrapolated)
        and abs(one.variance - chosen.variance) <= SAME_SCORE
        and one.cost < chosen.cost
    ]
    if not alike:
        return f". What was measured is accounted for to {chosen.variance:.2f} %"
    least = min(alike, key=lambda one: one.cost)
    return (
        f". What was measured is accounted for to {chosen.variance:.2f} %, and to {least.variance:.2f} % by "
        f"{least.way.label} in {_seconds(least.cost)}"
    )


def _why_none(study: Comparison) -> str:
    """Return the reason why no way is chosen."""
    known = error_of_reference(study.reference, study.quantity)
    if not any(one.error(study.quantity) == one.error(study.quantity) for one in study.measured):
        if any(one.errors.failure for one in study.measured):
            return "No way has an error that can be told: give a longer --budget where they did not finish."
        return "Nothing that is recorded moves: there is nothing to compare."
    if known > MOST_REFERENCE_ERROR:
        return (
            f"No way stands out, since the reference is known to {known:.0e} only: motion that "
            "jumps at its samples is not compared in scenes of components."
        )
    return "No way reached the tolerance."


def _seconds(seconds: float) -> str:
    for factor, unit in ((1e6, "us"), (1e3, "ms")):
        if seconds * factor < 1000.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds:.3g} s"
