"""The form of sampled variables that are no plain numbers: arrays, texts, items of enumerations, integers of 64 bits.

A sampled variable without a form is a float64 for each sample. A dataset holds every number of at most 32 bits, and
every truth value, exactly as float64.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.naming import file_names

TEXT = "object"


@dataclass(frozen=True, slots=True)
class SampleForm:
    """Type and shape of each sample of a variable.

    Attributes
    ----------
    dtype : str
        `float64`, `int64`, `uint64`, or `object` for texts.
    shape : tuple of int
        Shape of an array; empty for one value.
    items : mapping of str to int
        Items of an enumeration.
    """

    dtype: str
    shape: tuple[int, ...] = ()
    items: Mapping[str, int] = field(default_factory=dict)

    def empty(self) -> NDArray[Any]:
        """Return the array of no samples."""
        return np.empty((0, *self.shape), dtype=self.dtype)

    def attributes(self) -> dict[str, Any]:
        """Return the CF attributes that name the items of an enumeration.

        >>> SampleForm("int64", items={"ramp up": 3}).attributes()
        {'flag_values': array([3]), 'flag_meanings': 'ramp_up'}
        """
        if not self.items:
            return {}
        return {
            "flag_values": np.array([*self.items.values()], dtype=self.dtype),
            "flag_meanings": " ".join(file_names([*self.items], ())),
        }


def axis_names(
    stored: Sequence[str], forms: Sequence[SampleForm], taken: Collection[str]
) -> tuple[tuple[str, ...], ...]:
    """Return the names of the further dimensions of sampled variables, by their names in the file.

    >>> axis_names(["room_t"], [SampleForm("float64", (2, 3))], frozenset())
    (('room_t_axis_1', 'room_t_axis_2'),)
    """
    wanted = [
        f"{name}_axis_{number}"
        for name, form in zip(stored, forms, strict=True)
        for number in range(1, len(form.shape) + 1)
    ]
    names = iter(file_names(wanted, taken))
    return tuple(tuple(next(names) for _ in form.shape) for form in forms)
