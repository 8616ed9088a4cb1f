"""The matrices to take from a file, and their usual names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from vibroimpact.fmus.errors import UsageError

ROLES = ("stiffness", "mass", "damping")
_USUAL: Mapping[str, tuple[str, ...]] = {
    "stiffness": ("stiffness", "k", "kaa", "kaax", "kgg", "kggx", "kxx"),
    "mass": ("mass", "m", "maa", "maax", "mgg", "mggx", "mxx"),
    "damping": ("damping", "c", "d", "b", "baa", "baax", "bgg", "bggx", "bxx"),
}
"""Names of each matrix in lower case, of Nastran's files too; the first of them in a file counts."""
MOST_LISTED = 8
"""Names that a message lists."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """The matrices to take from one file.

    Attributes
    ----------
    names : mapping of str to str
        Name in the file of each wanted role: `stiffness`, `mass`, `damping`; empty for a usual name.
    optional : frozenset of str
        Roles that the file may lack.
    """

    names: Mapping[str, str]
    optional: frozenset[str] = frozenset()

    def options(self) -> dict[str, Any]:
        """Return the options of a reader in another process."""
        return {"names": dict(self.names), "optional": sorted(self.optional)}

    def only(self) -> str:
        """Return the role of the matrix in a file that holds one.

        Raises
        ------
        UsageError
            Several matrices are wanted, or one by its name.
        """
        roles = [role for role in self.names if role not in self.optional]
        if len(roles) != 1 or self.names[roles[0]]:
            got = "one whose matrix has no name"
            raise UsageError(
                f"expected a file of several matrices, got {got}. Give one file for each matrix."
            )
        return roles[0]

    def among(self, names: Iterable[str]) -> dict[str, str]:
        """Return the name in the file of each wanted role; optional ones that are missing are left out.

        Raises
        ------
        UsageError
            A wanted matrix is missing.
        """
        there = list(names)
        found = {role: self._name_of(role, there) for role in self.names}
        for role, name in found.items():
            if not name and role not in self.optional:
                raise UsageError(f"expected {self._said(role)}, got {listed(there)}.")
        return {role: name for role, name in found.items() if name}

    def _name_of(self, role: str, there: list[str]) -> str:
        """Return the name in the file of a role; empty without one."""
        given = self.names[role]
        if given:
            return given if given in there else ""
        by_lower = {name.lower(): name for name in reversed(there)}
        usual = next((by_lower[name] for name in _USUAL[role] if name in by_lower), "")
        alone = there[0] if len(there) == len(self.names) == 1 else ""
        return usual or alone

    def _said(self, role: str) -> str:
        given = self.names[role]
        usual = ", ".join(name if len(name) > 5 else name.upper() for name in _USUAL[role])
        return f"a matrix {given!r} ({role})" if given else f"a {role} matrix, named one of {usual}"


def listed(names: Iterable[str]) -> str:
    """Return some names for a message.

    >>> listed("abc")
    "'a', 'b', 'c'"
    >>> listed([])
    'none'
    """
    there = list(names)
    more = f" and {len(there) - MOST_LISTED} more" if len(there) > MOST_LISTED else ""
    return (", ".join(repr(name[:40]) for name in there[:MOST_LISTED]) or "none") + more
