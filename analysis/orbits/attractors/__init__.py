"""Attractors of a body and their basins: told apart, with shares, borders and edges."""
