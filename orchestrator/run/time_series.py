"""The time series of a scene of the short form: sampled variables, made from variables of the FMU."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.run.forces import Forces, cosines
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_models import Force, Forcing, is_one_sine
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.measuring_models import CHANNELS
from vibroimpact.orchestrator.scene.sampled_names import AT_CONTACT

FEWEST_SAMPLES = 10
"""Number of samples of a contact, below which they miss its largest force."""
_ELEMENT = re.compile(r"([a-z_]+)\[([1-9][0-9]*)\]")
_FOLLOWED = ("modal_energy[", "energy.")


class TimeSeriesPlan:
    """The sampled variables of a scene of the short form: `names`, or by default those of `record.time_series`.

    `all_names` are the sampled variables with the names of the scene, empty without a time series. `names` leaves out
    the channels of a measuring chain. `variables` are the variables of the body's FMU for `names`, each once.
    `energies`: whether the body must follow its energies for them. `feels_contacts`: whether a contact with a compliant
    stop shows in them, in a force or an acceleration.
    """

    def __init__(self, scene: Scene, names: Sequence[str] | None = None) -> None:
        series = scene.record.time_series
        series_names = series.variables if series is not None else ()
        self.all_names: tuple[str, ...] = series_names if names is None else tuple(names)
        self.names = tuple(name for name in self.all_names if name not in CHANNELS)
        weights = [scene.body.weights_of(name) for name in self.names]
        parts = [
            tuple(own) or fmu_variables(name, len(scene.stops))
            for name, own in zip(self.names, weights, strict=True)
        ]
        self.variables = tuple(dict.fromkeys(variable for part in parts for variable in part))
        self.energies = scene.body.IS_STRUCTURE and follow_energies(self.names)
        yields = any(not LAWS[stop.law].is_rigid for stop in scene.stops)
        felt = ("contact_force", "acceleration")
        self.feels_contacts = yields and any(name.startswith(felt) for name in self.names)
        # a beam has a moving base in its FMU; other bodies get only forces on their masses
        self._relative = not scene.body.KNOWS_BASE
        self._columns = [[self.variables.index(variable) for variable in part] for part in parts]
        self._weights = [np.array(list(each.values())) for each in weights]

    def at(self, scene: Scene) -> TimeSeriesPlan:
        """Return the plan at a point of the scene's sweep, whose bodies may have other modes."""
        return TimeSeriesPlan(scene, self.all_names) if any(map(len, self._weights)) else self

    def is_plain(self, forces: Sequence[Force]) -> bool:
        """Return whether the sampled variables are the FMU's own, one by one, so that `row` changes nothing."""
        untouched = not forces or not any(n.startswith(("forcing", "acceleration")) for n in self.names)
        plain = untouched and self._columns == [[place] for place in range(len(self.names))]
        return plain and not any(map(len, self._weights))

    def row(
        self,
        values: NDArray[np.float64],
        forces: Sequence[Force],
        parameters: Mapping[str, float],
        time: float,
    ) -> Sequence[float]:
        """Return the sampled variables at one instant, s, from the values of the FMU, shape (variables,).

        The parameters are the body's, see `parameters.float_parameters`; the forces drive the body.
        """
        forcing, cosine = _only(forces), 0.0
        if forcing is not None:
            cosine = math.cos(forcing.angular_frequency * time + parameters["forcing.phase"])
        base = forcing.scalar_amplitude * cosine if forcing and self._is_relative(forcing) else 0.0
        row = []
        for name, columns, weights in zip(self.names, self._columns, self._weights, strict=True):
            own = values[columns] * weights if len(weights) else values[columns]
            value = math.fsum(own.tolist())
            if name.startswith("forcing") and forcing is not None:
                value = _amplitude(forcing, number_of_force(name)) * cosine
            elif name.startswith("forcing"):
                value = float(np.sum(_forces_at(forces, name, parameters, np.array([time]))))
            elif name.startswith("acceleration"):
                value += base
            row.append(value)
        return row

    def _is_relative(self, forcing: Forcing) -> bool:
        """Return whether the accelerations of the FMU are relative to the base: it moves, and the FMU has no base."""
        return forcing.kind == "base_acceleration" and self._relative

    def base(
        self, forces: Sequence[Force], parameters: Mapping[str, float], times: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the acceleration of the base to be added to the FMU's at instants, m/s^2, shape (instant,)."""
        forcing = _only(forces)
        if forcing is None or not self._is_relative(forcing):
            return np.zeros(len(times))  # the FMU of several forces has the base
        return forcing.scalar_amplitude * cosines(
            forcing.angular_frequency, parameters["forcing.phase"], times
        )

    def rows(
        self,
        values: NDArray[np.float64],
        variables: Sequence[str],
        forces: Sequence[Force],
        parameters: Mapping[str, float],
        times: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the sampled variables `names` at many instants, shape (instant, name): see `row`.

        The values of the FMU have shape (instant, variable); `variables` names their columns, the plan's among them.
        """
        place = {name: column for column, name in enumerate(variables)}
        own = [place[name] for name in self.variables]
        found = np.zeros((len(times), len(self.names)))
        base = self.base(forces, parameters, times)
        for column, (name, parts, weights) in enumerate(
            zip(self.names, self._columns, self._weights, strict=True)
        ):
            if name.startswith("forcing"):
                found[:, column] = _forces_at(forces, name, parameters, times)
                continue
            terms = values[:, [own[part] for part in parts]]
            found[:, column] = _sums(terms * weights if len(weights) else terms)
            if name.startswith("acceleration"):
                found[:, column] += base
        return found


def few_samples_message(durations: NDArray[np.float64], rate: float, *, has_peaks: bool) -> str:
    """Return a message on contacts with too few samples for their largest forces; empty if there are none.

    Durations of contacts are in s, 0 at rigid stops, NaN for open contacts; the rate is in Hz. `has_peaks`: whether
    impacts are recorded, with their largest forces.

    Examples
    --------
    >>> few_samples_message(np.array([2e-4, 4e-3, 0.0, np.nan]), 5000.0, has_peaks=True)[:62]
    '1 of 2 contacts with fewer than 10 samples, the shortest has 1'
    """
    known = durations[durations > 0.0]
    short = known[known * rate < FEWEST_SAMPLES]
    if not len(short):
        return ""
    needed = math.ceil(float(f"{FEWEST_SAMPLES / short.min():.2g}"))
    where = "impact_peak_force has them" if has_peaks else "impact_peak_force of recorded impacts has them"
    return (
        f"{len(short)} of {len(known)} contacts with fewer than {FEWEST_SAMPLES} samples, the shortest has "
        f"{short.min() * rate:.2g}: the time series misses their largest forces. {where}, "
        f"and a rate of {needed} would show them"
    )


def _only(forces: Sequence[Force]) -> Forcing | None:
    """Return the only force, a sine; None without forces, and for forces that the FMU of a structure has."""
    return cast(Forcing, forces[0]) if forces and is_one_sine(forces) else None


def _forces_at(
    forces: Sequence[Force], name: str, parameters: Mapping[str, float], times: NDArray[np.float64]
) -> NDArray[np.float64] | float:
    """Return the sampled variable `forcing` or `forcing[i]`: a force, or under one force that on a mass."""
    number, forcing = number_of_force(name), _only(forces)
    if forcing is not None:
        return _amplitude(forcing, number) * cosines(
            forcing.angular_frequency, parameters["forcing.phase"], times
        )
    return Forces(forces, parameters).values(number, times) if forces and number else 0.0


def _sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of each row, rounded once."""
    if values.shape[1] == 1:
        return values[:, 0]
    return np.array([math.fsum(row) for row in values.tolist()])


def _amplitude(forcing: Forcing, mass: int | None) -> float:
    if mass is not None and isinstance(forcing.amplitude, tuple):
        return forcing.amplitude[mass - 1]
    return forcing.scalar_amplitude


def fmu_variables(name: str, stops: int) -> tuple[str, ...]:
    """Return the variables of the body's FMU whose sum is the sampled variable; none for the forcing.

    Examples
    --------
    >>> fmu_variables("contact_force", 2), fmu_variables("contact_displacement[2]", 2)
    (('contact[1].force', 'contact[2].force'), ('contact[2].displacement',))
    >>> fmu_variables("displacement[3]", 0), fmu_variables("forcing[1]", 0)
    (('displacement[3]',), ())
    """
    if name == "contact_force":
        return tuple(f"contact[{k}].force" for k in range(1, stops + 1))
    match = _ELEMENT.fullmatch(name)
    word = match[1] if match else name
    if word == "forcing":
        return ()
    if match and word in AT_CONTACT:
        return (f"contact[{match[2]}].{AT_CONTACT[word]}",)
    return (name,)


def number_of_force(name: str) -> int | None:
    """Return the number i of `forcing[i]`, of a mass or of a force; None for any other name."""
    match = _ELEMENT.fullmatch(name)
    return int(match[2]) if match and match[1] == "forcing" else None


def follow_energies(names: Iterable[str]) -> bool:
    """Return whether the body must follow its energies for these variables, which costs time at every step."""
    return any(name.startswith(_FOLLOWED) for name in names)
