"""Requests that a study of accuracy refuses before it measures anything."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.study.accuracy.budget import LEAST_BUDGET
from vibroimpact.orchestrator.study.accuracy.choice import error_of_reference
from vibroimpact.orchestrator.study.errors import QUANTITIES
from vibroimpact.orchestrator.study.references import ROUNDING, SAFETY, Reference
from vibroimpact.orchestrator.study.ways.way import Way

LEAST_TOLERANCE = SAFETY * ROUNDING
"""Least relative error, 1.4e-14, that can be requested: every reference adds this much for rounding."""


def refuse_misuse(tolerance: float | None, quantity: str, budget: float) -> None:
    """Raise UsageError unless the arguments are valid, whatever the scene.

    Parameters
    ----------
    tolerance : float or None
        Requested relative error.
    quantity : str
        One of `errors.QUANTITIES`, or `all`.
    budget : float
        Processor time, s.

    Raises
    ------
    UsageError

    Examples
    --------
    >>> refuse_misuse(1e-6, "all", 40.0)
    >>> refuse_misuse(1e-6, "all", 2.0)
    Traceback (most recent call last):
    vibroimpact.fmus.errors.UsageError: budget: expected a finite processor time of 10 s or more, got 2.0.
    """
    if quantity not in ("all", *QUANTITIES):
        raise UsageError(
            message(Argument("of"), f": expected all, {', '.join(QUANTITIES)}, got {quantity!r}.")
        )
    if not (_is_between(0.0, budget) and budget >= LEAST_BUDGET):
        least = f"expected a finite processor time of {LEAST_BUDGET:g} s or more"
        raise UsageError(message(Argument("budget"), f": {least}, got {budget!r}."))
    if tolerance is None:
        return
    if not _is_between(0.0, tolerance):
        raise UsageError(
            message(Argument("tolerance"), f": expected a relative error > 0, got {tolerance!r}.")
        )
    if tolerance < LEAST_TOLERANCE:
        _refuse_tolerance(tolerance, LEAST_TOLERANCE, "as double precision has it")


def refuse_one_way(ways: Sequence[Way], scene: Scene) -> None:
    """Raise UsageError unless a scene has at least two ways; of other models a structure's numbers of modes count."""
    is_structure = isinstance(scene.bodies[0], StructureBody)
    if len([way for way in ways if not way.model or is_structure]) < 2:
        why = ": several bodies, several forces and stops that move run fused" if is_structure else ""
        raise UsageError(
            f"{scene.source}: expected a scene with something to vary (stops, modes, or components that exchange "
            f"values), got one that is simulated in one way. It is exact{why}."
        )


def refuse_vague_reference(tolerance: float | None, quantity: str, reference: Reference) -> None:
    """Raise UsageError unless the tolerance is at least the error of the reference, which bounds all ways."""
    known = error_of_reference(reference, quantity)
    if tolerance is not None and tolerance < known:
        _refuse_tolerance(tolerance, known, "to which the reference is known")


def _is_between(low: float, value: object) -> bool:
    return isinstance(value, Real) and low < float(value) < math.inf


def _refuse_tolerance(tolerance: float, least: float, why: str) -> None:
    raise UsageError(
        message(
            Argument("tolerance"),
            f": expected a relative error of {least:.1e} or more, {why}, got {tolerance:g}.",
        )
    )
