"""The values that an error estimate compares: connected outputs and named states, each with its scale."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.described import kind_of
from vibroimpact.orchestrator.importer.wiring import CallList, StatusCall

Floats = NDArray[np.float64]
REAL_KINDS = ("Float64", "Float32")
#: Difference that counts as rounding, over the largest value with the same unit.
ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
#: Error over the tolerance that keeps a step's size.
STEADY = 0.5
#: Scale of values that have always been 0.
SMALLEST = float(np.finfo(np.float64).tiny)


class Outputs:
    """Real variables of components: read together, each with the largest value so far as its scale.

    Parameters
    ----------
    variables : iterable of (Component, str, str)
        Component, variable, and its name in messages. Others than single real numbers are left out.

    Attributes
    ----------
    names : tuple of str
        Names in messages.
    known : ndarray, shape (variable,)
        Largest absolute value so far of each.
    since : ndarray, shape (variable,)
        Time from which each has had a value other than 0, s; infinite before.
    rounding : ndarray, shape (variable,)
        Difference that counts as rounding.
    unit, largest : ndarray, shape (variable,) and (unit,)
        Number of the unit of each, and memory for the largest value of each unit.
    all_known : ndarray, shape (1,)
        Time from which all have a scale, s. C code that compares values shares these arrays.
    window, tolerance : float
        As given to `begin`.
    reads : CallList
        The calls that read all variables.
    are_float64 : bool
        All values are double precision in the FMUs, too.
    """

    def __init__(self, variables: Iterable[tuple[Component, str, str]]) -> None:
        grouped: dict[tuple[str, str], tuple[Component, dict[str, str]]] = {}
        for component, variable, name in variables:
            kind = kind_of(component.variables[variable])
            plain = not (component.variables[variable].dimensions or component.clocks_of(variable))
            if kind in REAL_KINDS and plain:
                grouped.setdefault((component.name, kind), (component, {}))[1].setdefault(variable, name)
        self._groups = [component.group(kind, [*found]) for (_, kind), (component, found) in grouped.items()]
        self.names = tuple(name for _, found in grouped.values() for name in found.values())
        units = [
            _unit(component, v) or name for component, found in grouped.values() for v, name in found.items()
        ]
        places = {unit: place for place, unit in enumerate(dict.fromkeys(units))}
        self.unit = np.array([places[unit] for unit in units], dtype=np.int64)
        self.largest = np.zeros(len(places))
        self.known, self.since, self.rounding = (np.zeros(len(units)) for _ in range(3))
        self.all_known = np.zeros(1)
        owners = [
            (component.instance, group)
            for (component, _), group in zip(grouped.values(), self._groups, strict=True)
        ]
        self.reads = CallList(StatusCall(g.get_call, i, f"Get{g.name}", g) for i, g in owners)
        self.are_float64 = all(group.values.dtype == np.float64 for group in self._groups)
        self.begin(0.0, 1.0)

    def __len__(self) -> int:
        """Return the number of variables."""
        return len(self.names)

    def begin(self, window: float, tolerance: float) -> None:
        """Forget all scales; an output has none in the first `window` s of its motion, only an outlook.

        Rounding is at most the tolerance of any scale.
        """
        self.window, self.tolerance = window, tolerance
        self.known[:] = self.rounding[:] = 0.0
        self.since[:] = self.all_known[:] = np.inf

    def read(self) -> Floats:
        """Return the present values, shape (variable,)."""
        return np.concatenate([group.get() for group in self._groups], dtype=np.float64)

    def learn(self, time: float, values: Floats) -> None:
        """Take values of an accepted instant, s, into the scales."""
        sizes = np.abs(values)
        larger = (sizes > self.known) & (sizes < np.inf)
        if not larger.any():
            return
        self.since[larger & (self.known == 0.0)] = time
        self.all_known[0] = self.since.max() + self.window
        self.known[larger] = sizes[larger]
        self.largest[:] = 0.0
        np.maximum.at(self.largest, self.unit, self.known)
        self.rounding[:] = ROUNDING * self.largest[self.unit]

    def difference(self, one: Floats, other: Floats) -> Floats:
        """Return the absolute differences beyond rounding; infinite where one value alone is finite."""
        beyond = np.maximum(np.abs(one - other) - self.rounding, 0.0)
        if np.isfinite(beyond).all():
            return beyond
        same = (one == other) | (np.isnan(one) & np.isnan(other))
        return np.where(same, 0.0, np.where(np.isfinite(one) & np.isfinite(other), beyond, np.inf))

    def over_scale(self, errors: Floats, before: Floats, after: Floats, end: float, size: float) -> Floats:
        """Return errors of a step over the scales of their variables.

        A value that grows from 0 has no size yet. In the first `window` s of its motion its scale is at least its slope
        times the rest of this time.

        Parameters
        ----------
        errors : ndarray, shape (variable,)
            Absolute errors.
        before, after : ndarray, shape (variable,)
            Values at the start and at the end of the step.
        end, size : float
            End and length of the step, s.
        """
        scale = np.fmax(np.fmax(self.known, np.abs(after)), self.rounding / self.tolerance)
        if end < self.all_known[0]:
            slope = np.abs(after - before) / size
            scale = np.fmax(scale, np.where(self.rises(after, end), slope * self._left(end), 0.0))
        ratio = errors / np.fmax(scale, SMALLEST)
        return ratio if np.isfinite(scale).all() else np.where(errors == 0.0, 0.0, np.inf)

    def without_first(self, errors: Floats, values: Floats, time: float) -> Floats:
        """Return errors over the tolerance in a step of the first size: values that begin to move keep this size."""
        return np.where(self.rises(values, time), np.minimum(errors, STEADY), errors)

    def rises(self, values: Floats, time: float) -> NDArray[np.bool_]:
        """Return which variables are at a new largest value within the first `window` s of their motion."""
        return np.asarray((self._left(time) > 0.0) & (np.abs(values) > self.known))

    def _left(self, time: float) -> Floats:
        """Return the rest of the first `window` s of each motion, s."""
        return np.maximum(self.window - np.maximum(time - self.since, 0.0), 0.0)


def _unit(component: Component, name: str) -> str:
    variable = component.variables[name]
    declared = variable.declaredType
    return str(variable.unit or (declared.unit if declared is not None else None) or "")
