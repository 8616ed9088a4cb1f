"""Hard cases for solvers of impacts, measured on the user's machine."""

from __future__ import annotations

from vibroimpact.orchestrator.hard_cases.measuring import (
    CASES,
    Measured,
    cases_named,
    dataset_of,
    measured_cases,
)

__all__ = ["CASES", "Measured", "cases_named", "dataset_of", "measured_cases"]
