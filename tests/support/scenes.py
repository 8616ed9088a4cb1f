"""Scenes of each kind as texts, changes of them, and the messages about wrong ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene, parse_scene

SOURCE = "s.toml"
FORCED = """\
[scene]
title = "t"
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping = 0.1
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = 10
recorded_periods = 5
"""
CHAIN = """\
[body]
kind = "chain"
masses = [1.0, 2.0, 0.5]
stiffnesses = [3.0, 1.0, 2.0]
dampings = 0.1
[forcing]
amplitude = [0.5, 0.0, 0.1]
angular_frequency = 0.9
[[stop]]
position = 0.1
mass = 2
restitution = 0.7
[record]
recorded_periods = 5
"""
BEAM = """\
[body]
kind = "beam"
length = 0.25
width = 0.02
thickness = 0.002
youngs_modulus = 70e9
density = 2700
modes = 3
damping_ratio = [0.01, 0.02, 0.03]
[forcing]
amplitude = 0.05
frequency = 25.0
[[stop]]
position = 0.001
location = 0.8
restitution = 0.6
[record]
recorded_periods = 5
"""
YIELDING = 'law = "kelvin_voigt"\nstiffness = 1e4\ndamping = 2.0'


def scene_of(text: str, source: str | Path = SOURCE) -> Scene:
    return parse_scene(text, str(source))


def changed(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new)


def swept(text: str, *entries: str) -> str:
    return text + "[sweep]\n" + "\n".join(entries)


def problems_of(text: str, source: str | Path = SOURCE) -> list[str]:
    """Return all problems of a wrong scene, a line each, without its file."""
    with pytest.raises(SceneError) as caught:
        scene_of(text, source)
    assert str(caught.value) == "\n".join(caught.value.problems)
    return [problem.removeprefix(f"{source}: ") for problem in caught.value.problems]


def problem_of(text: str, source: str | Path = SOURCE) -> str:
    """Return the one problem of a scene, without its file."""
    (problem,) = problems_of(text, source)
    return problem
