"""Orbits found for a body, as a list with a dataset and a figure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import xarray as xr

from vibroimpact.analysis.dataset.schema import UnitSystem
from vibroimpact.analysis.orbits.branches import dataset_of_orbits
from vibroimpact.analysis.orbits.periodic import PeriodicOrbit
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.html_view import html_table


class FoundOrbits(list[PeriodicOrbit]):
    """Periodic orbits of one body.

    Parameters
    ----------
    orbits : iterable of PeriodicOrbit
    units : {"SI", "nondimensional"}
    attributes : callable
        Returns the attributes of their dataset.

    Attributes
    ----------
    units : {"SI", "nondimensional"}
    """

    def __init__(
        self, orbits: Iterable[PeriodicOrbit], units: UnitSystem, attributes: Callable[[], Mapping[str, Any]]
    ) -> None:
        super().__init__(orbits)
        self.units = units
        self._attributes = attributes

    @property
    def dataset(self) -> xr.Dataset:
        """The physical orbits along `run`, each as its own branch, with their forcing frequency.

        Raises
        ------
        DatasetError
            None of the orbits is physical.
        """
        physical = [orbit for orbit in self if orbit.is_physical]
        if not physical:
            raise DatasetError("orbits: expected one that is nowhere beyond a stop, got none.")
        return dataset_of_orbits(physical, units=self.units, attrs=self._attributes())

    def _repr_html_(self) -> str:
        headings = ("orbit", "", "phases, rad", "stops", "impact velocities", "largest multiplier")
        return html_table("Periodic orbits", headings, [_row(orbit) for orbit in self])


def _row(orbit: PeriodicOrbit) -> tuple[object, ...]:
    largest = orbit.multipliers[0]
    return (
        orbit.name,
        orbit.stability,
        ", ".join(f"{phase:.6g}" for phase in orbit.phases),
        ", ".join(str(contact + 1) for contact in orbit.contacts),
        ", ".join(f"{speed:.6g}" for speed in orbit.velocities),
        f"{largest:.6g}" if largest.imag else f"{largest.real:.6g}",
    )
