"""FMUs that lie about their capabilities: the values of an honest description, or the lie in words.

A case changes flags of a fake FMU whose neglect has an effect. A run that differs from that of the honest description
must say so, in a message or in an error that names the component. `INVISIBLE` lists the lies that no importer can see.
"""

from __future__ import annotations

import json
import math
import random
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from support import fmu_factory

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.fmi.capabilities import CO_SIMULATION, FLAGS, MODEL_EXCHANGE
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene

Tables = dict[str, Any]
Write = Callable[[Path, str], Path]

ONE_SIZE = 'canHandleVariableCommunicationStepSize="false"'
ANY_SIZE = 'canHandleVariableCommunicationStepSize="true"'
COUNTS = ("maxOutputDerivativeOrder", "recommendedIntermediateInputSmoothness")
NUMBERS = {
    "fixedInternalStepSize": ("0.001", "0.0123", "1e-9", "1e9", "0", "-1", "NaN", "INF"),
    **dict.fromkeys(COUNTS, ("0", "1", "7", "1000000000", "-1")),
}
CLOCKS = ("constant", "fixed", "tunable", "changing", "countdown", "triggered")
DESCRIPTIONS = 3000
"""Number of different descriptions: a process keeps the library of each. The scenes around them all differ."""
LONGEST = 0.6
"""Recorded time, s."""


@dataclass(frozen=True, slots=True)
class Subject:
    """A fake FMU.

    Attributes
    ----------
    write : callable
        Writes it into a folder, for a version of FMI.
    versions : tuple of str
        Versions of FMI in which it exists.
    owner : str
        Its interface.
    outputs : tuple of str
        The values that are compared.
    parameters : tuple of mappings
        Its start values; one of the mappings is drawn.
    honest : tuple of (str, str)
        Replacements that make its description honest.
    invisible : tuple of (str, str)
        Lies that no importer can see: a flag and its value.
    close : float
        Largest difference of a value from that of the honest description.
    bounce : float
        Instant, s, at which a sample may have the values before or after; NaN: none.
    in_loop : bool
        Its input `u` is half its output `y`.
    """

    write: Write
    versions: tuple[str, ...]
    owner: str
    outputs: tuple[str, ...]
    parameters: tuple[dict[str, float], ...] = ({},)
    honest: tuple[tuple[str, str], ...] = ()
    invisible: tuple[tuple[str, str], ...] = ()
    close: float = 1e-9
    bounce: float = math.nan
    in_loop: bool = False


BOTH = ("2.0", "3.0")
MASS = {"v": 1.0, "k": 4.0}
SUBJECTS = {
    "mass": Subject(fmu_factory.mass, BOTH, CO_SIMULATION, ("x", "v"), (MASS,)),
    "stateless": Subject(
        lambda folder, fmi: fmu_factory.mass(folder, fmi, states=False),
        BOTH,
        CO_SIMULATION,
        ("x", "v"),
        (MASS,),
    ),
    # each of its steps has the size of the first, whatever it is told
    "one size": Subject(
        *(
            fmu_factory.mass,
            BOTH,
            CO_SIMULATION,
            ("x", "v"),
            ({**MASS, "scheme": 5.0},),
            ((ANY_SIZE, ONE_SIZE),),
        ),
        invisible=(("canHandleVariableCommunicationStepSize", "true"),),
    ),
    "ball": Subject(fmu_factory.stepped_ball, BOTH, CO_SIMULATION, ("h", "v"), bounce=0.453),
    "sum": Subject(fmu_factory.faulty, BOTH, CO_SIMULATION, ("y",)),
    "pending": Subject(
        *(fmu_factory.faulty, ("2.0",), CO_SIMULATION, ("y",), ({"fault": 32, "fault_time": 0.3},)),
        honest=(("<CoSimulation ", '<CoSimulation canRunAsynchronuously="true" '),),
    ),
    "updating": Subject(
        lambda folder, _: fmu_factory.updating_mass(folder), ("3.0",), CO_SIMULATION, ("x", "v"), (MASS,)
    ),
    "clocks": Subject(
        lambda folder, _: fmu_factory.timed(folder),
        ("3.0",),
        CO_SIMULATION,
        ("beats", "strides", "fuses", "sum"),
    ),
    # its loop with a gain is solved by derivatives, which are false by `lie`
    "loop": Subject(
        *(fmu_factory.feedthrough, BOTH, CO_SIMULATION, ("y",)),
        tuple({"law": float(law), "lie": lie} for law in (0, 1, 2) for lie in (0.0, 0.5)),
        in_loop=True,
    ),
    "exchanged": Subject(
        *(fmu_factory.exchanged, BOTH, MODEL_EXCHANGE, ("x", "v", "count")),
        tuple({"kind": float(kind)} for kind in (0, 1, 2)),
        close=1e-4,
    ),
    # it stops where a completed step lies beyond x = `at`
    "completed": Subject(
        *(fmu_factory.exchanged, BOTH, MODEL_EXCHANGE, ("x",), ({"kind": 3.0, "x": 0.1, "v": 1.0},)),
        close=0.1,  # the solver's steps decide where it stops
        invisible=(("needsCompletedIntegratorStep", "false"), ("completedIntegratorStepNotNeeded", "true")),
    ),
}


