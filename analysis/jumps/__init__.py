"""Jumps of the motion along a sweep: the class of each run, and the intervals between runs of two classes."""

from __future__ import annotations

from vibroimpact.analysis.jumps.brackets import jumps_of
from vibroimpact.analysis.jumps.classes import RunClasses, classes_of

__all__ = ["RunClasses", "classes_of", "jumps_of"]
