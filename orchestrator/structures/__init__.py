"""Structures of one's own: matrices of finite elements and modes of measurements, from files to modes with shapes."""

from vibroimpact.orchestrator.structures.matrices import Matrices
from vibroimpact.orchestrator.structures.modes import Modes

__all__ = ["Matrices", "Modes"]
