"""The variables that a time series can name, and the FMU variables that they are."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from difflib import get_close_matches

from vibroimpact.orchestrator.scene.body_models import BeamBody, Body, ChainBody
from vibroimpact.orchestrator.scene.measuring_models import CHANNELS, DRIVE
from vibroimpact.orchestrator.scene.models import Forcing
from vibroimpact.orchestrator.scene.problems import nearest

CONSERVATIVE = ("energy.kinetic", "energy.potential")
INTEGRATED = ("energy.forcing_work", "energy.damping_loss", "energy.contact_loss")
_PLAIN = ("displacement", "velocity", "acceleration", "contact_force")
_AT_CONTACT = {
    "contact_force": "force",
    "contact_displacement": "displacement",
    "contact_velocity": "velocity",
}
_ELEMENT = re.compile(r"([a-z_]+)\[([1-9][0-9]*)\]")
_FOLLOWED = ("modal_energy[", "energy.")


def channels_in(names: Iterable[str]) -> tuple[str, ...]:
    """Return those of some variables that are channels of a measuring chain.

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
    """Return the table that a channel of the measuring chain needs."""
    return "exciter" if channel == DRIVE else channel.partition(".")[0]


def sampled_names(body: Body, stops: int, forcing: Forcing | None) -> tuple[str, ...]:
    """Return the names that a time series of this scene can have, beside `channel_names`.

    Parameters
    ----------
    body : OscillatorBody, ChainBody or BeamBody
    stops : int
        Number of stops.
    forcing : Forcing or None
        An array of amplitudes makes one forcing for each mass.
    """
    forces = len(forcing.amplitude) if forcing and isinstance(forcing.amplitude, tuple) else 0
    names = [*_PLAIN, *(_each("forcing", forces) if forces else ["forcing"])]
    for name in _AT_CONTACT:
        names += _each(name, stops)
    return (*names, *_names_of(body))


def variable_hint(name: str, known: Sequence[str]) -> str:
    """Return a hint that names the nearest variable, or those that there are."""
    near = get_close_matches(name, known, n=1)
    return f'Did you mean "{near[0]}"?' if near else nearest(name, known)


def _names_of(body: Body) -> Iterator[str]:
    yield from CONSERVATIVE
    if isinstance(body, ChainBody):
        for name in ("displacement", "velocity", "acceleration", "modal_energy"):
            yield from _each(name, body.size)
    elif isinstance(body, BeamBody):
        for name in ("modal_displacement", "modal_velocity", "modal_energy"):
            yield from _each(name, body.size)
    if isinstance(body, ChainBody | BeamBody):
        yield from INTEGRATED


def _each(name: str, count: int) -> list[str]:
    return [f"{name}[{number}]" for number in range(1, count + 1)]


def fmu_variables(name: str, stops: int) -> tuple[str, ...]:
    """Return the variables of the body's FMU whose sum a sampled variable is; none for the forcing.

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
    if match and word in _AT_CONTACT:
        return (f"contact[{match[2]}].{_AT_CONTACT[word]}",)
    return (name,)


def forced_mass(name: str) -> int | None:
    """Return the mass (1-based) that `forcing[i]` acts on; None for any other name."""
    match = _ELEMENT.fullmatch(name)
    return int(match[2]) if match and match[1] == "forcing" else None


def follow_energies(names: Iterable[str]) -> bool:
    """Whether the body must follow its energies for these variables; that costs time at every step."""
    return any(name.startswith(_FOLLOWED) for name in names)
