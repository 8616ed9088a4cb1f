"""Periodic orbits and what is around them: branches, basins, maps, exponents, resonances."""
