"""Extrema of a locus of folds over its second parameter, where branches over the first one are born or meet: 4.19.

A closed branch shrinks to a point at an isola centre. At a crossing two branches join and part again. At a cusp two
folds come together.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats

ISOLA_CENTRE, CROSSING, CUSP = "isola centre", "crossing of branches", "cusp"
EXTREMA = (ISOLA_CENTRE, CROSSING, CUSP)
SECOND_STEP = 1e-4
"""Change of the unknowns for derivatives of slopes by differences."""
STILL = 1e-5
"""Slope of both parameters along a locus of folds, over the ranges, below which it has a cusp."""


def kind_of_extremum(tangent: Floats, matrix_at: Callable[[Floats], Floats], unknowns: Floats) -> str:
    """Return the kind of a point where a locus of folds has an extremum of its second parameter.

    Parameters
    ----------
    tangent : array, shape (p + 2,)
        Direction of the locus.
    matrix_at : callable
        Derivatives of the errors, shape (p, p + 1), for the unknowns of the orbit and the first parameter.
    unknowns : array, shape (p + 1,)
        These unknowns at the point.
    """
    if abs(tangent[-2]) < STILL:
        return CUSP
    left, _, right = np.linalg.svd(matrix_at(unknowns))
    ahead = right[-2:]
    form = np.empty((2, 2))
    for k, axis in enumerate(ahead):
        ends = [matrix_at(unknowns + side * SECOND_STEP * axis) for side in (1.0, -1.0)]
        form[k] = left[:, -1] @ ((ends[0] - ends[1]) / (2.0 * SECOND_STEP)) @ ahead.T
    # a definite form has no real directions: no branch passes through the point
    return ISOLA_CENTRE if form[0, 0] * form[1, 1] > form[0, 1] * form[1, 0] else CROSSING
