"""Names of quantities in files, and units and meanings of the sampled variables of bodies."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from vibroimpact.analysis.dataset.schema import RESERVED_NAMES, UnitSystem, unit_in
from vibroimpact.fmus.errors import DatasetError

# Units of sampled variables, found by the end of their name; swept parameters bring their own units.
_QUANTITY_UNITS = {
    "displacement": "m",
    "velocity": "m s-1",
    "acceleration": "m s-2",
    "force": "N",
    "forcing": "N",
    "force_rate": "N s-1",
    "base_acceleration_rate": "m s-3",
    "energy": "J",
    "time": "s",
    "impulse": "N s",
    "kinetic": "J",
    "potential": "J",
    "work": "J",
    "loss": "J",
    "stuck": "1",
    "count": "1",
}


LONGEST_NAME = 180
"""Most characters of a quantity in a name, besides its number: NetCDF takes 256, stores here 200."""


@dataclass(frozen=True, slots=True)
class SampleRule:
    """The schema's entry for a sampled variable of a body; `unit` is its SI unit.

    `pattern` matches its name in a file; its group, where there is one, is the number in `long_name`.
    """

    pattern: str
    unit: str
    long_name: str


_SAMPLE_RULES = (
    SampleRule(r"displacement_(\d+)", "m", "displacement of mass {}"),
    SampleRule(r"velocity_(\d+)", "m s-1", "velocity of mass {}"),
    SampleRule(r"acceleration_(\d+)", "m s-2", "acceleration of mass {}"),
    SampleRule(r"forcing_(\d+)", "N", "force on mass {}"),
    SampleRule(r"modal_displacement_(\d+)", "m", "displacement of mode {}"),
    SampleRule(r"modal_velocity_(\d+)", "m s-1", "velocity of mode {}"),
    SampleRule(r"modal_energy_(\d+)", "J", "energy of mode {}"),
    SampleRule(r"contact_force_(\d+)", "N", "force of stop {}"),
    SampleRule(r"contact_displacement_(\d+)", "m", "displacement of the body at stop {}"),
    SampleRule(r"contact_velocity_(\d+)", "m s-1", "velocity of the body at stop {}"),
    SampleRule("energy_kinetic", "J", "kinetic energy of the body"),
    SampleRule("energy_potential", "J", "elastic energy of the body"),
    SampleRule("energy_forcing_work", "J", "work of the forcing since recording began"),
    SampleRule("energy_damping_loss", "J", "energy lost to damping since recording began"),
    SampleRule("energy_contact_loss", "J", "work done on the stops since recording began"),
)


def sample_rule(stored: str) -> SampleRule | None:
    """Return the rule of a sampled variable by its name in a file, with its number in words; None without one.

    >>> sample_rule("modal_energy_3").long_name
    'energy of mode 3'
    """
    for rule in _SAMPLE_RULES:
        match = re.fullmatch(rule.pattern, stored)
        if match:
            return SampleRule(rule.pattern, rule.unit, rule.long_name.format(*match.groups()))
    return None


def file_name_of(quantity: str) -> str:
    """Return the name a quantity has in a file: CF allows letters, digits and underscores only.

    >>> file_name_of("contact[1].force")
    'contact_1_force'
    """
    return re.sub(r"[^A-Za-z0-9]+", "_", quantity).strip("_")


def file_names(quantities: Sequence[str], taken: Collection[str] = RESERVED_NAMES) -> tuple[str, ...]:
    """Return a unique name in a file for each quantity, in order.

    A name that is taken already gets a number, also where it differs in case only, as CF advises. A name is cut after
    `LONGEST_NAME` characters.

    Parameters
    ----------
    quantities : sequence of str
        Each once.
    taken : collection of str
        Names that are not free.

    Raises
    ------
    DatasetError
        If a quantity is given twice.

    >>> file_names(["ball.h", "ball[h]", "BALL.h", "2.time", "time"])
    ('ball_h', 'ball_h_2', 'BALL_h_3', 'variable_2_time', 'time_2')
    """
    used = set(map(str.lower, taken))
    found: dict[str, str] = {}
    for quantity in quantities:
        if quantity in found:
            raise DatasetError(f"dataset: {quantity}: expected each quantity once, got it twice.")
        plain = file_name_of(quantity)
        # CF wants a letter first.
        base = plain if plain[:1].isalpha() else f"variable_{plain}".strip("_")
        base = base[:LONGEST_NAME].rstrip("_")
        choices = (base, *(f"{base}_{number}" for number in range(2, len(used) + 3)))
        name = next(choice for choice in choices if choice.lower() not in used)
        used.add(name.lower())
        found[quantity] = name
    return tuple(found.values())


def quantity_unit(name: str, system: UnitSystem) -> str:
    """Return the unit of a sampled variable, known by the end of its name.

    An unknown quantity raises DatasetError; the caller must then give its unit to the writer.
    """
    unit = known_unit(name)
    if unit is None:
        raise DatasetError(
            f"dataset: {name}: expected a quantity whose unit is known, got an unknown name. "
            "Give its unit to build_dataset."
        )
    return unit_in(system, unit)


def known_unit(name: str) -> str | None:
    """Return the SI unit of a quantity by the end of its name, or None for an unknown ending."""
    # The number of a quantity among several alike (velocity_2) does not change its kind.
    end = name.rstrip("0123456789_")
    while end and end not in _QUANTITY_UNITS:
        end = end.partition("_")[2]
    return _QUANTITY_UNITS.get(end)
