"""The slopes of an algebraic loop: from directional derivatives where they can be trusted, else from differences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.orchestrator.fmi.capabilities import DERIVATIVE, gives_derivatives
from vibroimpact.orchestrator.fmi.instance import FATAL, WARNING
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.feedthrough import unlisted_dependence
from vibroimpact.orchestrator.importer.loops.link import Link

Floats = NDArray[np.float64]

#: Relative difference of a directional derivative and a difference, above which the derivative counts as false.
SAME_SLOPE = 1e-3
#: Least sum of the slopes in a row or a column for their scaling: the scaling makes smaller ones no larger.
SMALLEST_SUM = 1e-3
SCALING_PASSES = 30


class Slopes:
    """The slopes of the inputs of loops over each other, and remarks on FMUs that declare them wrongly.

    Attributes
    ----------
    remarks : dict of str to None
        Remarks, in the order in which they were found.
    """

    def __init__(self) -> None:
        self.remarks: dict[str, None] = {}
        self._gives: dict[str, bool] = {}
        """By component: its derivatives are used."""
        self._compared: set[tuple[str, ...]] = set()

    def at(
        self, links: Sequence[Link], depends: Sequence[frozenset[int]], x: Floats, values: Floats
    ) -> Floats:
        """Return the slopes at inputs `x`, which are written and whose outputs give `values`.

        The inputs are the same afterwards. A component's derivatives are compared with differences once.

        Returns
        -------
        ndarray, shape (connections, connections)
            Change of the input that the output of a connection (row) gives, over an input (column); 0 for connections
            that are not real.
        """
        found = np.zeros((len(links), len(links)))
        for j, link in enumerate(links):
            if link.is_real:
                found[:, j] = self._column(links, depends, j, x, values)
        return found

    def _column(
        self, links: Sequence[Link], depends: Sequence[frozenset[int]], j: int, x: Floats, values: Floats
    ) -> Floats:
        component = links[j].target
        rows = _rows(links, j)
        if component.name not in self._gives:
            self._gives[component.name] = gives_derivatives(component.instance.fmu.folder)
        given = None
        # a derivative of an array has all of its elements
        if self._gives[component.name] and not any(links[i].is_element for i in (j, *rows)):
            given = self._derivatives(links, [i for i in rows if j in depends[i]], j)
        compared = (links[j].name, *(links[i].name for i in rows))
        if given is not None and compared not in self._compared:
            self._compared.add(compared)
            given = self._compare(links, depends, j, x, values, given)
        return _differences(links, rows, j, x, values) if given is None else given

    def _derivatives(self, links: Sequence[Link], rows: Sequence[int], j: int) -> Floats | None:
        """Return a column from the FMU's directional derivatives; None where it gives none."""
        found, component = np.zeros(len(links)), links[j].target
        if not rows:
            return found
        try:
            status, slopes = component.instance.directional_derivative(
                [links[i].source_reference for i in rows], links[j].target_reference
            )
        except ComponentFileError as error:  # the function is missing: the remark says so
            self._distrust(component, str(error))
            return None
        if status == FATAL:
            component.instance.check(status, "GetDirectionalDerivative")
        if status > WARNING or not np.all(np.isfinite(slopes)):
            self._distrust(component, f"its call returns status {status} and {slopes}")
            return None
        found[list(rows)] = slopes * [links[i].gain for i in rows]
        return found

    def _compare(
        self,
        links: Sequence[Link],
        depends: Sequence[frozenset[int]],
        j: int,
        x: Floats,
        values: Floats,
        given: Floats,
    ) -> Floats | None:
        """Return a column of derivatives if they lie between the differences of both sides; else None."""
        rows = _rows(links, j)
        size = abs(links[j].near(x[j], abs(values[j]), 1.0) - x[j])
        rounding = links[j].tolerance * np.abs(values) / size
        sides = np.array([_differences(links, rows, j, x, values, side) for side in (1.0, -1.0)])
        room = SAME_SLOPE * np.max(np.abs(sides), axis=0) + rounding
        outside = np.maximum(np.min(sides, axis=0) - given, given - np.max(sides, axis=0))
        if not np.any(outside > room):  # false for NaN: the FMU discards the values for the difference
            return given
        row = int(np.nanargmax(outside - room))
        if j not in depends[row]:  # the derivative was not asked for
            self._gives[links[j].target.name] = False
            self.remarks[unlisted_dependence(links[row].connection, links[j].connection)] = None
            return None
        pair = f"{links[row].name}: derivative {given[row]:.6g}, difference {sides[0, row]:.6g}"
        self._distrust(links[j].target, pair)
        return None

    def _distrust(self, component: Component, why: str) -> None:
        """Use a component's derivatives no more, and say why."""
        self._gives[component.name] = False
        self.remarks[f"{component.name} declares {DERIVATIVE}, and they are not used: {why}"] = None


def _rows(links: Sequence[Link], j: int) -> list[int]:
    """Return the real connections from the component whose input a connection feeds."""
    return [i for i, link in enumerate(links) if link.is_real and link.source is links[j].target]


def _differences(
    links: Sequence[Link], rows: Sequence[int], j: int, x: Floats, values: Floats, side: float = 1.0
) -> Floats:
    """Return a column from one difference; NaN where the FMU discards the value on either side."""
    found = np.zeros(len(links))
    for sign in (side, -side):
        near = links[j].near(x[j], abs(values[j]), sign)
        if links[j].write(near):
            for i in rows:
                found[i] = (links[i].read() - values[i]) / (near - x[j])
            if np.all(np.isfinite(found)):
                break
    links[j].write(x[j])
    return found


def scaling_of(g: Floats) -> Floats:
    """Return powers of 2 that scale inputs so that rows and columns of the slopes have like sums (Osborne's method).

    Inputs may be forces and displacements: the singular values of I - G mean something in scaled inputs alone.
    """
    off = np.abs(g - np.diag(np.diag(g)))
    d = np.ones(len(g))
    if not np.all(np.isfinite(off)):
        return d
    for _ in range(SCALING_PASSES):
        before = d.copy()
        for i in range(len(d)):
            row = max(float(off[i] @ d) / d[i], SMALLEST_SUM)
            column = max(float(off[:, i] @ (1.0 / d)) * d[i], SMALLEST_SUM)
            d[i] *= 2.0 ** np.round(0.5 * np.log2(row / column))
        if np.array_equal(before, d):
            break
    return d


def singular_values(g: Floats) -> Floats:
    """Return the singular values of I - G in scaled inputs, the largest first; NaN where G is not finite."""
    d = scaling_of(g)
    matrix = np.eye(len(d)) - g * d[None, :] / d[:, None]
    if not np.all(np.isfinite(matrix)):
        return np.full(len(d), np.nan)
    return np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=np.float64)
