"""Lean descriptions of both versions avoid the known faults of tools that cannot be tried here."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import simulate_fmu
from support.component_fmu import VERSIONS, ComponentFmu
from support.exports import exported

from vibroimpact.fmus import components
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.fmpy_door import read_description

STEPS = 200
#: Stops that the body touches at the start, where a force decides whether it rests.
TOUCHING = {"contact[1].law": "restitution", "contact[1].restitution": 0.5}
YIELDING = {"contact[1].law": "kelvin_voigt", "contact[1].stiffness": 10.0}


@pytest.fixture(scope="module", params=[(n, f) for n in components() for f in VERSIONS], ids=str)
def lean(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    name, fmi = request.param
    return exported(name, tmp_path_factory.mktemp(name) / "lean.fmu", fmi=fmi)


def test_the_description_has_no_nan_no_array_and_no_enumeration(lean: Path) -> None:
    root = ElementTree.parse(unpack(lean).folder / "modelDescription.xml").getroot()
    stumbling = {"Dimension", "Enumeration", "EnumerationType", "SimpleType"}
    assert not stumbling & {element.tag for element in root.iter()}
    assert not [e.attrib for e in root.iter() if {"NaN", "INF", "-INF"} & set(e.attrib.values())]
    for element in root.iter():
        for key in ("min", "max", "start", "nominal"):
            text = element.get(key, "0")
            assert text in {"true", "false"} or math.isfinite(float(text)), element.attrib


def test_every_unknown_names_what_it_depends_on_and_only_what_is_there(lean: Path) -> None:
    description = read_description(lean)
    outputs = {v.name for v in description.modelVariables if v.causality == "output"}
    assert {unknown.variable.name for unknown in description.outputs} == outputs
    derivatives = {unknown.variable.name for unknown in description.derivatives}
    states = {unknown.variable.derivative.name for unknown in description.derivatives}
    assert {unknown.variable.name for unknown in description.initialUnknowns} == outputs | derivatives
    for unknown in (*description.outputs, *description.derivatives, *description.initialUnknowns):
        assert unknown.dependencies is not None, unknown.variable.name
        for known in unknown.dependencies:
            of_input = known.causality in {"input", "parameter"}
            assert of_input or known.name in states, unknown.variable.name


def test_a_default_run_gives_numbers_and_no_warning(lean: Path) -> None:
    logged: list[tuple[int, str]] = []
    experiment = read_description(lean).defaultExperiment
    start, step = float(experiment.startTime), float(experiment.stepSize)
    result = simulate_fmu(
        str(lean),
        fmi_type="CoSimulation",
        start_time=start,
        stop_time=min(float(experiment.stopTime), start + STEPS * step),
        step_size=step,
        output_interval=step,
        debug_logging=True,
        # environment and, in FMI 2.0, the instance name come first
        logger=lambda *arguments: logged.append((int(arguments[-3]), str(arguments[-1]))),
    )
    assert not [text for level, text in logged if level >= 1]
    assert all(np.isfinite(np.asarray(result[name], float)).all() for name in result.dtype.names)
    assert len(result) > 2


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize(
    ("name", "starts"),
    [("Oscillator", TOUCHING), ("Oscillator", YIELDING), ("Chain", TOUCHING), ("Beam", YIELDING)],
)
def test_an_output_that_follows_an_input_at_the_start_says_so(
    tmp_path: Path, name: str, starts: dict[str, float | str], fmi: str
) -> None:
    path = exported(name, tmp_path / "x.fmu", fmi=fmi, starts=starts)
    description = read_description(path)
    variables = description.modelVariables
    outputs = [v.name for v in variables if v.causality == "output"]
    inputs = [v.name for v in variables if v.causality == "input"]
    knowns = {u.variable.name: {k.name for k in u.dependencies} for u in description.initialUnknowns}

    def started(values: dict[str, float]) -> dict[str, float]:
        with ComponentFmu(path, values, version=fmi) as fmu:
            return {output: fmu.get(output) for output in outputs}

    plain, seen = started({}), 0
    for known in inputs:
        for value in (1.0, -1.0):
            changed = started({known: value})
            for output in outputs:
                if changed[output] != plain[output]:
                    seen += 1
                    assert known in knowns[output], f"{output} follows {known}"
    assert seen
