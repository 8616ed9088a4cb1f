"""Structures (SSD), values (SSV) and mappings (SSM) of systems: read equal; odd ones: read or refused."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from support import ssp_files as ssp

from soak import _drawn_files as files
from soak.systems import odd
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.safe_xml import root_of
from vibroimpact.orchestrator.ssp.archive import SspArchive
from vibroimpact.orchestrator.ssp.reading import read_structure
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.structure import System
from vibroimpact.orchestrator.ssp.values import read_mapping, read_parameter_set

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

LONGEST_MESSAGE = 12_000
NAMES = ("mass", "body.x", "contact[1].law", "a&b", "ä", "x<y", "der(x)", "with blank", "𝄞", "0", "*")
NUMBERS = (0.0, -1.5, 1e-300, 1.7e308, 1 / 3, 5e-324)
SPACES = (
    'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
)


def _quoted(text: str) -> str:
    return escape(text, {'"': "&quot;"})


def drawn_values(draw: random.Random) -> dict[str, tuple[str, Any]]:
    """Return parameters by name: their XML, and their values."""
    found: dict[str, tuple[str, Any]] = {}
    for name in draw.sample(NAMES, draw.randint(0, 8)):
        match draw.randrange(5):
            case 0:
                whole = draw.choice((0, -7, 2**31 - 1))
                found[name] = f'<ssv:Integer value="{whole}"/>', whole
            case 1:
                found[name] = '<ssv:Boolean value="true"/>', True
            case 2:
                text = draw.choice(NAMES)
                found[name] = f'<ssv:String value="{_quoted(text)}"/>', text
            case 3:
                text = draw.choice(NAMES)
                found[name] = f'<ssv:Enumeration value="{_quoted(text)}"/>', text
            case _:
                value = draw.choice(NUMBERS)
                found[name] = ssp.real(value), value
    return found


def _values(draw: random.Random, *, sound: bool) -> str | None:
    drawn = drawn_values(draw)
    text = ssp.ssv({_quoted(name): xml for name, (xml, _) in drawn.items()})
    found = read_parameter_set(root_of(_changed(draw, text, sound), "a.ssv", namespaces=True), "a.ssv")
    if not sound:
        return None
    got = {one.name: one.value for one in found}
    expected = {name: value for name, (_, value) in drawn.items()}
    return None if got == expected else f"{got} for {expected}"


def _mappings(draw: random.Random, *, sound: bool) -> str | None:
    drawn = [
        (draw.choice(NAMES), draw.choice(NAMES), draw.choice((1.0, 2.5, -1e-9)), draw.choice((0.0, 3.0)))
        for _ in range(draw.randint(0, 6))
    ]
    entries = "".join(
        ssp.entry(
            _quoted(source),
            _quoted(target),
            ssp.factor(by, plus) if (by, plus) != (1.0, 0.0) or draw.random() < 0.5 else "",
        )
        for source, target, by, plus in drawn
    )
    text = f'<ssm:ParameterMapping {SPACES} version="1.0">{entries}</ssm:ParameterMapping>'
    found = read_mapping(root_of(_changed(draw, text, sound), "a.ssm", namespaces=True), "a.ssm")
    got = [(one.source, one.target, one.factor, one.offset) for one in found]
    return None if not sound or got == drawn else f"{got} for {drawn}"


def _system(draw: random.Random, depth: int) -> tuple[str, Any]:
    """Return a system as XML, and as nested lists: connectors, connections, elements by name."""
    connectors = {
        name: draw.choice(("input", "output", "parameter")) for name in draw.sample(NAMES, draw.randint(0, 3))
    }
    elements: dict[str, Any] = {}
    parts = []
    for name in draw.sample(NAMES, draw.randint(0, 3)):
        if depth and draw.random() < 0.4:
            xml, known = _system(draw, depth - 1)
            parts.append(xml.replace('name="SYSTEM"', f'name="{_quoted(name)}"', 1))
        else:
            kinds = {one: draw.choice(("input", "output")) for one in draw.sample(NAMES, draw.randint(0, 3))}
            parts.append(ssp.component(_quoted(name), "resources/a.fmu", _connectors(kinds)))
            known = kinds
        elements[name] = known
    connections = [(draw.choice(NAMES), draw.choice(NAMES)) for _ in range(draw.randint(0, 3))]
    lines = "".join(
        f'<ssd:Connection startConnector="{_quoted(start)}" endConnector="{_quoted(end)}"/>'
        for start, end in connections
    )
    xml = ssp.system("SYSTEM", "".join(parts), lines, connectors=_connectors(connectors))
    return xml, (connectors, connections, elements)


def _connectors(kinds: dict[str, str]) -> str:
    return "".join(ssp.connector(_quoted(name), kind) for name, kind in kinds.items())


def _as_drawn(system: System) -> Any:
    elements = {
        name: _as_drawn(one) if isinstance(one, System) else {c.name: c.kind for c in one.connectors.values()}
        for name, one in system.elements.items()
    }
    connectors = {one.name: one.kind for one in system.connectors.values()}
    return connectors, [(one.start[1], one.end[1]) for one in system.connections], elements


def _structures(draw: random.Random, *, sound: bool) -> str | None:
    xml, drawn = _system(draw, 3)
    whole = ssp.ssd("SYSTEMS")
    start, end = whole.index("<ssd:System "), whole.index("</ssd:System>") + len("</ssd:System>")
    text = whole[:start] + xml + whole[end:]
    path = ssp.archive(
        Path.cwd() / "system.ssp",
        _changed(draw, text, sound).decode("utf-8", "replace"),
        {"resources/a.fmu": b"x"},
    )
    with SspArchive(path) as archive:
        structure = read_structure(archive)
    got = _as_drawn(structure.system)
    return None if not sound or got == drawn else f"{got} for {drawn}"


def _changed(draw: random.Random, text: str, sound: bool) -> bytes:
    content = text.encode()
    if sound:
        return content
    return odd(content, draw) if draw.random() < 0.8 else files.damaged(draw, content)


def check(seed: int) -> str | None:
    """Read one document."""
    draw = random.Random(seed)
    sound = draw.random() < 0.5
    with files.bounded_memory() as grown:
        try:
            problem = draw.choice((_values, _mappings, _structures))(draw, sound=sound)
        except (VibroimpactError, RefusalError) as refusal:
            message = (
                refusal.problem.line("system.ssp") if isinstance(refusal, RefusalError) else str(refusal)
            )
            problem = f"a sound document is refused: {message[:400]}" if sound else None
            if len(message) > LONGEST_MESSAGE:
                problem = f"{len(message)} characters of refusal: {message[:300]!r}"
    return problem or grown()
