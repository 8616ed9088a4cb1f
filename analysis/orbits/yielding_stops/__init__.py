"""Orbits of bodies on stops that yield: flows, contacts, motions and exponents (equations.md 4.18)."""
