"""Errors keep their message and their facts on the way from one process to another."""

import pickle

from vibroimpact.fmus.errors import ComponentError, SceneError


def test_a_scene_error_keeps_its_problems_between_processes() -> None:
    error = SceneError(
        ["a.toml: body.mass: expected a number > 0, got 0.", "a.toml: stop: expected a table."]
    )
    copy = pickle.loads(pickle.dumps(error))
    assert copy.problems == error.problems
    assert str(copy) == str(error)


def test_a_component_error_keeps_its_facts_between_processes() -> None:
    error = ComponentError("body: broken", instance="body", function="fmi3DoStep", time=0.5, log=["one"])
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == "body: broken"
    assert (copy.instance, copy.function, copy.time, copy.log) == ("body", "fmi3DoStep", 0.5, ("one",))
