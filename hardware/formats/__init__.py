"""Readers of file formats; each makes the same table of raw columns."""