_OTHER = {CO_SIMULATION: MODEL_EXCHANGE, MODEL_EXCHANGE: CO_SIMULATION}


def told(seed: int) -> str | None:
    """Return the problem of the lies of a seed; None without one."""
    draw = random.Random(seed % DESCRIPTIONS)
    name = draw.choice(sorted(SUBJECTS))
    subject = SUBJECTS[name]
    fmi = draw.choice(subject.versions)
    folder = Path.cwd()
    honest = _described(
        subject.write(folder, fmi), folder / "honest.fmu", dict(subject.honest), {}, subject.owner
    )
    lies = _lies(draw, subject.owner, fmi)
    texts = _false_clocks(draw) if name == "clocks" and draw.random() < 0.5 else {}
    if draw.random() < 0.03:  # a kind that the binary does not have
        texts[f"<{subject.owner}"] = f"<{_OTHER[subject.owner]}"
    _described(honest, folder / "lying.fmu", texts, lies, subject.owner)
    draw = random.Random(seed)
    scene = _scene(draw, subject, folder)
    guarded, again = draw.random() < 0.02, draw.random() < 0.1
    truth = _outcome(
        scene | {"component": scene["component"] | {"m": scene["component"]["m"] | {"fmu": "honest.fmu"}}}
    )
    got = _outcome(scene, guarded=guarded, again=again)
    problem = _judged(subject, truth, got, {**lies, **texts})
    return (
        None
        if problem is None
        else f"{name} {fmi} {json.dumps(lies | texts)} in {json.dumps(scene)}: {problem}"
    )


# ---- descriptions ----


def _lies(draw: random.Random, owner: str, fmi: str) -> dict[str, str]:
    """Return false values of some flags of an interface; now and then of a flag of the other version."""
    flags = [f.name for f in FLAGS if f.owner == owner and (fmi in f.versions or draw.random() < 0.1)]
    chosen = draw.sample(flags, min(len(flags), draw.choice((1, 1, 1, 2, 3, 6))))
    return {name: draw.choice(NUMBERS.get(name, ("true", "false"))) for name in chosen}


def _false_clocks(draw: random.Random) -> dict[str, str]:
    true = draw.choice(CLOCKS[2:])
    return {
        f'intervalVariability="{true}"': f'intervalVariability="{draw.choice(CLOCKS)}" intervalDecimal="0.1"'
    }


