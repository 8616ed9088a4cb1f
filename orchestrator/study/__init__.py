"""Measured studies of a scene: what accuracy costs in time."""

from __future__ import annotations

from vibroimpact.orchestrator.study.accuracy import BUDGET, dataset_of, study_accuracy
from vibroimpact.orchestrator.study.choice import advice, refuse_unreached
from vibroimpact.orchestrator.study.measured import Measured, Study

__all__ = ["BUDGET", "Measured", "Study", "advice", "dataset_of", "refuse_unreached", "study_accuracy"]
