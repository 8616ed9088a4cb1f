"""The damping laws that are fitted to a free decay."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from itertools import combinations

from vibroimpact.fmus.errors import UsageError

VISCOUS, COULOMB, QUADRATIC = "viscous", "coulomb", "quadratic"
TERMS = (VISCOUS, COULOMB, QUADRATIC)


@dataclass(frozen=True, slots=True)
class DampingLaw:
    """A sum of damping terms, per unit mass: `x'' + omega0^2 x = -2 lambda x' - c sign(x') - q x' |x'|`.

    Attributes
    ----------
    terms : tuple of str
        Some of `viscous` (lambda, 1/s), `coulomb` (c, unit/s^2), `quadratic` (q, 1/unit).
    """

    terms: tuple[str, ...]

    @property
    def name(self) -> str:
        """The terms joined by plus signs."""
        return "+".join(self.terms)


ALL_LAWS = tuple(DampingLaw(terms) for count in (1, 2, 3) for terms in combinations(TERMS, count))
"""Each term alone, each pair, and all three."""


def damping_law(name: str) -> DampingLaw:
    """Return the law with a name such as `viscous+coulomb`; the order of the terms does not matter.

    >>> damping_law("coulomb + viscous").name
    'viscous+coulomb'

    Raises
    ------
    UsageError
        A term is unknown, or named twice.
    """
    given = [part.strip().lower() for part in name.split("+")]
    for part in given:
        if part not in TERMS:
            near = difflib.get_close_matches(part, TERMS, 1)
            hint = f' Did you mean "{near[0]}"?' if near else ""
            raise UsageError(f'damping law: expected a sum of {", ".join(TERMS)}, got "{name}".{hint}')
    if len(set(given)) != len(given):
        raise UsageError(f'damping law: expected each term once, got "{name}". Leave the second one out.')
    return DampingLaw(tuple(term for term in TERMS if term in given))


def spoken(law: DampingLaw) -> str:
    """Return the name of a law as people write it.

    >>> spoken(DampingLaw(("viscous", "coulomb")))
    'viscous + Coulomb'
    """
    return " + ".join("Coulomb" if term == "coulomb" else term for term in law.terms)
