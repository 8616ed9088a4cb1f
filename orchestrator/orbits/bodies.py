"""The modes and contacts of a scene, which define its orbits, with the numbers that its FMU gets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.fmus.bodies import BodyPoints, ImpactingBody
from vibroimpact.fmus.bodies.adrift import loose_first, without_drift
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.limits import OF_OWN_PERIOD, Seen, refuse_orbits, seen, seen_of_drag
from vibroimpact.orchestrator.run.parameters import body_points, float_parameters, own_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.fields import bounds_of, rule_of
from vibroimpact.orchestrator.scene.forcing_clock import is_frequency

Floats = NDArray[np.float64]
MOST_KEPT = 16
"""Number of bodies along a scene's numbers that are kept."""
SLIGHT = 1e-12
"""Negative damping, over the largest, below which it is rounding."""
YIELDING = frozenset({"law"})
"""Rows of the table of limits that orbits on stops that yield take."""


def impacting_body(scene: Scene, *, all_kinds: bool = False, yielding: bool = False) -> ImpactingBody:
    """Return the modes, the force and the contacts of a scene: an Oscillator, Chain, Beam or Structure on its stops.

    Parameters
    ----------
    scene : Scene
        In the short form; its sweep is ignored.
    all_kinds : bool
        Whether stops that yield are taken, too. Whether the scene may be without a force: negative dashpots then keep
        the body moving (equations.md 4.16). And whether nothing need tie the body to the ground: its drift is then
        told apart.
    yielding : bool
        Whether stops that yield are taken, alone among these kinds.

    Raises
    ------
    UsageError
        The scene is not a body of modes between such stops under forces of one period.
    """
    own = all_kinds and scene.period is None
    refuse_orbits(scene, seen(scene), OF_OWN_PERIOD if own else YIELDING if all_kinds or yielding else ())
    found = _points_of(scene).mass_normalised()
    order = np.argsort(found.frequencies != 0.0, kind="stable")
    found = replace(loose_first(found, order), has_own_period=own)
    if all_kinds and found.loose and not found.is_dragged:
        found = without_drift(found, _velocities(scene)[order])
    if found.is_dragged:
        refuse_orbits(scene, [seen_of_drag(scene)])
    stop_keys = scene.stop_keys
    for key, contact in zip(stop_keys, found.contacts, strict=True):
        if found.loose and contact.press is not None and not contact.press.is_linear:
            refuse_orbits(scene, [Seen("placed", f"{key}.law", f'"{contact.press.law}"')])
        if not contact.shape @ contact.shape > 0.0:
            refuse_orbits(scene, [Seen("held", key, "one that is held")])
    return _named(found, stop_keys, has_own_period=own)


class BodiesAlong:
    """The impacting bodies of a scene along some of its numbers; the last ones are kept.

    A number that is the value of one parameter of the FMU sets that parameter directly. Its sign stays: features of a
    scene, such as a stop that moves, depend on signs alone. Other numbers need the scene anew for each body.

    Parameters
    ----------
    scene : Scene
    values : mapping of str to float
        Keys of the scene that vary, with values at which it has a body.

    Raises
    ------
    UsageError
        The scene has no such key, or no orbits there.
    """

    def __init__(self, scene: Scene, values: Mapping[str, float]) -> None:
        self._scene, self._keys = scene.at(values), tuple(values)
        self._kept: dict[tuple[float, ...], ImpactingBody] = {}
        self._stop_keys, self._own = self._scene.stop_keys, self._scene.period is None
        body = impacting_body(self._scene, all_kinds=True)
        self._points, self._signs = _points_of(self._scene), _signs(values.values())
        sets_clock = self._scene.lists_forces and any(map(is_frequency, self._keys))
        is_direct = not body.loose and all(self._signs) and not sets_clock
        self._parameters = own_parameters(self._scene, self._keys) if is_direct else None

    def __call__(self, *values: float) -> ImpactingBody:
        """Return the body at values of the keys; OrbitError where there is none, such as with a negative damping."""
        place = tuple(map(float, values))
        if place not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[place] = self._body(place)
        return self._kept[place]

    def _body(self, values: tuple[float, ...]) -> ImpactingBody:
        try:
            if self._parameters is None or _signs(values) != self._signs:
                at = dict(zip(self._keys, values, strict=True))
                return impacting_body(self._scene.at(at), all_kinds=True)
            floats = {**self._points.floats, **dict(zip(self._parameters, values, strict=True))}
            found = replace(self._points, floats=floats).mass_normalised()
        except UsageError as problem:
            raise OrbitError(str(problem)) from problem
        return _named(found, self._stop_keys, has_own_period=self._own)


def refuse_outside(scene: Scene, key: str, ends: Iterable[float], options: str) -> None:
    """Raise UsageError if a range of a key, given by these options, holds numbers that no scene has.

    A stop may lose its stiffness at the end of a range: without it there is still a body.
    """
    field = scene.field(key)
    low, high, is_open = bounds_of(field)
    excludes_low = is_open and not key.startswith("stop")
    for value in ends:
        if not low <= value <= high or (excludes_low and value == low):
            rule = rule_of(field)
            raise UsageError(f"{options}: {key}: expected {rule.item or rule.expected}, got {value:g}.")


def _velocities(scene: Scene) -> Floats:
    """Return the modal velocities at the start of a scene, kg^(1/2) m/s."""
    names = scene.body.start_names
    floats = float_parameters(scene, None)
    velocities = [floats[name] for name in names[len(names) // 2 :]]
    return np.asarray(modal_displacements(scene, np.array([velocities]))[0])


def _points_of(scene: Scene) -> BodyPoints:
    """Return the body of a scene; without a force its clock has any period until an orbit sets it."""
    if scene.period is not None:
        return body_points(scene)
    clock = {"forcing.angular_frequency": 1.0, "forcing.amplitude": 0.0, "forcing.phase": 0.0}
    return body_points(scene, clock | float_parameters(scene, None))


def _signs(values: Iterable[float]) -> tuple[int, ...]:
    """Return -1, 0 or 1 for each value."""
    return tuple((value > 0.0) - (value < 0.0) for value in values)


def _named(body: ImpactingBody, stop_keys: Sequence[str], *, has_own_period: bool) -> ImpactingBody:
    """Return a body with the names of its contacts of two points."""
    contacts = body.contacts
    if any(key.startswith("contact") for key in stop_keys):
        keys = (key.replace("[", " ").removesuffix("]") for key in stop_keys)
        contacts = tuple(replace(each, name=name) for each, name in zip(contacts, keys, strict=True))
    if contacts is body.contacts and body.has_own_period == has_own_period:
        return body
    return replace(body, contacts=contacts, has_own_period=has_own_period)


def refuse_without_energy(scene: Scene, body: ImpactingBody) -> None:
    """Raise UsageError for a body without a force that no dashpot gives energy: no orbit of it is isolated."""
    if not body.has_own_period:
        return
    damping = np.diag(body.damping_ratios) if body.coupling is None else body.coupling
    if not (np.linalg.eigvalsh(damping) < -SLIGHT * np.abs(damping).max()).any():
        raise UsageError(
            f"{scene.source}: forcing: expected a force, or a negative dashpot that gives energy, got neither: the "
            "motion dies away, or keeps any energy that it has."
        )


def modal_displacements(scene: Scene, displacements: Floats) -> Floats:
    """Return displacements of the masses of a chain, or of the modes of a beam, in mass-normalised modes.

    The given displacements have shape (state, mass or mode), m; an oscillator has one mass. The result has shape
    (state, mode), kg^(1/2) m.
    """
    return body_points(scene).normalised(displacements)
