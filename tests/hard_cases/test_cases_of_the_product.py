"""The hard cases that `vibroimpact hard-cases` measures: each within its bound, each with a curve to draw."""

from __future__ import annotations

import pytest

from vibroimpact.orchestrator.hard_cases import CASES, measured_cases

LONG = {"many-modes"}
"""Cases that take seconds; `test_structures_extremes.py` has bodies of 64 modes too."""


@pytest.mark.parametrize(
    "name", [pytest.param(case.name, marks=[pytest.mark.long] * (case.name in LONG)) for case in CASES]
)
def test_a_hard_case_holds(name: str) -> None:
    (found,) = measured_cases([name])
    assert found.is_met, f"{found.found.figure} above {found.case.bound} {found.failure}"
    assert len(found.found.curve.x) == len(found.found.curve.y) >= 3
