"""The error of a search for orbits."""

from __future__ import annotations

from vibroimpact.fmus.errors import VibroimpactError


class OrbitError(VibroimpactError):
    """An orbit was not found, or not followed further, with the given numbers."""

    exit_code = 2