def _described(source: Path, target: Path, texts: dict[str, str], flags: dict[str, str], owner: str) -> Path:
    """Write an FMU with replaced texts, and with flags of its interface."""
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w") as changed:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                text = content.decode()
                for flag, value in flags.items():
                    text = re.sub(rf'(<{owner}\b[^>]*?) {flag}="[^"]*"', r"\1", text)
                    text = text.replace(f"<{owner}", f'<{owner} {flag}="{value}"', 1)
                for old, new in texts.items():
                    text = text.replace(old, new, 1)
                content = text.encode()
            changed.writestr(
                zipfile.ZipInfo(name), content
            )  # without the time: equal files are unpacked once
    return target


# ---- runs ----


def _scene(draw: random.Random, subject: Subject, folder: Path) -> Tables:
    macro_step = draw.choice((0.01, 0.02, 0.0125, 0.1, 0.3))
    rate = 1.0 / (macro_step * draw.choice((1.0, 1.0, 0.5, 0.3, 2.0)))
    components: Tables = {"m": {"fmu": "lying.fmu", "parameters": draw.choice(subject.parameters)}}
    match draw.randrange(4):
        case 0:
            components["ball"] = {"fmu": fmu_factory.stepped_ball(folder).name}
        case 1:
            components["c"] = {"fmu": fmu_factory.clocked(folder).name, "parameters": {"interval": 0.07}}
        case 2:
            components["y"] = {"fmu": fmu_factory.faulty(folder, draw.choice(BOTH)).name}
        case _:
            pass
    links = [{"from": "m.y", "to": "g.u"}, {"from": "g.y", "to": "m.u"}] if subject.in_loop else []
    if links:
        components["g"] = {"fmu": fmu_factory.gain(folder).name, "parameters": {"k": 0.5, "b": 0.1}}
    return {
        "scene": {"units": "SI"},
        "component": components,
        "connection": links,
        "record": {
            "recorded_time": LONGEST,
            "transient_time": draw.choice((0.0, 0.0, 0.1, 0.033)),
            "rate": rate,
            "variables": [f"m.{output}" for output in subject.outputs],
        },
        "execution": {
            "macro_step": macro_step,
            "exchange": draw.choice(("jacobi", "gauss_seidel", "iterated")),
            "deadline": 20.0,
        },
    }


def _outcome(tables: Tables, *, guarded: bool = False, again: bool = False) -> RunRecord | str:
    """Return the record of a run, or the words of an error; a run that is made again must be the same."""
    try:
        scene = Scene.from_dict(tables, str(Path.cwd() / "scene.toml"))
        runner = open_scene(scene) if guarded else GeneralRunner(scene)
        try:
            first = runner.run({})
            second = runner.run({}) if again else first
        finally:
            runner.close()
    except VibroimpactError as error:
        return str(error)
    if first.samples is None or second.samples is None:
        return first
    same = first.samples.tobytes() == second.samples.tobytes()
    return first if same else "the second run differs from the first"


def _judged(
    subject: Subject, truth: RunRecord | str, got: RunRecord | str, lies: dict[str, str]
) -> str | None:
    if isinstance(truth, str):
        return f"the honest description is refused: {truth}"
    if isinstance(got, str):
        return (
            None
            if re.search(r"\bm\b|lying\.fmu", got)
            else f"an error that does not name the component: {got}"
        )
    if got.outcome is not Outcome.ok:
        return None if "m" in got.message else f"{got.outcome.name}: {got.message}"
    is_unseen = any(lies.get(flag) == value for flag, value in subject.invisible)
    assert truth.samples is not None
    assert got.samples is not None
    off = np.inf
    if truth.samples.shape == got.samples.shape:
        is_clear = ~(np.abs(truth.samples[:, 0] - subject.bounce) < 1e-9)
        off = float(np.abs(truth.samples - got.samples)[is_clear].max(initial=0.0))
    new = set(got.message.split("; ")) - set(truth.message.split("; "))
    if off <= subject.close or is_unseen or any(re.search(r"\bm\b", remark) for remark in new):
        return None
    return f"values off by {off:.2g}, and no word but {got.message!r}"
