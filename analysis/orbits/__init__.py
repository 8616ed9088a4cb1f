"""Periodic orbits of bodies between stops, stable and unstable, and how they change with a parameter."""

from __future__ import annotations

from vibroimpact.analysis.orbits.finding import find_orbit
from vibroimpact.analysis.orbits.periodic import OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.single_impacts import closed_form
from vibroimpact.fmus.bodies import Contact, ImpactingBody

__all__ = ["Contact", "ImpactingBody", "OrbitError", "PeriodicOrbit", "closed_form", "find_orbit"]
