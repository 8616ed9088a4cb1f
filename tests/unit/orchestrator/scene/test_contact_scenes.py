"""Contacts of general scenes: read, swept, run and reported; mistakes in them; stops with plain connections."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import fmu_factory
from support.command_line import in_this_process

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.campaign.manifest import flat_scene
from vibroimpact.orchestrator.importer.specification import ConnectionSpec, StopContactSpec
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import Scene, parse_scene

CONTACT = """\
[component.mass]
fmu = "Mass.fmi3.fmu"
parameters = { v = 1.0 }
[component.stop]
fmu = "ImpactStop"
parameters = { law = "kelvin_voigt", stiffness = 1e4, position = 0.1 }
[[contact]]
body = "mass"
displacement = "x"
velocity = "v"
force = "f"
mass = 1.0
stop = "stop"
[record]
recorded_time = 0.3
variables = ["mass.x", "mass.v"]
rate = 100
[execution]
macro_step = 1e-2
guard = false
"""
PLAIN = CONTACT.replace(
    CONTACT[CONTACT.index("[[contact]]") : CONTACT.index("[record]")],
    """\
[[connection]]
from = "mass.x"
to = "stop.displacement"
[[connection]]
from = "mass.v"
to = "stop.velocity"
[[connection]]
from = "stop.applied_force"
to = "mass.f"
gain = -1
""",
).replace("1e-2", "1e-3")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the FMU of a mass, in one version with states that can be kept and in one without."""
    for states in (True, False):
        fmu_factory.mass(tmp_path, states=states)
    return tmp_path


def scene_of(folder: Path, text: str) -> Scene:
    return parse_scene(text, str(folder / "s.toml"))


def problems_of(folder: Path, text: str) -> list[str]:
    with pytest.raises(SceneError) as caught:
        scene_of(folder, text)
    return [problem.removeprefix(f"{folder / 's.toml'}: ") for problem in caught.value.problems]


# ---- reading ----


def test_a_contact_is_what_the_importer_is_asked(folder: Path) -> None:
    scene = scene_of(folder, CONTACT)
    assert scene.contacts == (StopContactSpec("mass", "x", "v", "f", "stop", 1.0),)
    assert scene.contacts[0].name == "stop.applied_force -> mass.f"
    assert scene.contacts[0].connections == (
        ConnectionSpec(("mass", "x"), ("stop", "displacement")),
        ConnectionSpec(("mass", "v"), ("stop", "velocity")),
    )
    assert "contacts" in str(flat_scene(scene_of(folder, CONTACT)))
    assert "contacts" not in str(flat_scene(scene_of(folder, PLAIN)))


def test_the_mass_of_a_contact_is_swept(folder: Path) -> None:
    sweep = '[sweep]\n"contact[1].mass" = { values = [0.97, 1.0] }\n[record]'
    scene = scene_of(folder, CONTACT.replace("[record]", sweep).replace("mass = 1.0\n", ""))
    assert scene.value("contact[1].mass") == 0.97
    assert scene.at({"contact[1].mass": 1.0}).contacts[0].mass == 1.0
    assert scene.declared_units["contact[1].mass"] == "kg"
    runner = GeneralRunner(scene)
    steps = []
    for mass in (0.97, 1.0):
        runner.run({"contact[1].mass": mass})
        steps.append(runner._importer.contacts.held[0].mass)
    runner.close()
    assert steps == [0.97, 1.0]
    with pytest.raises(UsageError, match=r"contact\[2\]\.mass: expected a number of a contact"):
        scene.value("contact[2].mass")


