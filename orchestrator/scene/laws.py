"""The contact laws that a `[[stop]]` can have, and what each is: nobody asks a stop for its class."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vibroimpact.orchestrator.scene.models import Stop


@dataclass(frozen=True, slots=True)
class Law:
    """What a contact law is."""

    is_rigid: bool = False
    """Whether its stop answers with an impulse; else it yields, and answers with a force."""
    is_integrated: bool = False
    """Whether its contacts have no closed form: their error is `execution.contact_tolerance`."""


LAWS = {
    "restitution": Law(is_rigid=True),
    "kelvin_voigt": Law(),
    "hertz": Law(is_integrated=True),
    "hunt_crossley": Law(is_integrated=True),
}


def all_rigid(stops: Iterable[Stop]) -> bool:
    """Return whether no stop yields."""
    return all(LAWS[stop.law].is_rigid for stop in stops)


def any_rigid(stops: Iterable[Stop]) -> bool:
    """Return whether a stop is rigid."""
    return any(LAWS[stop.law].is_rigid for stop in stops)


def integrates_contacts(stops: Iterable[Stop]) -> bool:
    """Return whether a stop has contacts without a closed form."""
    return any(LAWS[stop.law].is_integrated for stop in stops)
