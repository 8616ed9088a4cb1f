"""The contact laws of a `[[stop]]` with their properties, which replace questions about the class of a stop."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vibroimpact.orchestrator.scene.models import Stop


@dataclass(frozen=True, slots=True)
class Law:
    """The properties of a contact law."""

    is_rigid: bool = False
    """Whether the stop answers with an impulse; a compliant stop answers with a force."""
    is_integrated: bool = False
    """Whether contacts are integrated, without a closed form; their error is `execution.contact_tolerance`."""


LAWS = {
    "restitution": Law(is_rigid=True),
    "kelvin_voigt": Law(),
    "hertz": Law(is_integrated=True),
    "hunt_crossley": Law(is_integrated=True),
}


def all_rigid(stops: Iterable[Stop]) -> bool:
    """Return whether all stops are rigid."""
    return all(LAWS[stop.law].is_rigid for stop in stops)


def any_rigid(stops: Iterable[Stop]) -> bool:
    """Return whether any stop is rigid."""
    return any(LAWS[stop.law].is_rigid for stop in stops)


def integrates_contacts(stops: Iterable[Stop]) -> bool:
    """Return whether any stop has contacts without a closed form."""
    return any(LAWS[stop.law].is_integrated for stop in stops)
