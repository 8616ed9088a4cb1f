"""The contact laws of the core by name, from the table in C that also generates the descriptions of FMUs."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cache
from typing import Literal

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import ComponentError

StopKind = Literal["none", "rigid", "yielding"]
_STOP_KINDS: tuple[StopKind, ...] = ("none", "rigid", "yielding")


@dataclass(frozen=True, slots=True)
class ContactLaw:
    """A contact law of the core.

    Attributes
    ----------
    name : str
        Name in scenes and in the enumeration ContactLaw of FMUs.
    number : int
        Value in the enumeration ContactLaw.
    stop : {"none", "rigid", "yielding"}
        Stop at a port of this law: a rigid stop answers with an impulse, a yielding one with a force.
    external : bool
        Whether another FMU answers for the stop, or hits the point.
    """

    name: str
    number: int
    stop: StopKind
    external: bool


@cache
def contact_laws() -> dict[str, ContactLaw]:
    """Return all contact laws by name, in the order of their numbers."""
    library = core_library()
    law_of = library.vi_door_law
    law_of.restype = ctypes.c_char_p
    stop, external = ctypes.c_int(), ctypes.c_int()
    laws = {}
    for number in range(library.vi_door_most_laws()):
        name: bytes | None = law_of(number, ctypes.byref(stop), ctypes.byref(external))
        if name is not None:
            law = ContactLaw(name.decode("ascii"), number, _STOP_KINDS[stop.value], bool(external.value))
            laws[law.name] = law
    return laws


def contact_law(name: str) -> ContactLaw:
    """Return the contact law with this name.

    Raises
    ------
    ComponentError
        The core has no such law.
    """
    laws = contact_laws()
    if name not in laws:
        raise ComponentError(
            f"contact law: expected one of {', '.join(laws)}, got {name!r}. "
            "Add it to fmus/native/core/contact/contact_law.c and run `python -m vibroimpact.fmus.packaging.build`."
        )
    return laws[name]


def numbered_contact_law(number: int) -> ContactLaw:
    """Return the contact law with this number in the enumeration ContactLaw.

    Raises
    ------
    ComponentError
        The core has no such law.
    """
    for law in contact_laws().values():
        if law.number == number:
            return law
    known = ", ".join(f"{law.number} ({law.name})" for law in contact_laws().values())
    raise ComponentError(f"contact law: expected one of {known}, got {number}.")


@cache
def rigid_law_numbers() -> frozenset[int]:
    """Return the numbers of the laws whose stop answers with a coefficient of restitution, not with a force."""
    return frozenset(
        law.number for law in contact_laws().values() if law.stop == "rigid" and not law.external
    )
