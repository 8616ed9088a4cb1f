"""Several bodies as one set of modes at the points of a sweep, from the parameters of the Structure FMU."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from vibroimpact.fmus.bodies.body_points import ModalPoints, row_of
from vibroimpact.fmus.bodies.impacting_body import Complexes, Floats, ImpactingBody, Numbers
from vibroimpact.fmus.bodies.structure import Structure, StructurePoints, ratios_of
from vibroimpact.fmus.errors import UsageError

WHOLE = 1e-12
"""Distance of a ratio of frequencies from a whole number, over the ratio, up to which it is this number."""


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

    def in_state_coordinates(self) -> ModalPoints:
        """Return the points as modes with their further sines; a sine of frequency 0 is a constant load."""
        found, columns, count = super().in_state_coordinates(), self.floats, self.integers["modes"]
        none = np.zeros(found.stiffness.shape[1])
        held, sines = found.held, []
        for number in sines_of(columns):
            amplitude, frequency, phase = (
                columns.get(f"sine[{number}].{name}", none)
                for name in ("amplitude", "angular_frequency", "phase")
            )
            row = [columns.get(f"mode.sine[{number},{i}]", none) for i in range(1, count + 1)]
            load = amplitude * np.stack(row)
            if frequency.any():
                sines.append((load, frequency, phase))
            else:
                held = held + load * np.cos(phase)
        if not sines:
            return replace(found, held=held)
        force, frequency, phase = (np.stack(each) for each in zip(*sines, strict=True))
        return replace(
            found, held=held, further_force=force, further_frequency=frequency, further_phase=phase
        )

    def _coupling(self, numbers: Numbers) -> Floats | None:
        """Return the modal damping matrix, 1/s, shape (mode, mode); None where each mode has its own damping."""
        count = self.integers["modes"]
        if not self.integers["coupled"]:
            return None
        each = range(1, count + 1)
        return np.array([[numbers[f"mode.damping[{i},{j}]"] for j in each] for i in each])

    def mass_normalised(self) -> ImpactingBody:
        """Return one point with all its sines and constant forces, and the motion of its stops: see `BodyPoints`.

        Raises
        ------
        UsageError
            A sine of the force or of a stop does not turn a whole number of times in a period of the clock.
        """
        body, numbers = super().mass_normalised(), self.floats
        held, further = body.held, dict[int, Complexes]()
        for k in range(1, self._count_of_sines + 1):
            row = np.array([numbers.get(f"mode.sine[{k},{j}]", 0.0) for j in range(1, body.force.size + 1)])
            if numbers.get(f"sine[{k}].angular_frequency", 0.0) == 0.0:  # a constant force
                held = (
                    held
                    + numbers[f"sine[{k}].amplitude"] * np.cos(numbers.get(f"sine[{k}].phase", 0.0)) * row
                )
            for order, amplitude in self._sine(f"sine[{k}]"):
                further[order] = further.get(order, 0.0) + amplitude * row
        contacts = tuple(
            replace(contact, motion=dict(self._sine(f"stop[{k}]")))
            for k, contact in enumerate(body.contacts, start=1)
        )
        base = numbers.get("forcing.base_acceleration", 0.0) * row_of(numbers, "mode.base", body.force.size)
        return replace(body, force=body.force + base, held=held, further=further, contacts=contacts)

    @property
    def _count_of_sines(self) -> int:
        """Number of sines besides the clock's among the parameters."""
        count = 0
        while f"sine[{count + 1}].amplitude" in self.floats:
            count += 1
        return count

    def _sine(self, name: str) -> Iterator[tuple[int, complex]]:
        """Yield the harmonic of a sine and its complex amplitude over the phase of the clock; nothing without it."""
        numbers = self.floats
        amplitude, rate = numbers.get(f"{name}.amplitude", 0.0), numbers.get(f"{name}.angular_frequency", 0.0)
        if amplitude == 0.0 or rate == 0.0:
            return
        clock, phase = numbers["forcing.angular_frequency"], numbers.get(f"{name}.phase", 0.0)
        ratio = rate / clock
        order = round(ratio)
        if order < 1 or abs(ratio - order) > WHOLE * ratio:
            raise UsageError(
                f"orbit: {name}.angular_frequency: expected a whole multiple of the clock's {clock:.12g} rad/s, "
                f"got {rate:.12g}. Orbits need one period of all sines."
            )
        yield order, cmath.rect(amplitude, phase - order * numbers.get("forcing.phase", 0.0))

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


def sines_of(names: Iterable[str]) -> list[int]:
    """Return the numbers of the sines besides the first that have an amplitude, ascending.

    Examples
    --------
    >>> sines_of(["sine[2].amplitude", "sine[1].amplitude", "sine[1].phase", "force"])
    [1, 2]
    """
    return sorted(
        int(name.removeprefix("sine[").partition("]")[0])
        for name in names
        if name.startswith("sine[") and name.endswith("].amplitude")
    )


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
