"""Interspike intervals: how regular they are, what motion they show, what is missing, and their dimension.

Start at `interval_report`; it calls one module for each question.
"""

from vibroimpact.analysis.intervals.printing import print_intervals
from vibroimpact.analysis.intervals.report import interval_report
from vibroimpact.analysis.intervals.trains import IntervalTrain, interval_train, seams

__all__ = ["IntervalTrain", "interval_report", "interval_train", "print_intervals", "seams"]
