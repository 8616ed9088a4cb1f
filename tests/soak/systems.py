"""Hostile SSP archives: a scene or one refusal, and no file outside; random scenes survive export and import."""

from __future__ import annotations

import functools
import io
import random
import re
import warnings
import zipfile
from pathlib import Path
from typing import Any
from unittest.mock import patch

from soak.archives import damaged, member
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import export_system, load_system

CASES, SAMPLE = 3000, 6
SECONDS = 30.0
LONGEST_MESSAGE = 12_000
"""Longest message: a scene made of a damaged system may have fifty problems."""

WORDS = (
    *(
        "",
        "a",
        "b",
        "a.b",
        "displacement",
        "force",
        "mass",
        "no",
        "../a",
        "/etc/passwd",
        "resources/a.fmu",
        "#a",
    ),
    *("file:///etc/passwd", "http://a.example/b", "%2e%2e/x", "C:/x", "1e999", "nan", "-1", "0", "1", "true"),
    *("http://[a", "1_0", "\u0663", "9" * 400, "0" * 5000, "1e308"),
    *(
        "input",
        "output",
        "inout",
        "parameter",
        "1.0",
        "2.0",
        "9.0",
        "x" * 3000,
        "\u202e",
        "m",
        "N",
        "&#0;",
        "&lt;",
    ),
)
ATTRIBUTE = re.compile(rb'([A-Za-z:]+)="([^"]*)"')
ELEMENT = re.compile(rb"<([A-Za-z]+:[A-Za-z]+)(?: [^<>]*)?/>|<([A-Za-z]+:[A-Za-z]+)(?: [^<>]*)?>")


def tables(draw: random.Random) -> dict[str, Any]:
    """Return a scene of components of this package."""
    names = draw.sample(["a", "b", "c", "D", "d", "gain_1", "_x"], draw.randrange(1, 4))
    components: dict[str, Any] = {}
    for name in names:
        start = draw.choice([0.5, 1e-300, -3.25, 1 / 3])
        parameters: dict[str, Any] = {"mass": draw.choice([1, 2.5, 1e9]), "displacement_start": start}
        if draw.random() < 0.5:
            k = draw.randrange(1, 3)
            parameters |= {f"contact[{k}].law": draw.choice(["hertz", "restitution", "external", "none"])}
            parameters |= {f"contact[{k}].position": 5.0, f"contact[{k}].stiffness": 100.0}
        components[name] = {"fmu": "Oscillator", "fmi": draw.choice(["2.0", "3.0"]), "parameters": parameters}
    connections = []
    for target in draw.sample(names, draw.randrange(len(names) + 1)):
        output, unit = draw.choice([("displacement", "N/m"), ("velocity", "N.s/m"), ("acceleration", "kg")])
        gain = draw.choice([0.1, -1e-7, 3.0, 1.0])
        source = f"{draw.choice(names)}.{output}"
        connections.append({"from": source, "to": f"{target}.force", "gain": gain, "gain_unit": unit})
    record: dict[str, Any] = {"recorded_time": 1.0}
    if draw.random() < 0.7:
        record |= {"variables": [f"{names[0]}.displacement"], "rate": 10}
    whole: dict[str, Any] = {"component": components, "connection": connections, "record": record}
    whole["execution"] = {"macro_step": 0.1, "exchange": draw.choice(["jacobi", "iterated", "gauss_seidel"])}
    if draw.random() < 0.5:
        whole["sweep"] = {f"{names[0]}.mass": {"values": [1.0, 2.0]}}
    return whole


def there_and_back(draw: random.Random) -> str | None:
    """Return the difference between a scene and its import after export; None without one."""
    scene = Scene.from_dict(tables(draw))
    path = export_system(
        scene,
        "system.ssp",
        ssp=draw.choice(["1.0", "2.0"]),
        fmi=draw.choice([None, "2.0", "3.0"]),
        gains=draw.choice(["transformation", "component"]),
    )
    again = load_system(path).scene
    parts = ("bodies", "connections", "contacts", "events", "macro_step", "record", "sweep")
    if any(getattr(again, part) != getattr(scene, part) for part in parts):
        return f"{scene.text} became {again.text}"
    return None


@functools.cache
def whole() -> bytes:
    """Return an archive of this package."""
    with patch.dict("os.environ", {"VIBROIMPACT_CACHE": str(Path.cwd() / "cache")}):
        path = export_system(Scene.from_dict(tables(random.Random(5))), "whole.ssp", gains="component")
    return path.read_bytes()


def odd(content: bytes, draw: random.Random) -> bytes:
    """Return XML with wrong attributes, or with elements missing or doubled."""
    for _ in range(draw.choice([1, 1, 2, 5])):
        kind, pattern = draw.random(), ATTRIBUTE if draw.random() < 0.7 else ELEMENT
        found = list(pattern.finditer(content))
        if not found:
            return content
        chosen = draw.choice(found)
        if pattern is ATTRIBUTE:
            new = b'%s="%s"' % (chosen[1], draw.choice(WORDS).encode())
        elif kind < 0.4 and chosen[1]:
            new = chosen[0] * 2
        elif kind < 0.8:
            new = b"" if chosen[1] else b"<ssd:System name='s'>"
        else:
            new = chosen[0] + b"<!DOCTYPE a [<!ENTITY b 'c'>]>&b;"
        content = content[: chosen.start()] + new + content[chosen.end() :]
    return content


def archive(draw: random.Random) -> bytes:
    """Return an archive with odd XML or odd members, or without some required members."""
    spoilt = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole())) as source, zipfile.ZipFile(spoilt, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if draw.random() < 0.03:
                continue
            if name.endswith(".fmu"):
                content = damaged(content, draw) if draw.random() < 0.05 else content
            elif draw.random() < (0.9 if name == "SystemStructure.ssd" else 0.2):
                content = odd(content, draw)
            target.writestr(name, content)
        if draw.random() < 0.1:
            # two members of one name are intended
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                target.writestr(member(draw), b"x")
    content = spoilt.getvalue()
    return damaged(content, draw) if draw.random() < 0.2 else content


def check(seed: int) -> str | None:
    """Return the problem of the reading of an archive; None without one."""
    draw = random.Random(seed)
    if draw.random() < 0.3:
        return there_and_back(draw)
    content = archive(draw)
    home = Path.cwd() / "home"
    home.mkdir()
    path = home / "system.ssp"
    path.write_bytes(content)
    with patch.dict("os.environ", {"VIBROIMPACT_CACHE": str(Path.cwd() / "cache")}):
        try:
            load_system(path)
        except VibroimpactError as refusal:
            message = str(refusal)
            if str(path) not in message or len(message) > LONGEST_MESSAGE or "scratch" in message:
                return f"{len(message)} characters of refusal: {message[:500]}"
    outside = {entry.name for entry in home.iterdir()} - {path.name}
    return f"written outside: {sorted(outside)}" if outside else None
