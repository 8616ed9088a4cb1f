"""Interspike intervals: their regularity, the motion they show, missing spikes, and their dimension.

Start at `interval_report`, which calls one module for each question.

Examples
--------
>>> import numpy as np
>>> report = interval_report(np.cumsum(np.tile([0.4, 1.6], 50)), forcing_period=1.0)
>>> report.attrs["cycle"][:6], round(float(report["coefficient_of_variation"]), 2)
('P(2,2)', 0.6)
"""

from vibroimpact.analysis.intervals.printing import print_intervals
from vibroimpact.analysis.intervals.report import interval_report
from vibroimpact.analysis.intervals.trains import IntervalTrain, interval_train, seams

__all__ = ["IntervalTrain", "interval_report", "interval_train", "print_intervals", "seams"]
