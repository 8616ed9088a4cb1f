"""Several bodies as one set of modes at the points of a sweep, from the parameters of the Structure FMU."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.body_points import row_of
from vibroimpact.fmus.bodies.impacting_body import Floats, Numbers
from vibroimpact.fmus.bodies.structure import Structure, StructurePoints, ratios_of


class AssembledPoints(StructurePoints):
    """Assembled bodies: the modes are mass-normalised, and their motion is the state."""

    START = "mode."

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of modes, of elements of a state, and of amplitudes of the forcing: see `StructurePoints`."""
        modes = self.integers["modes"]
        return modes, modes, 1

    def structure_of(self, numbers: Numbers) -> Structure:
        """Return the modes of one point: see `StructurePoints`."""
        count = self.integers["modes"]

        def row(name: str) -> Floats:
            return row_of(numbers, f"mode.{name}", count)

        frequencies, coupling = row("angular_frequency"), self._coupling(numbers)
        ratios = row("damping_ratio")
        if coupling is not None:
            ratios = ratios_of(coupling, frequencies)
        same = np.eye(count)
        return Structure(
            frequencies,
            ratios,
            1.0,
            row("forcing")[:, None],
            row("force"),
            row("observed_shape"),
            self._contact_shapes(numbers),
            same,
            same,
            coupling,
        )

    def _coupling(self, numbers: Numbers) -> Floats | None:
        """Return the modal damping matrix, 1/s, shape (mode, mode); None where each mode has its own damping."""
        count = self.integers["modes"]
        if not self.integers["coupled"]:
            return None
        each = range(1, count + 1)
        return np.array([[numbers[f"mode.damping[{i},{j}]"] for j in each] for i in each])

    def normalised(self, displacements: Floats) -> Floats:
        """Return displacements of a state, which are mass-normalised: see `BodyPoints`."""
        return np.asarray(displacements)

    def _contact_shapes(self, numbers: Numbers) -> Floats:
        count = self.integers["modes"]
        rows = [
            [numbers[f"mode.contact_shape[{k},{i}]"] for i in range(1, count + 1)]
            for k in range(1, self.stops + 1)
        ]
        return np.array(rows).reshape(-1, count)

    def contact_shapes(self) -> Floats:
        """Return the shapes of the modes at each contact, kg^(-1/2), shape (contact, mode)."""
        return self._contact_shapes(self.floats)

    def contact_masses(self) -> Floats:
        """Return the effective mass at each contact, kg: 1 / (shape . shape)."""
        return np.asarray(1.0 / (self.contact_shapes() ** 2).sum(axis=1))

    def is_pushed(self) -> bool:
        """Return whether one force input can act at all contacts: nowhere but at the forced point."""
        return False


def without_arrays(numbers: Numbers) -> tuple[dict[str, float], dict[str, Floats]]:
    """Return the parameters that are variables of their own, and the arrays `mode.NAME`, `table.NAME` of the others.

    Examples
    --------
    >>> single, arrays = without_arrays({"forcing.phase": 0.5, "mode.force[1]": 1.0, "mode.force[2]": 2.0})
    >>> single, arrays["mode.force"].tolist()
    ({'forcing.phase': 0.5}, [1.0, 2.0])
    """
    single = {name: value for name, value in numbers.items() if not name.startswith(("mode.", "table."))}
    elements: dict[str, dict[tuple[int, ...], float]] = {}
    for name, value in numbers.items():
        if name not in single:
            array, _, index = name.removesuffix("]").partition("[")
            elements.setdefault(array, {})[tuple(int(number) - 1 for number in index.split(","))] = value
    arrays = {name: np.zeros(np.max(list(found), axis=0) + 1) for name, found in elements.items()}
    for name, found in elements.items():
        for place, value in found.items():
            arrays[name][place] = value
    return single, arrays