MISTAKES = [
    ('body = "mass"', 'body = "mess"', 'contact[1].body: expected a component of this scene, got "mess". '),
    (
        'stop = "stop"',
        'stop = "mass"',
        'contact[1].stop: expected a component other than the body, got "mass".',
    ),
    ('"x"\n', '"y"\n', 'contact[1].displacement: expected an output of Mass.fmi3.fmu, got "y". '),
    (
        '"f"',
        '"load"',
        "contact[1].force: expected an input that is one real number, got the parameter mass.load",
    ),
    ('velocity = "v"', 'velocity = "x"', "contact[1].velocity: expected a variable in m/s, got m (mass.x). "),
    ("mass = 1.0", "mass = 0.0", "contact[1].mass: expected a number > 0, got 0.0."),
    ("macro_step = 1e-2", "", "execution.macro_step: expected a number > 0 where components are connected"),
    (
        'stop = "stop"',
        'stop = "stop"\nside = "upper"',
        'contact[1].side: expected no side beside a stop that has a parameter side, got "upper". '
        'Give it to the component: parameters = { side = "upper" }.',
    ),
    (
        'stop = "stop"',
        'stop = "stop"\nstop_force = "applied_farce"',
        'contact[1].stop_force: expected an output of ImpactStop.fmu, got "applied_farce". Did you mean',
    ),
    (
        "[record]",
        '[[contact]]\nbody = "mass"\ndisplacement = "x"\nvelocity = "v"\nforce = "f"\nstop = "stop"\n[record]',
        'contact[2].stop: expected a stop of its own, got "stop", which contact[1] has already. '
        "Make a component for each contact.",
    ),
    (
        "[record]",
        '[[connection]]\nfrom = "mass.x"\nto = "stop.displacement"\n[record]',
        "contact[1].stop: expected an input that the contact alone feeds, "
        'got "stop.displacement", which connection[1] feeds already. Remove the connection.',
    ),
    (
        "[record]",
        '[sweep]\n"contact[2].mass" = { values = [1.0, 2.0] }\n[record]',
        'sweep."contact[2].mass": expected a number of a contact, got "contact[2].mass". '
        "Indices start at 1 and this scene has 1 [[contact]].",
    ),
    (
        "[record]",
        '[sweep]\n"contact[1].mass" = { values = [1.0, -2.0] }\n[record]',
        'sweep."contact[1].mass": expected a number > 0, got -2.0.',
    ),
]


@pytest.mark.parametrize(("old", "new", "said"), MISTAKES)
def test_a_mistake_in_a_contact_is_told_with_its_way_out(folder: Path, old: str, new: str, said: str) -> None:
    assert old in CONTACT
    assert any(line.startswith(said) for line in problems_of(folder, CONTACT.replace(old, new, 1)))


@pytest.mark.parametrize("law", ['law = "restitution", ', ""])
def test_a_body_that_cannot_go_back_meets_no_rigid_stop(folder: Path, law: str) -> None:
    text = CONTACT.replace("Mass.fmi3", "StatelessMass.fmi3").replace('law = "kelvin_voigt", ', law)
    (problem,) = problems_of(folder, text.replace("stiffness = 1e4, ", ""))
    assert problem.startswith(
        "contact[1].stop: expected a stop that yields, got stop with the law restitution. "
    )
    assert "StatelessMass.fmi3.fmu does not have canGetAndSetFMUState" in problem


def test_a_body_that_cannot_go_back_says_its_mass(folder: Path) -> None:
    text = CONTACT.replace("Mass.fmi3", "StatelessMass.fmi3")
    assert not scene_of(folder, text).is_one_body
    (problem,) = problems_of(folder, text.replace("mass = 1.0\n", ""))
    assert problem == (
        "contact[1].mass: expected the effective mass, a number > 0, got nothing. "
        "StatelessMass.fmi3.fmu does not have canGetAndSetFMUState, and no trial step can find it."
    )


def test_a_stop_that_cannot_be_asked_or_says_no_side_is_refused(folder: Path) -> None:
    fmu_factory.gain(folder)
    text = CONTACT.replace('"ImpactStop"', '"Gain.fmi2.fmu"').replace(
        'parameters = { law = "kelvin_voigt", stiffness = 1e4, position = 0.1 }\n', ""
    )
    text = text.replace('stop = "stop"', 'stop = "stop"\nstop_displacement = "u"\nstop_force = "y"')
    problems = problems_of(folder, text)
    assert problems[0].startswith(
        "contact[1].stop: expected an FMU whose state can be kept and restored, got"
    )
    assert problems[1].startswith('contact[1].side: expected "upper" or "lower", got nothing.')


