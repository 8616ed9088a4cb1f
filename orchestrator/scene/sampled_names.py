"""The names of variables that a time series can have."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING

from vibroimpact.orchestrator.scene.forcing_models import Force, RandomForcing, is_one_sine
from vibroimpact.orchestrator.scene.measuring_models import CHANNELS, DRIVE
from vibroimpact.orchestrator.scene.problems import nearest

if TYPE_CHECKING:
    from vibroimpact.orchestrator.scene.body_models.base import BodyTable

CONSERVATIVE = ("energy.kinetic", "energy.potential")
INTEGRATED = ("energy.forcing_work", "energy.damping_loss", "energy.contact_loss")
_PLAIN = ("displacement", "velocity", "acceleration", "contact_force")
AT_CONTACT = {
    "contact_force": "force",
    "contact_displacement": "displacement",
    "contact_velocity": "velocity",
}


def channels_in(names: Iterable[str]) -> tuple[str, ...]:
    """Return the channels of a measuring chain among some variables.

    >>> channels_in(["velocity", "drive", "sensor.velocity"])
    ('drive', 'sensor.velocity')
    """
    return tuple(filter(CHANNELS.__contains__, names))


def channel_names(tables: Container[str]) -> tuple[str, ...]:
    """Return the channels, in V, that a scene with these tables can sample.

    >>> channel_names({"body", "load_cell", "exciter"})
    ('load_cell', 'drive')
    """
    return tuple(name for name in CHANNELS if table_of(name) in tables)


def table_of(channel: str) -> str:
    """Return the name of the table that a channel of the measuring chain needs."""
    return "exciter" if channel == DRIVE else channel.partition(".")[0]


def sampled_names(body: BodyTable, stops: int, forces: Sequence[Force | None]) -> tuple[str, ...]:
    """Return the possible names in the time series of a scene with a number of stops, besides `channel_names`.

    An array of amplitudes gives one forcing for each mass. Several forces have one name each.
    """
    only = forces[0].amplitude if len(forces) == 1 and forces[0] is not None else 0.0
    count = len(forces) if not is_one_sine(forces) else len(only) if isinstance(only, tuple) else 0
    loads = each_of("forcing", count) if count else ["forcing"]
    # the FMU alone knows a random force
    unknown = [name for name, force in zip(loads, forces, strict=False) if isinstance(force, RandomForcing)]
    names = [*_PLAIN, *(name for name in loads if name not in unknown)]
    for name in AT_CONTACT:
        names += each_of(name, stops)
    return (*names, *CONSERVATIVE, *body.own_variables, *(INTEGRATED if body.IS_STRUCTURE else ()))


def each_of(name: str, count: int) -> list[str]:
    """Return `name[1]`, `name[2]`, ..."""
    return [f"{name}[{number}]" for number in range(1, count + 1)]


def variable_hint(name: str, known: Sequence[str]) -> str:
    """Return a hint with the nearest variable, or with the known variables."""
    near = get_close_matches(name, known, n=1)
    return f'Did you mean "{near[0]}"?' if near else nearest(name, known)
