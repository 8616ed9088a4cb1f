"""Motions along a sweep, or over two parameters."""
