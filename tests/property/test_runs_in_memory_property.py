"""Runs of drawn scenes in memory equal their files, and are the same each time."""

from __future__ import annotations

import pytest
import xarray as xr
from hypothesis import given, settings
from support.drawn_oscillators import oscillators
from support.in_memory import assert_memory_is_file

from vibroimpact.orchestrator.scene import parse_scene


@pytest.mark.parametrize("how", ["auto", "fused", "coupled"])
def test_drawn_runs_in_memory_are_what_their_files_give(how: str) -> None:
    @settings(max_examples=15, deadline=None)
    @given(oscillators(how))
    def drawn(text: str) -> None:
        scene = parse_scene(text, "drawn.toml")
        first, again = (assert_memory_is_file(scene).drop_vars("point_seconds") for _ in range(2))
        xr.testing.assert_identical(first, again)

    drawn()
