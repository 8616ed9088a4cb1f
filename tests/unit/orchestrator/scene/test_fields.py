"""A field of a scene is defined once: all uses of it agree with the FMUs and the reference page."""

from __future__ import annotations

import re
from runpy import run_path

import pytest
from pydantic import BaseModel
from support.places import ROOT

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.units import agree, si_unit
from vibroimpact.orchestrator.scene import (
    Scene,
    forcing_models,
    models,
    parse_scene,
)
from vibroimpact.orchestrator.scene.body_models import (
    BeamBody,
    ChainBody,
    OscillatorBody,
    Rayleigh,
    StructureBody,
)
from vibroimpact.orchestrator.scene.component_facts import component_facts
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import bounds_of, field_of, known_keys, rule_of

KEY_TABLES = run_path(str(ROOT / "docs" / "site" / "key_tables.py"))
#: Models with keys of their own.
MODELS: set[type[BaseModel]] = {
    found
    for found in KEY_TABLES["models_of_tables"]().values()
    if found is not StructureBody
    if found.model_fields.keys()
    > {key for base in found.__bases__ for key in getattr(base, "model_fields", ())}
}
BODIES = {"Oscillator": (OscillatorBody,), "Chain": (ChainBody,), "Beam": (BeamBody, Rayleigh)}
BEAM = """
[body]
kind = "beam"
length = 1
flexural_rigidity = 1
mass_per_length = 1
[[stop]]
law = "hunt_crossley"
position = 1
stiffness = 1
[record]
recorded_time = 1
"""


@pytest.fixture(scope="module")
def beam() -> Scene:
    return parse_scene(BEAM, "beam.toml")


def test_the_tables_of_the_reference_are_those_of_the_fields() -> None:
    for path in KEY_TABLES["PAGES"]:
        page = path.read_text(encoding="utf-8")
        assert KEY_TABLES["with_key_tables"](page) == page, "Run `python docs/site/key_tables.py`."


def test_the_reference_has_a_table_for_every_model() -> None:
    pages = [path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "scene").glob("*.md")]
    pages.append((ROOT / "docs" / "scene.md").read_text(encoding="utf-8"))
    within = {
        "Rayleigh",
        "TimeSeries",
        "Compared",
        "AdaptiveTable",
        "Origin",
    }  # described in the rows of the tables that have them
    assert (
        set(re.findall(r"<!-- keys of (\w+) -->", "".join(pages)))
        == {model.__name__ for model in MODELS} - within
    )


@pytest.mark.parametrize("fmu", BODIES)
def test_the_fmu_has_the_variable_of_each_field_in_the_same_unit(fmu: str) -> None:
    variables = component_facts(fmu_path(fmu, "3.0")).variables
    for model in (*BODIES[fmu], forcing_models.Forcing):
        for key in known_keys(model):
            rule = rule_of(field_of(model, key))
            if rule.fmu:
                variable = variables[rule.fmu.replace("[i]", "[1]")]
                unit = si_unit(rule.unit.replace("^", ""))
                assert variable.causality == "parameter"
                assert variable.unit is None or agree(variable.unit, unit), (key, variable.unit, rule.unit)


@pytest.mark.parametrize("model", sorted(MODELS, key=lambda model: model.__name__))
def test_every_field_says_what_it_expects(model: type[BaseModel]) -> None:
    rules = [rule_of(field) for field in model.model_fields.values()]
    assert all(rule.expected and "inf" not in rule.expected.replace("finite", "") for rule in rules)


@pytest.mark.parametrize(
    ("key", "expected", "item"),
    [
        ("mass", "a number > 0", ""),
        ("damping_ratio", "a number >= 0, or an array of them", "a number >= 0"),
        ("location", "a number from 0 to 1", ""),
        ("velocity_start", "an array of finite numbers", "a finite number"),
        ("modes", 'a whole number from 1 to 64, or "auto"', ""),
        ("side", '"upper" or "lower"', ""),
        ("exchange", '"jacobi", "gauss_seidel" or "iterated"', ""),
        ("guard", "true or false", ""),
    ],
)
def test_constraints_are_said_in_words(key: str, expected: str, item: str) -> None:
    order = (BeamBody, OscillatorBody, models.StopTable, Execution)
    model = next(model for model in order if key in known_keys(model))
    rule = rule_of(field_of(model, key))
    assert (rule.expected, rule.item) == (expected, item)


@pytest.mark.parametrize(
    ("key", "bounds"),
    [
        ("body.length", (0.0, float("inf"))),
        ("body.damping_ratio", (0.0, float("inf"))),
        ("body.frequency_slope", (-float("inf"), float("inf"))),
        ("stop[1].location", (0.0, 1.0)),
        ("stop[1].exponent", (1.0, 10.0)),
    ],
)
def test_a_number_is_fitted_within_what_a_scene_accepts(
    beam: Scene, key: str, bounds: tuple[float, float]
) -> None:
    found = bounds_of(beam.field(key))
    assert (found.low, found.high) == bounds


@pytest.mark.parametrize("key", ["forcing.amplitude", "stop[1].restitution", "stop[2].position", "body.mass"])
def test_a_key_that_a_scene_does_not_have_has_no_field(beam: Scene, key: str) -> None:
    with pytest.raises(UsageError, match=re.escape(f"beam.toml: {key}: expected a key of this scene")):
        beam.field(key)
