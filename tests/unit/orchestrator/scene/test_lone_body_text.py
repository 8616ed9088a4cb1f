"""The text of a scene with one `[[body]]`: its comments stay, and its numbers change in place."""

from __future__ import annotations

import pytest

from vibroimpact.orchestrator.scene import Scene

LISTED = """# a ball between walls
[[body]] # steel
name = "ball"
mass = 1.0 # kg
stiffness = 1.0

[[stop]] # the wall
at = "ball"
position = 0.5 # m
restitution = 0.8

[forcing]
at = "ball.mass"
amplitude = 1.0 # N
angular_frequency = 1.1

[record]
recorded_periods = 5

[sweep]
"body[1].mass" = { values = [1.0, 2.0] } # heavier
"""
SINGLE = """# a ball between walls
[body] # steel
mass = 1.0 # kg
stiffness = 1.0

[[stop]] # the wall
position = 0.5 # m
restitution = 0.8

[forcing]
amplitude = 1.0 # N
angular_frequency = 1.1

[record]
recorded_periods = 5

[sweep]
"body.mass" = { values = [1.0, 2.0] } # heavier
"""


def test_a_lone_body_keeps_the_comments_of_its_scene() -> None:
    found = Scene.from_text(LISTED)
    assert found.to_toml() == SINGLE
    assert Scene.from_text(found.to_toml()).to_toml() == SINGLE


def test_a_table_beside_a_link_becomes_a_list_with_its_comments() -> None:
    text = SINGLE.replace("[body] # steel", '[body] # steel\nname = "ball"').replace(
        "[forcing]",
        '[[link]] # soft\nbetween = ["ball", "ground"]\nstiffness = 0.1\n\n[forcing]\nat = "ball"',
    )
    text = text.replace("[[stop]] # the wall", '[[stop]] # the wall\nat = "ball"')
    found = Scene.from_text(text)
    assert found.to_toml() == text.replace("[body]", "[[body]]").replace('"body.mass"', '"body[1].mass"')
    assert found.sweep[0].key == "body[1].mass"


@pytest.mark.parametrize(
    "body",
    [
        'body = [{ name = "ball", mass = 1.0, stiffness = 1.0 }]',
        '[["body"]]\nname = "ball"\nmass = 1.0\nstiffness = 1.0',
    ],
)
def test_an_unusual_layout_is_the_same_scene(body: str) -> None:
    found = Scene.from_text(f"{body}\n[record]\nrecorded_time = 1.0")
    assert found.body.size == 1
    assert Scene.from_text(found.to_toml()).body == found.body
