"""A scene in a notebook is one line of text, and a table of its keys."""

from __future__ import annotations

import pytest
from support.places import EXAMPLES

from vibroimpact.orchestrator.scene import Scene, load_scene

HOSTILE = """
[scene]
title = "<script>alert(1)</script>"
[body]
mass = 1.0
stiffness = 1.0
[[stop]]
position = 1.0
restitution = 0.7
[record]
recorded_time = 5.0
"""


@pytest.mark.parametrize("name", ["bifurcation", "newtons_cradle", "gap_sweep", "tolerances", "two_stops"])
def test_a_scene_is_one_line(name: str) -> None:
    scene = load_scene(EXAMPLES / f"{name}.toml")
    assert repr(scene) == str(scene)
    assert repr(scene).startswith(f"<Scene {scene.title}: ")
    assert "\n" not in repr(scene)
    assert len(repr(scene)) < 250
    assert ("points over" in repr(scene)) == bool(scene.sweep)


def test_its_table_has_every_key_and_no_markup_of_strangers() -> None:
    page = Scene.from_text(HOSTILE, "<b>.toml")._repr_html_()
    assert "<script>" not in page
    assert "<td>&lt;script&gt;alert(1)&lt;/script&gt;</td>" in page
    assert "<tr><td>stop[1].restitution</td><td>0.7</td></tr>" in page
