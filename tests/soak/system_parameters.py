"""Unknown parameters of SSP systems: misspelt, wildcards, of other elements, twice: each is reported or refused.

A system of up to three bodies, some in a system of its own, gets parameters at every level. An own model predicts
the variable of each parameter. The scene has exactly the predicted values, and all other names are in the notes.
"""

from __future__ import annotations

import functools
import random
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from support.ssp_files import archive, component, connector, entry, mapping, real, ssd, system, values

from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.orchestrator.ssp import load_system
from vibroimpact.orchestrator.ssp.importing import MOST_NAMED

CASES, SAMPLE = 3000, 4
SECONDS = 30.0

SETTABLE = ("mass", "stiffness", "damping", "displacement_start")
NOBODYS = (
    "mas",
    "Mass",
    "no such",
    "velocity",
    "*",
    "m*",
    "mass?",
    "mass ",
    "contact[9].position",
    "mass.mass",
    "ä",
    ".",
)
"""Names of no settable variable of a body."""
SAID = "parameters of no variable, which were left out: "


@functools.cache
def body_fmu() -> bytes:
    """Return an FMU of a body without a mark of this package."""
    return export_fmu("oscillator", Path.cwd() / "body.fmu", fmi="2.0").read_bytes()


def check(seed: int) -> str | None:
    """Return a parameter of the system of this seed that is assigned wrongly, or dropped without a note."""
    draw = random.Random(seed)
    names, rig = draw.sample(["a", "b", "c.d"], draw.randrange(1, 4)), draw.choice(("", "", "rig."))
    taken: dict[str, float] = {}
    lost: list[str] = []
    is_doubled, elements = False, ""
    for name in names:
        bindings, doubled = _bindings(draw, [*SETTABLE, *NOBODYS], f"{rig}{name}.", names, rig, taken, lost)
        is_doubled = is_doubled or doubled
        if draw.random() < 0.2:
            renamed = mapping(entry("weight", "mass"), entry("wieght", "stiffness"))
            bindings += values({"weight": real(7.0)}, mapping=renamed)
            taken[f"{rig}{name}.mass"] = 7.0
            lost.append(f"{rig}{name}.wieght")
        elements += component(name, "resources/body.fmu", connector("displacement", "output"), bindings)
    if rig:
        elements = system("rig", elements)
    inside = [f"{rig}{name}.{key}" for name in names for key in (*SETTABLE, *NOBODYS)]
    # the outer system's values take precedence over those of the components
    outer, doubled = _bindings(draw, [*inside, "*", "x.mass", "rig", "mass"], "", names, rig, taken, lost)
    description = ssd(elements, bindings=outer)
    path = archive(Path.cwd() / "system.ssp", description, {"resources/body.fmu": body_fmu()})
    return _problem(path, taken, lost, is_doubled=is_doubled or doubled)


def _bindings(
    draw: random.Random,
    known: Sequence[str],
    prefix: str,
    names: Sequence[str],
    rig: str,
    taken: dict[str, float],
    lost: list[str],
) -> tuple[str, bool]:
    """Return up to two bindings as XML, and whether one gives a name two values; record the prediction."""
    text, is_doubled = "", False
    settable = {f"{rig}{name}.{key}" for name in names for key in SETTABLE}
    for _ in range(draw.randrange(3)):
        given = {name: float(draw.randrange(1, 9)) for name in draw.sample(list(known), min(4, len(known)))}
        for name, value in given.items():
            whole = f"{prefix}{name}"
            if whole in settable:
                taken[whole] = value
            else:
                lost.append(whole)
        xml = values({name: real(value) for name, value in given.items()})
        if draw.random() < 0.1:
            first = next(iter(given))
            last = given[first] + draw.choice((0.0, 1.0))
            again = f'<ssv:Parameter name="{first}">{real(last)}</ssv:Parameter>'
            is_doubled = is_doubled or last != given[first]
            if f"{prefix}{first}" in settable:
                taken[f"{prefix}{first}"] = last
            xml = xml.replace("</ssv:Parameters>", f"{again}</ssv:Parameters>", 1)
        text += xml
    return text, is_doubled


def _problem(path: Path, taken: Mapping[str, float], lost: Sequence[str], *, is_doubled: bool) -> str | None:
    try:
        imported = load_system(path)
    except VibroimpactError as refusal:
        return f"refused: {refusal}"
    if is_doubled and not any("the last of several values was taken" in note for note in imported.notes):
        return "two values of one parameter, and no word on it"
    found: dict[str, float] = {}
    for each in imported.scene.components:
        found |= {f"{each.name}.{key}": float(value) for key, value in each.parameters.items()}
    # components are named by their paths, with other signs for dots
    expected = {_plain(name): value for name, value in taken.items()}
    if {_plain(name): value for name, value in found.items()} != expected:
        return f"parameters {found}, expected {dict(taken)}"
    said = next((note.removeprefix(SAID) for note in imported.notes if note.startswith(SAID)), "")
    names = list(dict.fromkeys(lost))
    more = re.search(r" and (\d+) more$", said)
    shown = said.removesuffix(more.group()) if more else said
    count = len(names) - MOST_NAMED
    if (int(more.group(1)) if more else 0) != max(count, 0):
        return f"{said!r} for {names}"
    unknown = [name for name in names if name not in shown]
    return f"{said!r} lacks {unknown}" if len(unknown) > max(count, 0) else None


def _plain(name: str) -> str:
    return re.sub(r"\W", "_", name)
