"""Several `[[body]]` tables that links join: one body of modes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vibroimpact.orchestrator.scene.body_models.base import BodyTable, NoPoint, Stops
from vibroimpact.orchestrator.scene.body_models.growing import has_negative
from vibroimpact.orchestrator.scene.body_models.modes import ModesBody
from vibroimpact.orchestrator.scene.body_models.points import (
    ALL,
    GROUND,
    OneBody,
    PointOfBody,
    find_point,
)
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.forcing_models import Force, Forcing
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import DAMPING, Finite, SceneTable, Stop, StopTable
from vibroimpact.orchestrator.scene.point_fields import POINT_RULE, Observed, Point
from vibroimpact.orchestrator.scene.sampled_names import each_of

if TYPE_CHECKING:
    from vibroimpact.fmus.bodies.assembly import Assembly

MOST_LINKS = 256
FARTHEST = 1e9
"""Displacement of a motion that grows, over the largest length of its scene, at which a run ends as unbounded."""
MOTIONS = ("displacement", "velocity")
NOT_IN_STRUCTURES = (
    *("modes", "residual", "observed_mass", "impact_projection", "poisson_ratio"),
    *("frequency_slope", "damping_slope", "damping_reciprocal"),
)
"""Keys of a body that have no meaning, or no number to vary, among several bodies; `modes` of a beam is fixed."""


class LinkTable(SceneTable):
    """`[[link]]`: a spring and a dashpot in parallel between two points."""

    between: Annotated[
        tuple[Point, ...],
        Field(strict=False, min_length=2, max_length=2),
        Rule(
            'two points of bodies such as ["frame", "beam.tip"]',
            item=POINT_RULE.item,
            hint=f'One of them may be "{GROUND}".',
            doc=f'two points of bodies, or one and `"{GROUND}"`',
        ),
    ]
    stiffness: Annotated[Finite, Rule(unit="N/m", doc="0 for a dashpot alone; negative springs push")] = 0.0
    damping: Annotated[Finite, Rule(unit="N s/m", effect=DAMPING, doc="negative dashpots give energy")] = 0.0


class StructureBody(BodyTable):
    """Several bodies with their links; the state is the state of the modes of all of them."""

    NAME: ClassVar[str] = "several bodies"
    FMU: ClassVar[str] = "Structure"
    MOST_STOPS: ClassVar[int] = 32
    ELEMENT: ClassVar[str] = "mode"
    STATE: ClassVar[str] = "modal_"
    SLOWEST: ClassVar[str] = "mode.angular_frequency"
    TAKES_ARRAYS: ClassVar[bool] = False
    PLACE: ClassVar[str] = "at"
    CAN_BE_MEASURED: ClassVar[bool] = False

    names: Annotated[tuple[str, ...], Rule(sweepable=False)]
    parts: Annotated[tuple[OneBody, ...], Rule(sweepable=False)]
    links: Annotated[tuple[LinkTable, ...], Rule(sweepable=False)] = ()
    observed: Annotated[tuple[Observed, ...], Rule(sweepable=False)] = ()
    driven: Annotated[Point | None, Rule(sweepable=False)] = None

    @property
    def size(self) -> int:
        """Number of modes: the masses of oscillators and chains, and the modes of beams."""
        return sum(part.size for part in self.parts)

    @property
    def start_names(self) -> tuple[str, ...]:
        """Parameters of the FMU with the start of the modes, in the order of the state."""
        names = "displacement", "velocity"
        return tuple(one for name in names for one in each_of(f"mode.{name}_start", self.size))

    @property
    def own_variables(self) -> tuple[str, ...]:
        """The motion of each observed point, and the motion and the energy of each mode."""
        names = "modal_displacement", "modal_velocity", "modal_energy"
        return (
            *observed_variables(self.observed),
            *(one for name in names for one in each_of(name, self.size)),
        )

    def tables(self) -> dict[str, SceneTable]:
        """Return the tables of the scene that have the numbers of the bodies, by their name in keys."""
        bodies = {f"body[{n}]": part for n, part in enumerate(self.parts, start=1)}
        return bodies | {f"link[{n}]": link for n, link in enumerate(self.links, start=1)}

    def with_tables(self, tables: Mapping[str, SceneTable]) -> Self:
        """Return these bodies with other numbers, which are known to be valid, from tables as by `tables`."""
        new = list(tables.values())
        return self.model_construct(
            names=self.names,
            parts=tuple(new[: len(self.parts)]),
            links=tuple(new[len(self.parts) :]),
            observed=self.observed,
            driven=self.driven,
        )

    # ---- points ----

    def point(self, text: str) -> PointOfBody:
        """Return a point of a valid scene by its name."""
        found = find_point(text, self.names, self.parts)
        assert not isinstance(found, NoPoint), "the rules of scenes refuse it"
        return found

    def first_observed(self, stops: Stops) -> Observed | PointOfBody:
        """Return the point or the pair whose displacement has extremes: as given, or `limited_point`."""
        return self.observed[0] if self.observed else self.limited_point(stops)

    def limited_point(self, stops: Stops) -> str | PointOfBody:
        """Return the point of the first stop, else of the first contact, else of the last body."""
        if stops:
            return stops[0].at or stops[0].between[0]
        name, last = self.names[-1], self.parts[-1]
        return f"{name}.{last.points[0]}" if isinstance(last, ModesBody) else name

    def limited_by(self, stop: Stop) -> Observed | PointOfBody:
        """Return the point that a stop limits, or the two points of a contact."""
        return stop.at or stop.between

    def place_of(self, stop: Stop) -> float:
        """Return a number of the point of a stop, which differs between points; NaN for a contact of two points."""
        return math.nan if stop.at is None else _number_of(self.point(stop.at))

    def observed_place(self, stops: Stops, sensor: Sensor | None) -> float:
        """Return the number of the point of the recorded displacement, as by `place_of`."""
        observed = self.first_observed(stops)
        return _number_of(self.point(observed)) if isinstance(observed, str) else math.nan

    def long_names(self, stops: Stops) -> dict[str, str]:
        """Return the motion of each observed point, contact and mode in words, by its name in a time series."""
        found: dict[str, str] = {}
        first = self.first_observed(stops)
        assert not isinstance(first, PointOfBody)  # that of a body alone
        for motion in MOTIONS:
            found[motion] = f"{motion} of {_words(first)}"
            found |= {f"{motion}[{label_of(each)}]": f"{motion} of {_words(each)}" for each in self.observed}
            met = enumerate((_words(stop.at or stop.between) for stop in stops), start=1)
            found |= {f"contact_{motion}[{number}]": f"{motion} of {words}" for number, words in met}
        for number, stop in enumerate(stops, start=1):
            where = f"on {stop.at} at its stop" if stop.at else f"between {' and '.join(stop.between)}"
            found[f"contact_force[{number}]"] = f"force {where}"
        return found

    @property
    def further_words(self) -> tuple[str, ...]:
        """The observed points besides the first, in words."""
        return tuple(map(_words, self.observed[1:]))

    def observing_one(self) -> Self:
        """Return these bodies without the observed points that only a record needs."""
        return self.model_construct(
            names=self.names,
            parts=self.parts,
            links=self.links,
            observed=self.observed[:1],
            driven=self.driven,
        )

    # ---- modes ----

    @property
    def has_negative(self) -> bool:
        """Whether a spring or a dashpot of a body or a link is negative."""
        return any(has_negative(each.model_dump(by_alias=True)) for each in (*self.parts, *self.links))

    @cached_property
    def assembly(self) -> Assembly:
        """The modes of the bodies with their links."""
        # the import takes time, and scenes of one body do not need it
        from vibroimpact.fmus.bodies.assembly import Assembly, Joint

        joints = []
        for link in self.links:
            first, second = (None if end == GROUND else self.point(end) for end in link.between)
            joints.append(Joint(first, second, link.stiffness, link.damping))
        return Assembly([part.as_part() for part in self.parts], joints)

    @property
    def is_coupled(self) -> bool:
        """Whether the damping couples the modes."""
        return self.assembly.is_coupled

    def _shape_of(self, observed: Observed | PointOfBody) -> NDArray[np.float64]:
        """Return the row of a point over the coordinates, or of the first point of a pair minus the second."""
        if isinstance(observed, PointOfBody):
            return self.assembly.point(observed)
        if isinstance(observed, str):
            return self.assembly.point(self.point(observed))
        first, second = (self.assembly.point(self.point(end)) for end in observed)
        return first - second

    def weights_of(self, name: str) -> dict[str, float]:
        """Return the weight of each variable of the FMU in the sampled motion of an observed point; none for others.

        Examples
        --------
        >>> StructureBody.model_construct(names=("a",), parts=(), links=()).weights_of("displacement")
        {}
        """
        for each in self.observed:
            for motion in MOTIONS:
                if name == f"{motion}[{label_of(each)}]":
                    row = self.assembly.in_modes(self._shape_of(each)).tolist()
                    return dict(zip(each_of(f"modal_{motion}", self.size), row, strict=True))
        return {}

    def load(self, force: Force) -> NDArray[np.float64]:
        """Return the force on each mode, kg^(-1/2) N, under a force with the amplitude 1, shape (mode,)."""
        if force.kind == "base_acceleration":
            participation = np.concatenate([part.participation for part in self.assembly.parts])
            return np.asarray(-self.assembly.modal(participation))
        return self._load_at_point(force)

    def _load_at_point(self, force: Force) -> NDArray[np.float64]:
        assert force.at is not None, "the rules of scenes refuse it"
        if force.at == ALL and ALL not in self.names:
            return self.assembly.in_modes(np.ones(self.size))
        return self.assembly.in_modes(self._shape_of(force.at))

    def fmu_floats(self, forcing: Forcing | None, stops: Stops, sensor: Sensor | None) -> dict[str, float]:
        """Return the modes, their start, their shapes at contacts, and their loads, mass-normalised, SI."""
        assembly = self.assembly
        observed = self._shape_of(self.first_observed(stops))
        participation = np.concatenate([part.participation for part in assembly.parts])
        base = -assembly.modal(participation)
        if forcing is not None and forcing.at is not None:
            force = self._load_at_point(forcing)
        else:
            force = assembly.in_modes(self._shape_of(self.driven or self.limited_point(stops)))
        rows = {
            "angular_frequency": assembly.frequencies,
            "observed_shape": assembly.in_modes(observed),
            "forcing": base if forcing is not None and forcing.kind == "base_acceleration" else force,
            "base": base,
            "force": force,
            "displacement_start": assembly.modal(
                np.concatenate([part.displacements for part in assembly.parts])
            ),
            "velocity_start": assembly.modal(np.concatenate([part.velocities for part in assembly.parts])),
        }
        points = (*map(self.limited_by, stops), *self.observed[1:])
        tables = {"contact_shape": [assembly.in_modes(self._shape_of(each)) for each in points]}
        if assembly.is_coupled:
            tables["damping"] = list(assembly.damping)
        else:
            rows["damping_ratio"] = assembly.damping_ratios
        found = {
            f"mode.{name}[{i}]": value
            for name, row in rows.items()
            for i, value in enumerate(row.tolist(), start=1)
        }
        found |= {
            f"mode.{name}[{k},{i}]": value
            for name, table in tables.items()
            for k, row in enumerate(table, start=1)
            for i, value in enumerate(row.tolist(), start=1)
        }
        if forcing is not None:
            found["forcing.amplitude"] = forcing.scalar_amplitude
        return found | {"displacement_limit": FARTHEST * self._largest_length(stops)}

    def _largest_length(self, stops: Stops) -> float:
        """Return the largest position, clearance or start displacement, m; 1 where all are 0. Points have arrays."""
        starts = [float(np.abs(part.displacements).max()) for part in self.assembly.parts]
        largest = reduce(np.maximum, [np.abs(stop.position) for stop in stops], max(starts))
        found = np.where(largest > 0.0, largest, 1.0)
        return found if found.ndim else float(found)  # type: ignore[return-value]

    def fmu_integers(self, forcing: Forcing | None, stops: Stops) -> dict[str, int]:
        """Return the number of modes and of further observed points, and whether the damping couples the modes.

        A motion that grows ends where it can meet no stop any more. For stops that move the FMU does not know that.
        """
        still = not any(isinstance(stop, StopTable) and stop.moves for stop in stops)
        further = {"further_points": len(self.observed) - 1} if len(self.observed) > 1 else {}
        return {"modes": self.size, "coupled": self.is_coupled, "ends_unbounded": still, **further}


class BodyAlone(StructureBody):
    """One `[body]` as a structure, under forces that the FMU of its own kind does not have.

    Its stops, forces and numbers have the keys of a scene of one body.
    """

    @property
    def body(self) -> OneBody:
        """The body as its table describes it."""
        return self.parts[0]

    def tables(self) -> dict[str, SceneTable]:
        """Return the table `[body]`."""
        return {"body": self.body}

    def is_shaping(self, key: str) -> bool:
        """Return whether a number of a key changes rows over the modes."""
        return super().is_shaping(key) or key.endswith((".location", "]"))

    @property
    def own_variables(self) -> tuple[str, ...]:
        """The motion of each mass of a chain, and the motion and the energy of each mode."""
        masses = [one for name in MOTIONS for one in each_of(name, len(self._masses))]
        return (*masses, *super().own_variables)

    @property
    def _masses(self) -> tuple[float, ...]:
        return getattr(self.body, "masses", ())

    def _at(self, place: float) -> PointOfBody:
        return PointOfBody(0, place or self.body.size)  # an oscillator has no places

    def first_observed(self, stops: Stops) -> PointOfBody:
        """Return the point that a scene of one body observes."""
        return self._at(self.body.observed_place(stops, None))

    def limited_point(self, stops: Stops) -> PointOfBody:
        """Return the observed point."""
        return self.first_observed(stops)

    def limited_by(self, stop: Stop) -> PointOfBody:
        """Return the point that a stop limits."""
        return self._at(self.place_of(stop))

    def place_of(self, stop: Stop) -> float:
        """Return the place of a stop on the body."""
        return self.body.place_of(stop)

    def observed_place(self, stops: Stops, sensor: Sensor | None) -> float:
        """Return the place of the recorded displacement on the body."""
        return self.body.observed_place(stops, sensor)

    def long_names(self, stops: Stops) -> dict[str, str]:
        """Return no names: stops have those of a scene of one body."""
        return {}

    def weights_of(self, name: str) -> dict[str, float]:
        """Return the weights of the modes in the motion of a mass of a chain; none for other variables."""
        for motion in MOTIONS:
            names = each_of(motion, len(self._masses))
            if name in names:
                row = self.assembly.in_modes(self._shape_of(self._at(names.index(name) + 1))).tolist()
                return dict(zip(each_of(f"modal_{motion}", self.size), row, strict=True))
        return {}

    def _load_at_point(self, force: Force) -> NDArray[np.float64]:
        return self.assembly.in_modes(np.array(self.body.load_of(force)))


def label_of(observed: Observed) -> str:
    """Return an observed point or pair in the names of its sampled variables.

    >>> label_of("beam.tip"), label_of(("ball", "frame"))
    ('beam.tip', 'ball - frame')
    """
    return observed if isinstance(observed, str) else " - ".join(observed)


def _words(observed: Observed) -> str:
    return observed if isinstance(observed, str) else " relative to ".join(observed)


def observed_variables(observed: Sequence[Observed]) -> tuple[str, ...]:
    """Return the sampled variables of observed points and pairs.

    >>> observed_variables(["ball", ("ball", "frame")])[1:3]
    ('velocity[ball]', 'displacement[ball - frame]')
    """
    return tuple(f"{name}[{label_of(each)}]" for each in observed for name in MOTIONS)


def _number_of(point: PointOfBody) -> float:
    return 100.0 * point.body + point.place
