"""Readers of foreign files: matrices of finite elements from the formats of their programs."""

from vibroimpact.orchestrator.structures.readers.sources import Sources, read_matrices

__all__ = ["Sources", "read_matrices"]
