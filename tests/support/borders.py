"""The borders between motions in a uniform map, and the borders that an adaptive map has found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import ndimage

from vibroimpact.analysis.jumps import classes_of

JUMP = 0.05


@dataclass(frozen=True)
class Borders:
    """Pairs of neighbours of a uniform map between which the motion jumps.

    Attributes
    ----------
    pairs : int
    bracketed : int
        Pairs whose both points are in the adaptive map.
    unseen : int
        Other pairs at an island: a region of one motion in which no first value of the adaptive map lies.
    """

    pairs: int
    bracketed: int
    unseen: int

    @property
    def missed(self) -> int:
        """Pairs that the adaptive map has not found, at regions that its first values see."""
        return self.pairs - self.bracketed - self.unseen


def borders_found(adaptive: xr.Dataset, uniform: xr.Dataset, cuts: int) -> Borders:
    """Return the borders of a uniform map that an adaptive map has found; its finest cells are the uniform ones.

    Parameters
    ----------
    adaptive : xarray.Dataset
        Map of two adaptive axes, along `point`.
    uniform : xarray.Dataset
        Map of the same axes, with `2**cuts` steps for each of the first values.
    cuts : int
    """
    dims = uniform["outcome"].dims
    classes = classes_of(uniform.vibroimpact.runs)
    shape = uniform["outcome"].shape
    label, extent = classes.label.reshape(*shape, 3), classes.extent.reshape(shape)
    known = np.zeros(shape, dtype=bool)
    known[tuple(_places(adaptive[name].values, uniform[name].values) for name in dims)] = True
    unseen = _unseen(label, 2**cuts)
    step = JUMP * float(np.nanmax(extent))
    counts = np.zeros(3, dtype=int)
    for axis in (0, 1):
        one, other = (
            tuple(np.s_[a:b] if k == axis else np.s_[:] for k in (0, 1)) for a, b in ((0, -1), (1, None))
        )
        jumps = (label[one] != label[other]).any(axis=-1) | (np.abs(extent[one] - extent[other]) > step)
        found = known[one] & known[other]
        at_island = unseen[one] | unseen[other]
        counts += [np.sum(jumps), np.sum(jumps & found), np.sum(jumps & ~found & at_island)]
    return Borders(*counts.tolist())


def _places(values: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Return the indices of values among evenly spaced values."""
    places: np.ndarray = np.rint((values - along[0]) / (along[-1] - along[0]) * (along.size - 1)).astype(int)
    np.testing.assert_allclose(along[places], values, rtol=1e-12)
    return places


def _unseen(label: np.ndarray, step: int) -> np.ndarray:
    """Return a mask of a map: regions of one class that contain none of its every `step`-th points."""
    region, count = np.zeros(label.shape[:2], dtype=int), 0
    for kind in np.unique(label.reshape(-1, 3), axis=0):
        own, number = ndimage.label((label == kind).all(axis=-1))
        region[own > 0] = own[own > 0] + count
        count += number
    unseen: np.ndarray = ~np.isin(region, region[::step, ::step])
    return unseen
