"""One mistake in a scene of any kind gives one clear line."""

from __future__ import annotations

import pytest
from support.component_mistakes import COUPLED, OF_COMPONENTS
from support.scene_mistakes import OF_A_BEAM, OF_A_CHAIN, OF_AN_OSCILLATOR
from support.scenes import BEAM, CHAIN, FORCED, problem_of

MISTAKES = {FORCED: OF_AN_OSCILLATOR, CHAIN: OF_A_CHAIN, BEAM: OF_A_BEAM, COUPLED: OF_COMPONENTS}


@pytest.mark.parametrize(
    ("scene", "old", "new", "problem"),
    [(scene, *mistake) for scene, mistakes in MISTAKES.items() for mistake in mistakes],
)
def test_one_mistake_is_one_clear_line(scene: str, old: str, new: str, problem: str) -> None:
    assert old in scene
    line = problem_of(scene.replace(old, new))
    if problem.endswith("..."):
        assert line.startswith(problem.removesuffix("..."))
    else:
        assert line == problem


WRONG_SWEEPS = [
    (FORCED, '"body.mas" = { values = [1] }', 'sweep."body.mas"', "Did you mean body.mass?"),
    (
        FORCED,
        '"forcing.omega" = { values = [1] }',
        'sweep."forcing.omega"',
        "Known here: amplitude, location, angular_frequency, frequency, phase",
    ),
    (
        FORCED,
        '"forcing.amplitud" = { values = [1] }',
        'sweep."forcing.amplitud"',
        "Did you mean forcing.amplitude?",
    ),
    (FORCED, '"body.kind" = { values = [1] }', 'sweep."body.kind"', "cannot be swept"),
    (FORCED, '"stop[1].side" = { values = [1] }', 'sweep."stop[1].side"', "cannot be swept"),
    (FORCED, '"stop[0].position" = { values = [1] }', 'sweep."stop[0].position"', "Indices start at 1"),
    (FORCED, '"stop[2].position" = { values = [1] }', 'sweep."stop[2].position"', "has 1 [[stop]]"),
    (FORCED, "forcing.angular_frequency = { values = [1] }", "sweep.forcing", "quotes"),
    (FORCED, '"body.mass" = [1, 2]', 'sweep."body.mass"', "values = [0.6, 0.7]"),
    (FORCED, '"body.mass" = {}', 'sweep."body.mass"', "Add start, stop and points."),
    (FORCED, '"body.mass" = { start = 1, points = 2 }', 'sweep."body.mass"', "Add stop."),
    (
        FORCED,
        '"body.mass" = { start = 1, stop = 2, points = 3, values = [1] }',
        'sweep."body.mass"',
        "Remove values",
    ),
    (FORCED, '"body.mass" = { start = 1, stop = 2, points = 1 }', 'sweep."body.mass".points', ">= 2"),
    (FORCED, '"body.mass" = { start = 1, stop = 2, points = 0 }', 'sweep."body.mass".points', "from 1 to"),
    (FORCED, '"body.mass" = { start = 1, stop = 1, points = 2 }', 'sweep."body.mass"', "1.0 2 times"),
    (
        FORCED,
        '"body.mass" = { start = 1, stop = 2, points = 1e3 }',
        'sweep."body.mass".points',
        "whole number",
    ),
    (FORCED, '"body.mass" = { values = [] }', 'sweep."body.mass".values', "an empty array"),
    (FORCED, '"body.mass" = { values = [1, 2, 1.0] }', 'sweep."body.mass"', "1.0 2 times"),
    (FORCED, '"body.mass" = { values = [1, 0] }', 'sweep."body.mass"', "expected a number > 0, got 0.0"),
    (FORCED, '"body.mass" = { values = [1, true] }', 'sweep."body.mass".values[2]', "got true"),
    (FORCED, '"body.mass" = { values = [1], path = "upp" }', 'sweep."body.mass".path', 'Did you mean "up"?'),
    (
        FORCED,
        '"stop[1].restitution" = { values = [0.5, 1.1] }',
        'sweep."stop[1].restitution"',
        "0 <= r <= 1, got 1.1",
    ),
    (
        FORCED,
        '"stop[1].position" = { values = [1, -1] }',
        "body.displacement_start",
        "worst of the swept values",
    ),
    (FORCED, '"body.displacement_start" = { values = [0, 2] }', "body.displacement_start", "got 2.0"),
    (
        FORCED,
        '"body.velocity_start" = { values = [0, 2], path = "up" }',
        'sweep."body.velocity_start".path',
        "state",
    ),
    (FORCED, '"body.damping_ratio" = { values = [0.1] }', "body.damping", "a swept key counts as given"),
    (FORCED, '"forcing.angular_frequency" = { values = [0, 1] }', "sweep", "all > 0, or all 0"),
    (
        CHAIN,
        '"body.masses" = { values = [1] }',
        'sweep."body.masses"',
        'an array of 3: sweep an element of it, such as "body.masses[1]"',
    ),
    (CHAIN, '"body.masses[4]" = { values = [1] }', 'sweep."body.masses[4]"', "It is an array of 3"),
    (
        CHAIN,
        '"body.dampings[1]" = { values = [1] }',
        'sweep."body.dampings[1]"',
        "Write dampings as an array first",
    ),
    (
        CHAIN,
        '"body.displacement_start[1]" = { values = [1] }',
        'sweep."body.displacement_start[1]"',
        "Write displacement_start as an array first",
    ),
    (
        CHAIN,
        '"body.masses[2]" = { values = [1, -1] }',
        'sweep."body.masses[2]"',
        "expected a number > 0, got -1.0",
    ),
    (CHAIN, '"body.observed_mass" = { values = [1] }', 'sweep."body.observed_mass"', "cannot be swept"),
    (CHAIN, '"stop[1].mass" = { values = [1] }', 'sweep."stop[1].mass"', "cannot be swept"),
    (
        CHAIN,
        '"stop[1].stiffness" = { values = [1] }',
        'sweep."stop[1].stiffness"',
        "expected a numeric key of this scene",
    ),
    (
        CHAIN,
        '"body.length" = { values = [1] }',
        'sweep."body.length"',
        "expected a numeric key of this scene",
    ),
    (BEAM, '"stop[1].mass" = { values = [1] }', 'sweep."stop[1].mass"', "cannot be swept"),
    (
        BEAM,
        '"body.modes" = { values = [1, 2.5] }',
        'sweep."body.modes"',
        "a whole number from 1 to 64, got 2.5",
    ),
    (
        BEAM,
        '"body.modes" = { values = [1, 65] }',
        'sweep."body.modes"',
        "a whole number from 1 to 64, got 65",
    ),
    (BEAM, '"execution.deadline" = { values = [1] }', 'sweep."execution.deadline"', "cannot be swept"),
    (
        BEAM,
        '"execution.contact_tolerance" = { values = [1] }',
        'sweep."execution.contact_tolerance"',
        "0 < tolerance <= 0.01",
    ),
    (BEAM, '"execution.macro_step" = { values = [1] }', "execution.macro_step", 'how = "coupled"'),
    (
        BEAM,
        '"stop[1].location" = { values = [0, 0.5] }',
        "stop[1].location",
        "0.0 is the clamped end",
    ),
    (COUPLED, '"a.masss" = { values = [1] }', 'sweep."a.masss"', "Did you mean a.mass?"),
    (COUPLED, '"c.mass" = { values = [1] }', 'sweep."c.mass"', "Known here: a, b."),
    (COUPLED, '"body" = { values = [1] }', "sweep.body", "COMPONENT.VARIABLE"),
    (COUPLED, "a.mass = { values = [1] }", "sweep.a", 'Put the whole key in quotes: "a.mass".'),
    (COUPLED, '"a.velocity" = { values = [1] }', 'sweep."a.velocity"', "got the output velocity"),
    (
        COUPLED,
        '"a.record.impacts" = { values = [1] }',
        'sweep."a.record.impacts"',
        "Run a scene for each value.",
    ),
    (COUPLED, '"a.contact[1].law" = { values = [1, 9] }', 'sweep."a.contact[1].law"', "got 9.0"),
    (
        COUPLED,
        '"a.impact_limit" = { values = [1, 1.5] }',
        'sweep."a.impact_limit"',
        "a whole number >= 0, got 1.5",
    ),
    (
        COUPLED,
        '"connection[2].gain" = { values = [1] }',
        'sweep."connection[2].gain"',
        "has 1 [[connection]]",
    ),
    (COUPLED, '"connection[0].gain" = { values = [1] }', 'sweep."connection[0].gain"', "Indices start at 1"),
    (
        COUPLED,
        '"connection[1].from" = { values = [1] }',
        'sweep."connection[1].from"',
        '"connection[1].gain"',
    ),
    (COUPLED, '"a.mass" = { values = [1], path = "up" }', 'sweep."a.mass".path', '"independent"'),
    (COUPLED, '"a.mass" = { values = [] }', 'sweep."a.mass".values', "an empty array"),
    (COUPLED, '"a.mass" = [1]', 'sweep."a.mass"', "values = [0.6, 0.7]"),
]


@pytest.mark.parametrize(("scene", "entry", "where", "hint"), WRONG_SWEEPS)
def test_a_wrong_sweep_is_one_clear_line(scene: str, entry: str, where: str, hint: str) -> None:
    problem = problem_of(f"{scene}[sweep]\n{entry}\n")
    assert problem.startswith(f"{where}: expected ")
    assert hint in problem
