"""Trials of one file: our run, FMPy's run, a system; each result is a dictionary of facts."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from fmpy import read_model_description, simulate_fmu

import vibroimpact as vi
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.dataset.naming import file_names
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.model_description import Grade
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.component_facts import NUMERIC_KINDS, component_facts
from vibroimpact.orchestrator.ssp import load_system
from vibroimpact.orchestrator.ssp.importing import Imported

STEPS = 500
"""Steps of an experiment whose FMU proposes none."""
MOST_STEPS = 1000
"""Most steps: a longer experiment ends early."""
MOST_OUTPUTS = 100
NOT_GIVEN = {"record.recorded_time": 1.0, "execution.macro_step": 1e-3}
"""End and step of a system that gives none, s."""
KINDS = {"CoSimulation", "ModelExchange", "ScheduledExecution"}

Facts = dict[str, Any]


def facts(path: Path) -> Facts:
    """Return the tool, the version and the kinds that a description names, and what `fmu check` finds."""
    root = _root(path)
    tags = {element.tag for element in root}
    fmi1 = root.get("fmiVersion") == "1.0"
    kinds = (set() if "Implementation" in tags else {"ModelExchange"}) if fmi1 else KINDS & tags
    return {
        "tool": root.get("generationTool") or "",
        "fmi": root.get("fmiVersion") or "",
        "kinds": sorted(kinds),
        "refused": [finding.text for finding in check_fmu(path) if finding.grade is Grade.refused],
    }


def ours(path: Path) -> Facts:
    """Return time and outputs of our run of a scene of one component."""
    plan = _plan(path)
    variables = [f"x.{name}" for name in plan["outputs"]]
    component: Facts = {"fmu": str(path)}
    if plan["tolerance"]:
        component["tolerance"] = plan["tolerance"]
    record: Facts = {"recorded_time": plan["end"]}
    if variables:
        record |= {"variables": variables, "rate": 1.0 / plan["step"]}
    tables = {
        "component": {"x": component},
        "record": record,
        "execution": {"macro_step": plan["step"], "guard": False},
    }
    data = vi.run(Scene.from_dict(tables))
    if data.outcome.item():
        return {"refusal": str(data.message.item())}
    if not variables:
        return {"time": np.array([]), "values": {}}
    samples = data.vibroimpact.samples()
    stored = zip(plan["outputs"], file_names(variables), strict=True)
    values = {name: samples[in_file].values for name, in_file in stored}
    return {"time": samples.time.values, "values": values}


def fmpy(path: Path) -> Facts:
    """Return time and outputs of FMPy's run with the same steps and tolerance."""
    description, plan = read_model_description(str(path), validate=False), _plan(path)
    simulation = description.coSimulation
    rows = simulate_fmu(
        str(path),
        validate=False,
        start_time=0.0,
        stop_time=plan["end"],
        step_size=plan["step"],
        output_interval=plan["step"],
        relative_tolerance=plan["tolerance"],
        output=plan["outputs"],
        fmi_type="ModelExchange" if simulation is None else "CoSimulation",
        use_event_mode=bool(getattr(simulation, "hasEventMode", False)),
        early_return_allowed=description.fmiVersion.startswith("3") and simulation is not None,
    )
    plain = np.asarray(rows)
    return {"time": plain["time"], "values": {name: plain[name].astype(float) for name in plan["outputs"]}}


def system(path: Path) -> Facts:
    """Return the remarks on a system and the number of its components, after it has run."""
    imported = _opened(path)
    folder = Path(path.parent, f"{path.name}.run")
    folder.mkdir(exist_ok=True)
    run_scene(imported.scene, folder / "run.nc")
    data = open_dataset(folder / "run.nc")
    if data.outcome.values.any():
        return {"refusal": str(data.message.values.flat[0])}
    return {"components": len(imported.scene.components), "notes": list(imported.notes)}


def _opened(path: Path) -> Imported:
    """Return a system as a scene; what it does not give is taken from `NOT_GIVEN`."""
    changes: list[str] = []
    while True:
        try:
            return load_system(path, changes)
        except VibroimpactError as error:
            left = [key for key in NOT_GIVEN if f"{key}={NOT_GIVEN[key]}" not in changes]
            missing = next((key for key in left if key.partition(".")[2] in str(error)), None)
            if missing is None:
                raise
            changes.append(f"{missing}={NOT_GIVEN[missing]}")


ROLES: dict[str, Callable[[Path], Facts]] = {"ours": ours, "fmpy": fmpy, "system": system}


def _root(path: Path) -> ElementTree.Element:
    with zipfile.ZipFile(path) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def _plan(path: Path) -> Facts:
    """Return end, step, tolerance and recorded outputs of an experiment that begins at 0; locals without outputs."""
    root = _root(path)
    experiment = root.find("DefaultExperiment")
    given = {} if experiment is None else {name: float(text) for name, text in experiment.attrib.items()}
    length = given.get("stopTime", 1.0) - given.get("startTime", 0.0)
    length = length if 0.0 < length < math.inf else 1.0
    fixed = next((float(e.get("fixedInternalStepSize", 0)) for e in root if e.tag == "CoSimulation"), 0.0)
    step = fixed or given.get("stepSize") or length / STEPS
    count = max(1, min(MOST_STEPS, round(length / step)))
    variables = component_facts(path).variables.items()
    numbers = [(name, one.causality) for name, one in variables if one.scalar and one.kind in NUMERIC_KINDS]
    outputs = [name for name, causality in numbers if causality == "output"]
    outputs = outputs or [name for name, causality in numbers if causality == "local"]
    return {
        "end": count * step,
        "step": step,
        "tolerance": given.get("tolerance"),
        "outputs": outputs[:MOST_OUTPUTS],
    }


def made(role: str, path: Path) -> Iterator[tuple[str, Facts]]:
    """Yield the results of a trial: `first` the facts of a description, then `result`, perhaps with a refusal."""
    found = facts(path) if role == "ours" and zipfile.is_zipfile(path) else {}
    yield "first", found
    try:
        found |= ROLES[role](path)
    except VibroimpactError as error:
        found["refusal"] = str(error).splitlines()[0]
    except Exception as error:
        if role != "fmpy":
            raise
        found["refusal"] = f"{type(error).__name__}: {error}"
    yield "result", found
