"""The study of accuracy: a scene is simulated in all its ways, and each way's error is measured beside its cost.

`study` runs it, `choice` says which way to take, `results` makes a dataset of it.
"""

from __future__ import annotations

from vibroimpact.orchestrator.study.accuracy.choice import advice, refuse_unreached
from vibroimpact.orchestrator.study.accuracy.measured import Comparison, Measured
from vibroimpact.orchestrator.study.accuracy.results import dataset_of
from vibroimpact.orchestrator.study.accuracy.study import BUDGET, AccuracyOfScene

__all__ = ["BUDGET", "AccuracyOfScene", "Comparison", "Measured", "advice", "dataset_of", "refuse_unreached"]
