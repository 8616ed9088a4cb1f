"""Scenes of `[component.NAME]` tables: any FMUs, their connections and events."""
