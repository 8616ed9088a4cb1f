"""Shared test helpers: independent references, makers of scenes, records and FMUs, tolerances, places."""
