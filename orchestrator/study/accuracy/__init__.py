"""The study of accuracy: a scene is simulated in all its ways, and each way's error is measured beside its cost.

`study` runs it, `choice` says which way to take, `results` makes a dataset of it.
"""

from __future__ import annotations

from vibroimpact.orchestrator.study.accuracy.choice import advice, refuse_unreached
from vibroimpact.orchestrator.study.accuracy.measured import Measured, Study
from vibroimpact.orchestrator.study.accuracy.results import dataset_of
from vibroimpact.orchestrator.study.accuracy.study import BUDGET, study_accuracy

__all__ = ["BUDGET", "Measured", "Study", "advice", "dataset_of", "refuse_unreached", "study_accuracy"]
