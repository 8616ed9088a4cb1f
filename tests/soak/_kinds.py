"""The kinds of cases that a package holds, and their settings."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass

CASES = 5000
SAMPLE = 40
SECONDS = 20.0
SEED_STRIDE = 1_000_000
"""Number of seeds for each base seed; no kind has as many cases."""


@dataclass(frozen=True)
class Kind:
    """One kind of cases.

    Attributes
    ----------
    name : str
        Name of its module.
    package : str
        Package that holds the module.
    cases, sample : int
        Number of cases of `make soak` and of `make test`.
    seconds : float
        Processor time after which a case counts as hanging.
    is_alone : bool
        The kind measures wall time: its cases run without other cases beside them.
    """

    name: str
    package: str
    cases: int
    sample: int
    seconds: float
    is_alone: bool = False

    def seed(self, base: int, case: int) -> int:
        """Return the seed of a case."""
        return base * SEED_STRIDE + case


def load(name: str, package: str) -> Callable[[int], str | None]:
    """Return the check of a kind."""
    check: Callable[[int], str | None] = importlib.import_module(f"{package}.{name}").check
    return check


def names(package: str = "soak") -> list[str]:
    """Return the names of all kinds, sorted."""
    paths = importlib.import_module(package).__path__
    found = (module.name for module in pkgutil.iter_modules(paths))
    return sorted(name for name in found if not name.startswith(("_", "test_")))


def kind(name: str, package: str = "soak") -> Kind:
    """Return a kind with the settings of its module."""
    module = importlib.import_module(f"{package}.{name}")
    return Kind(
        name,
        package,
        int(getattr(module, "CASES", CASES)),
        int(getattr(module, "SAMPLE", SAMPLE)),
        float(getattr(module, "SECONDS", SECONDS)),
        bool(getattr(module, "ALONE", False)),
    )
