"""Figures of periodic orbits and related sets: branches, basins, maps, exponents, resonances."""
