"""Costs of tests in a run with `--keep-costs`: they decide the order of modules and the choice of `--fast`."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FILE = Path(__file__).with_name("costs_of_tests.json")
EXPENSIVE = 0.15
"""Processor time of a test, its fixtures and its programs, s, above which `--fast` leaves it out."""
EXPENSIVE_FIXTURE = 2.0
"""Processor time of a test, s, above which it may have made fixtures that other tests of its module use, too.

The tests of such a module stay with one worker, since each worker would make the fixtures again. `--fast` leaves out
all of them.
"""
SHORT = 0.1
"""Wall time of a module, s, below which its place in the order does not matter."""


@functools.cache
def _kept() -> dict[str, Any]:
    return dict(json.loads(FILE.read_text(encoding="utf-8"))) if FILE.exists() else {}


def seconds_of_modules() -> dict[str, float]:
    """Return the wall time of each test module, s."""
    return dict(_kept().get("modules", {}))


def expensive_tests() -> dict[str, float]:
    """Return the processor time of each test above `EXPENSIVE`, s, by its name for pytest."""
    return dict(_kept().get("dear", {}))


@functools.cache
def whole_modules() -> frozenset[str]:
    """Return the modules with a test above `EXPENSIVE_FIXTURE`."""
    return frozenset(
        name.partition("::")[0] for name, took in expensive_tests().items() if took > EXPENSIVE_FIXTURE
    )


def keep(modules: Mapping[str, float], tests: Mapping[str, float]) -> None:
    """Write the wall times of modules, s, and the processor times of tests, s."""
    long = {name: round(took, 1) for name, took in sorted(modules.items()) if took >= SHORT}
    expensive = {name: round(took, 2) for name, took in sorted(tests.items()) if took > EXPENSIVE}
    FILE.write_text(f"{json.dumps({'modules': long, 'dear': expensive}, indent=0)}\n", encoding="ascii")