# ---- running ----


def test_a_run_has_the_residual_of_its_contacts_and_check_reports_them(folder: Path) -> None:
    (folder / "s.toml").write_text(CONTACT)
    checked = in_this_process("check", folder / "s.toml")
    assert "contacts  contact[1] mass.x on stop, force held over a step" in checked.stdout
    assert in_this_process("run", folder / "s.toml", "-o", folder / "s.nc").returncode == 0
    with open_dataset(folder / "s.nc") as dataset:
        assert list(dataset.connection.values) == ["stop.applied_force -> mass.f"]
        assert abs(dataset.energy_residual.values[0]) <= 1e-12
        assert abs(dataset.mass_v.values[-1]) == pytest.approx(1.0, abs=1e-10)
        assert dataset.event_time.values == pytest.approx([0.1], abs=1e-12)
        assert dataset.message.item() == ""
        assert dataset.mass.item() == 1.0
        assert dataset.mass.attrs["units"] == "kg"


@pytest.mark.parametrize("states", [True, False], ids=["states", "no states"])
def test_a_stop_that_is_connected_plainly_says_what_it_adds(folder: Path, states: bool) -> None:
    text = PLAIN if states else PLAIN.replace("Mass.fmi3", "StatelessMass.fmi3")
    runner = GeneralRunner(scene_of(folder, text))
    record = runner.run({})
    runner.close()
    assert record.samples is not None
    gained = 0.5 * (record.samples[-1, 2] ** 2 - 1.0)
    assert 0.05 < gained < 0.2  # of 0.5 J, with 31 steps
    assert record.energy_residual == pytest.approx([gained], rel=1e-9)
    assert record.message.startswith(
        "stop.applied_force -> mass.f: the force of a stop by a plain connection has added 0."
    )
    assert 'Use [[contact]] with body = "mass" and stop = "stop"' in record.message


def test_a_plain_stop_of_another_tool_is_known_by_its_force(folder: Path) -> None:
    fmu_factory.buffer(folder)
    text = PLAIN.replace('"ImpactStop"', '"Buffer.fmi3.fmu"').replace("stop.displacement", "stop.d")
    text = text.replace("stop.velocity", "stop.u").replace("stop.applied_force", "stop.push")
    text = text.replace('{ law = "kelvin_voigt", stiffness = 1e4, position = 0.1 }', "{ gap = 0.1 }")
    runner = GeneralRunner(scene_of(folder, text))
    message = runner.run({}).message
    runner.close()
    assert message.startswith("stop.push -> mass.f: a force that begins and ends, as a stop's, by a plain ")
    assert "at about 31 steps a contact it adds about 0.16 of the energy of each. Use [[contact]]" in message


def test_a_plain_connection_that_never_touches_says_nothing(folder: Path) -> None:
    runner = GeneralRunner(scene_of(folder, PLAIN.replace("position = 0.1", "position = 10.0")))
    record = runner.run({})
    runner.close()
    assert record.message == ""
    assert record.energy_residual == pytest.approx([0.0])


@pytest.mark.parametrize("states", [True, False], ids=["states", "no states"])
def test_a_law_that_a_sweep_makes_rigid_is_an_impulse_or_an_error_of_its_point(
    folder: Path, states: bool
) -> None:
    sweep = '[sweep]\n"stop.law" = { values = [1, 2] }\n[record]'
    text = CONTACT.replace("[record]", sweep).replace('law = "kelvin_voigt", ', "restitution = 0.5, ")
    (folder / "s.toml").write_text(text if states else text.replace("Mass.fmi3", "StatelessMass.fmi3"))
    done = in_this_process("run", folder / "s.toml", "-o", folder / "s.nc")
    refused = "mass: expected a body that can save its state" in done.stdout + done.stderr
    assert refused == (not states)
    with open_dataset(folder / "s.nc") as dataset:
        assert int((dataset.outcome == 0).sum()) == (2 if states else 1)
        if states:
            ends = dataset["mass_v"].values.reshape(2, -1)[:, -1]
            assert ends == pytest.approx([-0.5, -1.0], rel=1e-9)
