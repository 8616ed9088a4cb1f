"""Sobol indices: the share of a result's variance for each drawn key of a campaign, with intervals."""

from __future__ import annotations

from vibroimpact.analysis.operations.sensitivity import LEVEL, RESAMPLES
from vibroimpact.analysis.sensitivity.indices import Indices, sobol_indices
from vibroimpact.analysis.sensitivity.report import sensitivity_report

__all__ = ["LEVEL", "RESAMPLES", "Indices", "sensitivity_report", "sobol_indices"]
