"""Figures of motions along a sweep, or over two parameters."""
