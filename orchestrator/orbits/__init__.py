"""Orbits of scenes: found, and followed over a parameter."""

from __future__ import annotations

from vibroimpact.orchestrator.orbits.bodies import impacting_body

__all__ = ["impacting_body"]
