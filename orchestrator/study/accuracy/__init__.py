"""The study of accuracy: it simulates a scene in all its ways and measures the error and the cost of each way.

`study` runs the ways, `choice` recommends one, `results` makes the dataset.
"""

from __future__ import annotations

from vibroimpact.orchestrator.study.accuracy.choice import advice, refuse_unreached
from vibroimpact.orchestrator.study.accuracy.measured import Comparison, Measured
from vibroimpact.orchestrator.study.accuracy.results import dataset_of
from vibroimpact.orchestrator.study.accuracy.study import BUDGET, AccuracyOfScene

__all__ = ["BUDGET", "AccuracyOfScene", "Comparison", "Measured", "advice", "dataset_of", "refuse_unreached"]
