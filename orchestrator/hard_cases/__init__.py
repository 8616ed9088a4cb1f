"""What breaks solvers of impacts, measured on the machine of whoever asks."""

from __future__ import annotations

from vibroimpact.orchestrator.hard_cases.measuring import (
    CASES,
    Measured,
    cases_named,
    dataset_of,
    measured_cases,
)

__all__ = ["CASES", "Measured", "cases_named", "dataset_of", "measured_cases"]
