"""Effects that are not modelled are refused by name, in one line, wherever their words stand in a scene."""

from __future__ import annotations

import re

import pytest
from support.places import ROOT

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import load_scene, parse_scene
from vibroimpact.orchestrator.scene.component_models import ComponentTable
from vibroimpact.orchestrator.scene.fields import choices_of, known_keys
from vibroimpact.orchestrator.scene.keys import _MODELS as MODELS
from vibroimpact.orchestrator.scene.models import Record, SceneHeader
from vibroimpact.orchestrator.scene.not_modelled import effect_not_modelled

TURNING, VARYING, LARGE = (
    "direction turns, as in rotor rub",
    "varies in time, as in Mathieu",
    "Large deflections",
)
FRICTION, NONLINEAR = "Friction is not", "dashpots that are not linear"
PLAIN = "[body]\nmass = 1\nstiffness = 4\n{}\n[record]\nrecorded_time = 5\n{}"


def refused(text: str) -> str:
    with pytest.raises(SceneError) as error:
        parse_scene(text, "a.toml")
    (line,) = error.value.problems
    return str(line)


@pytest.mark.parametrize(
    ("body", "tables", "where", "effect"),
    [
        ("stiffness_amplitude = 0.1", "", "body.stiffness_amplitude", VARYING),
        ("stiffness-angular-frequency = 2.0", "", "body.stiffness-angular-frequency", VARYING),
        ("cubic_stiffness = 0.1", "", "body.cubic_stiffness", NONLINEAR),
        ('geometry = "large"', "", "body.geometry", LARGE),
        ('kind = "rotor"', "", "body.kind", TURNING),
        ('kind = "pendulum"', "", "body.kind", LARGE),
        ("", "[[stop]]\nposition = 1\nrestitution = 1\nnormal = [1, 0]", "stop[1].normal", TURNING),
        ("", "[[stop]]\nposition = 1\nrestitution = 1\nfriction = 0.1", "stop[1].friction", FRICTION),
        ("", '[[stop]]\nposition = 1\nlaw = "coulomb"', "stop[1].law", FRICTION),
        ("", "[rotor]\nspeed = 3", "rotor", TURNING),
        ("", "[[friction]]\ncoefficient = 3", "friction", FRICTION),
        ("", '[forcing]\nkind = "parametric"\namplitude = 1\nangular_frequency = 0', "forcing.kind", VARYING),
        ("", '[sweep]\n"body.duffing" = { values = [1, 2] }', 'sweep."body.duffing"', NONLINEAR),
    ],
)
def test_a_word_for_an_effect_is_one_line_with_its_name(
    body: str, tables: str, where: str, effect: str
) -> None:
    line = refused(PLAIN.format(body, tables))
    assert line.startswith(f"a.toml: {where}: expected ")
    assert effect in line
    assert "not modelled" in line
    assert "Did you mean" not in line


def test_among_several_bodies_the_words_are_refused_alike() -> None:
    example = ROOT / "examples" / "vibro_impact_absorber.toml"
    with pytest.raises(SceneError) as error:
        load_scene(example, ["body[2].hardening=1", "contact[1].friction=0.1", "contact[2].direction=2"])
    found = [str(line) for line in error.value.problems]
    assert [line.partition(": expected")[0] for line in found] == [
        "--set: body[2].hardening",
        "--set: contact[1].friction",
        "--set: contact[2].direction",
    ]
    assert [effect in line for effect, line in zip((NONLINEAR, FRICTION, TURNING), found, strict=True)] == [
        True
    ] * 3


def test_no_key_and_no_kind_of_a_scene_is_such_a_word() -> None:
    tables = {name: list(models) for name, models in MODELS.items()}
    tables |= {"record": [Record], "scene": [SceneHeader], "component": [ComponentTable]}
    words = {
        (table, str(word))
        for table, models in tables.items()
        for model in models
        for key in known_keys(model)
        for word in (
            key,
            *choices_of(next(f for n, f in model.model_fields.items() if key in (f.alias, n)).annotation),
        )
    }
    assert len(words) > 150
    assert [word for word in sorted(words) if effect_not_modelled(*word)] == []


def test_each_word_of_the_page_is_refused() -> None:
    page = (ROOT / "docs" / "scene.md").read_text(encoding="utf-8")
    rows = page.partition("| effect | words |")[2].partition("\n\n")[0].splitlines()[2:]
    words = [(row, word) for row in rows for word in re.findall(r"`(\w+)`", row.split("|")[2])]
    assert len(words) == 18
    for row, word in words:
        assert effect_not_modelled("stop", word), row
