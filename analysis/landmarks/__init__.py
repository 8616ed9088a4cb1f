"""Readings of sweeps, the exact periodic orbits to compare them with, and orders of convergence."""

from __future__ import annotations

from vibroimpact.analysis.landmarks.exact import (
    ImpactOscillator,
    StabilityLimit,
    folds,
    grazing_frequencies,
    period_doublings,
)
from vibroimpact.analysis.landmarks.orders import observed_order
from vibroimpact.analysis.landmarks.readings import Reading, bifurcation_readings

__all__ = [
    "ImpactOscillator",
    "Reading",
    "StabilityLimit",
    "bifurcation_readings",
    "folds",
    "grazing_frequencies",
    "observed_order",
    "period_doublings",
]
