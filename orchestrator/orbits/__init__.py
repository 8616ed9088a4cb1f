"""Studies of a scene's orbits: search, continuation over a parameter, and related analyses."""

from __future__ import annotations

from vibroimpact.orchestrator.orbits.bodies import impacting_body

__all__ = ["impacting_body"]
