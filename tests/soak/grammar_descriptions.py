"""Descriptions of FMUs, FMI 2.0 and 3.0: drawn variables, units and types are read equal; odd ones: read or refused."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

from soak import _drawn_files as files
from soak.systems import odd
from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging import fmpy_door

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

LONGEST_MESSAGE = 12_000
NAMES = (
    "mass",
    "body.x",
    "contact[1].law",
    "a&b",
    "ä",
    "x<y",
    "der(x)",
    "with blank",
    "'",
    "𝄞",
    "a.b.c[2,3]",
)
UNITS = {"m": 'm="1"', "N": 'kg="1" m="1" s="-2"', "deg": 'rad="1" factor="0.017453292519943295"'}
ROLES = (
    ("parameter", "fixed", True),
    ("parameter", "tunable", True),
    ("input", "continuous", True),
    ("input", "discrete", True),
    ("output", "continuous", False),
    ("output", "discrete", False),
    ("local", "continuous", False),
    ("local", "constant", True),
)
"""Causality, variability, and whether there is a start value."""
TYPES = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean", "String": "String"}
STRANGE = ("<!-- a comment -->", "<?a b?>", "\n\n", "  ")


@dataclass(frozen=True)
class Variable:
    """A variable as written in the file; `start` is None where there is none."""

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    start: str | None
    unit: str | None


def drawn_variables(draw: random.Random) -> list[Variable]:
    """Return variables with unique names and references."""
    found = []
    for place, name in enumerate(draw.sample(NAMES, draw.randint(1, 8)), 1):
        kind = draw.choice(list(TYPES))
        causality, variability, starts = draw.choice(ROLES)
        if kind != "Float64" and variability == "continuous":
            variability = "discrete"
        unit = draw.choice((*UNITS, None)) if kind == "Float64" else None
        start = _start(draw, kind) if starts else None
        found.append(
            Variable(
                name,
                place * draw.choice((1, 100)) + 10_000 * place,
                kind,
                causality,
                variability,
                start,
                unit,
            )
        )
    return found


def _start(draw: random.Random, kind: str) -> str:
    if kind == "Float64":
        return repr(draw.choice((0.0, -1.5, 1e-300, 1.7e308, 1 / 3, 5e-324)))
    if kind == "Int32":
        return str(draw.choice((0, -7, 2**31 - 1, -(2**31))))
    return (
        draw.choice(("true", "false"))
        if kind == "Boolean"
        else draw.choice(("a word", "ä & <b>", "x" * 50, "1"))
    )


def written(draw: random.Random, variables: list[Variable], major: int) -> str:
    """Return the description of variables."""
    between = (lambda: draw.choice(STRANGE)) if draw.random() < 0.3 else (lambda: "")
    body = "".join(between() + (_of_3 if major == 3 else _of_2)(one) for one in variables)
    units = "".join(f'<Unit name="{name}"><BaseUnit {powers}/></Unit>' for name, powers in UNITS.items())
    head, token = ("3.0", "instantiationToken") if major == 3 else ("2.0", "guid")
    if major == 3:
        body += '<Float64 name="time" valueReference="1" causality="independent" variability="continuous"/>'
        outputs = "".join(
            f'<Output valueReference="{v.reference}"/>' for v in variables if v.causality == "output"
        )
    else:
        places = [at for at, v in enumerate(variables, 1) if v.causality == "output"]
        unknowns = "".join(f'<Unknown index="{at}"/>' for at in places)
        outputs = f"<Outputs>{unknowns}</Outputs>" if places else ""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>{between()}<fmiModelDescription fmiVersion="{head}" modelName="m" '
        f'{token}="t"><CoSimulation modelIdentifier="m"/>{between()}<UnitDefinitions>{units}</UnitDefinitions>'
        f"<ModelVariables>{body}</ModelVariables>{between()}<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    )


def _common(one: Variable) -> str:
    return (
        f'name={quoteattr(one.name)} valueReference="{one.reference}" causality="{one.causality}" '
        f'variability="{one.variability}"'
    )


def _of_3(one: Variable) -> str:
    unit = f' unit="{one.unit}"' if one.unit else ""
    if one.type == "String" and one.start is not None:
        return f"<String {_common(one)}><Start value={quoteattr(one.start)}/></String>"
    start = "" if one.start is None else f" start={quoteattr(one.start)}"
    return f"<{one.type} {_common(one)}{unit}{start}/>"


def _of_2(one: Variable) -> str:
    unit = f' unit="{one.unit}"' if one.unit else ""
    start = "" if one.start is None else f" start={quoteattr(one.start)}"
    return f"<ScalarVariable {_common(one)}><{TYPES[one.type]}{unit}{start}/></ScalarVariable>"


def _differs(found: Any, variables: list[Variable], major: int) -> str | None:
    read = {one.name: one for one in found.modelVariables if one.name != "time"}
    if list(read) != [one.name for one in variables]:
        return f"variables {list(read)} for {[one.name for one in variables]}"
    for one in variables:
        got = read[one.name]
        start = got.start[0] if isinstance(got.start, list) and len(got.start) == 1 else got.start
        kind = one.type if major == 3 else TYPES[one.type]
        facts = (got.valueReference, got.type, got.causality, got.variability, start, got.unit)
        drawn = (one.reference, kind, one.causality, one.variability, one.start, one.unit)
        if facts != drawn:
            return f"{one.name}: {facts} for {drawn}"
    return None


def check(seed: int) -> str | None:
    """Read one description."""
    draw = random.Random(seed)
    major, variables = draw.choice((2, 3)), drawn_variables(draw)
    content = written(draw, variables, major).encode()
    is_sound = draw.random() < 0.4
    if not is_sound:
        content = odd(content, draw) if draw.random() < 0.8 else files.damaged(draw, content)
    with files.bounded_memory() as grown:
        try:
            reading = fmpy_door.read(content)
        except ComponentFileError as refusal:
            problem = _badly_refused(str(refusal), is_sound)
        else:
            problem = _differs(reading.description, variables, major) if is_sound else None
    return problem or grown()


def _badly_refused(message: str, is_sound: bool) -> str | None:
    if is_sound:
        return f"a sound description is refused: {message[:400]}"
    lines = message.splitlines()
    if len(message) > LONGEST_MESSAGE or any("modelDescription.xml" not in line for line in lines):
        return f"{len(message)} characters of refusal: {message[:300]!r}"
    return None
