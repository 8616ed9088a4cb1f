"""Tokens of scenes and other TOML, manifests of campaigns, journals of rigs, requests to a service."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

from scaling._growth import Made, Tokens, each, run, texts
from vibroimpact.fmus.errors import SceneError
from vibroimpact.hardware.recordings.settings import read_settings
from vibroimpact.hardware.rig.calibration import read_calibrations
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.journal import TITLE, read_journal
from vibroimpact.hardware.virtual_rig.settings import read_rig
from vibroimpact.orchestrator.campaign.manifest import read_manifest
from vibroimpact.orchestrator.scene import load_scene
from vibroimpact.orchestrator.scene.file import LARGEST_FILE
from vibroimpact.service.bodies import is_small
from vibroimpact.service.connections import MOST_HEAD
from vibroimpact.service.hosts import Hosts
from vibroimpact.service.scenes import located
from vibroimpact.service.security import MOST_BYTES
from vibroimpact.service.sessions import Sessions, is_own_origin
from vibroimpact.service.slices import Selection

BODY = "[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 5\n"
CHAIN = BODY.replace(
    "mass = 1\nstiffness = 1", 'kind = "chain"\nmasses = [{more}1.0]\nstiffnesses = [{more}1.0]'
)
CONNECTION = (
    '[[connection]]\nfrom = "c{before}.displacement"\nto = "c{at}.force"\ngain = 1.0\ngain_unit = "N/m"\n'
)
COMPONENT = '[component.c{at}]\nfmu = "Oscillator"\n'
GENERAL = (
    '[record]\nrecorded_time = 5\nvariables = ["c0.displacement"]\nrate = 10\n[execution]\nmacro_step = 0.1\n'
)


TOML: Mapping[str, Made] = {
    "comments": run("# a comment\n", after=BODY),
    "letters of a comment": run("x", "#", "\n" + BODY),
    "empty lines": run("\n", after=BODY),
    "blanks": run(" ", after=BODY),
    "tabs": run("\t", after="\n" + BODY),
    "keys": each("k{at} = 1\n", BODY),
    "tables": each("[t{at}]\n", BODY),
    "arrays of tables": run("[[stop]]\n", BODY),
    "tables in tables": run(".a", "[a", "]\n" + BODY),
    "parts of a key": run("a.", after="a = 1\n"),
    "dotted keys": each("a.b.k{at} = 1\n", BODY),
    "one key": run("k = 1\n", BODY),
    "items": run("1,", "k = [", "]\n"),
    "items of lines": run("1,\n", "k = [", "]\n"),
    "nested arrays": run("[", "k = "),
    "closed arrays": run("[],", "k = [", "]\n"),
    "inline tables": run("{a=1},", "k = [", "]\n"),
    "nested inline tables": run("{a=", "k = "),
    "inline keys": each("k{at}=1,", "k = {", "z=1}\n"),
    "letters": run("x", 'k = "', '"\n'),
    "quotes": run('"', "k = "),
    "apostrophes": run("'", "k = "),
    "triple quotes": run('"""', "k = "),
    "texts": run('"a",', "k = [", "]\n"),
    "texts of lines": run('"""\na\n""",', "k = [", "]\n"),
    "odd quotes": run("'''a'''',", "k = [", "]\n"),
    "lines of a text": run("a\n", 'k = """', '"""\n'),
    "backslashes": run("\\", 'k = "', '"\n'),
    "escapes": run("\\n", 'k = "', '"\n'),
    "digits": run("1", "k = ", "\n"),
    "decimals": run("1", "k = 0.", "\n"),
    "underscores": run("1_", "k = ", "1\n"),
    "exponents": run("1", "k = 1e", "\n"),
    "hexadecimal": run("f", "k = 0x", "\n"),
    "dates": run("1979-05-27,", "k = [", "]\n"),
    "equal signs": run("=", "k "),
    "brackets": run("]", "k = 1"),
    "letters of a key": run("a", after=" = 1\n"),
    "quoted keys": run('"a".', after="a = 1\n"),
    "quoted tables": run('."a"', "[a", "]\n"),
    "headers": run("[", after="\n"),
    "carriage returns": run("\r\n", after=BODY),
    "keys of a table": each("k{at} = 1\n", BODY + "[body.more]\n"),
    "keys of stops": each("[[stop]]\nk{at} = 1\n", BODY),
}
SCENE: Mapping[str, Made] = {
    "stops": run("[[stop]]\nposition = 1.0\nrestitution = 0.5\n", BODY),
    "stops of a chain": run(
        "[[stop]]\nposition = 1.0\nmass = 1\nrestitution = 0.5\n", CHAIN.replace("{more}", "")
    ),
    "masses": lambda n: CHAIN.replace("{more}", "1.0, " * n),
    "swept values": each("1{at}.5, ", BODY + '[sweep]\n"body.mass" = { values = [', "] }\n"),
    "swept keys": each('"body.k{at}" = { values = [1.0, 2.0] }\n', BODY + "[sweep]\n"),
    "components": each(COMPONENT, after=GENERAL),
    "connections": lambda n: (
        each(COMPONENT)(2) + GENERAL + CONNECTION.replace("{before}", "0").replace("{at}", "1") * n
    ),
    "connected components": lambda n: (
        each(COMPONENT)(n)
        + "".join(CONNECTION.replace("{before}", str(at - 1)).replace("{at}", str(at)) for at in range(1, n))
        + GENERAL
    ),
    "parameters": lambda n: (
        COMPONENT.replace("{at}", "0")
        + "[component.c0.parameters]\n"
        + "".join(f"k{at} = 1\n" for at in range(n))
        + GENERAL
    ),
    "variables": lambda n: (
        COMPONENT.replace("{at}", "0") + GENERAL.replace('"c0.displacement"', '"c0.displacement", ' * n)
    ),
    "events": run(
        '[[event]]\nat = 1.0\nset = { "c0.mass" = 2.0 }\n', COMPONENT.replace("{at}", "0") + GENERAL
    ),
    "recordings": run('"a.nc", ', BODY + "[replay]\nrecordings = [", "]\n"),
}

MANIFEST: Mapping[str, Made] = {
    "keys": lambda n: json.dumps({"format": 2, "scene": {f"k{at}": at for at in range(n)}}),
    "values": lambda n: json.dumps({"format": 2, "scene": list(range(n))}),
    "letters": lambda n: json.dumps({"format": 2, "scene_text": "x" * n}),
    "escapes": lambda n: json.dumps({"format": 2, "scene_text": "\n" * n}),
    "nested lists": run("["),
    "nested objects": run('{"a":'),
    "digits": run("1", '{"format": ', "}"),
    "decimals": run("1", '{"format": 2, "runs": 0.', "}"),
    "blanks": run(" "),
    "quotes": run('"'),
}

TITLE_1 = b"vibroimpact journal 1\n"


def _record(kind: bytes, first: int, content: bytes, length: int | None = None) -> bytes:
    head = struct.pack("<4sIQ", kind, len(content) if length is None else length, first)
    return head + struct.pack("<I", zlib.crc32(content, zlib.crc32(head))) + content


HEADER = TITLE + _record(b"HEAD", 0, b'{"inputs": ["a"]}')

JOURNAL: Mapping[str, Callable[[int], bytes]] = {
    "blocks": lambda n: HEADER + b"".join(_record(b"SAMP", at, bytes(8)) for at in range(n)),
    "blocks of one place": lambda n: HEADER + _record(b"SAMP", 0, bytes(8)) * n,
    "notes": lambda n: HEADER + _record(b"NOTE", 0, b"{}") * n,
    "samples": lambda n: HEADER + _record(b"SAMP", 0, bytes(8 * n)),
    "heads of nothing": lambda n: HEADER + b"SAMP" * n,
    "heads of notes": lambda n: HEADER + b"NOTE" * n,
    "heads of all that follows": lambda n: (
        HEADER + b"".join(struct.pack("<4sIQI", b"SAMP", 20 * (n - at - 1), 0, 0) for at in range(n))
    ),
    "noise": lambda n: HEADER + b"x" * n,
    "letters of the header": lambda n: TITLE + _record(b"HEAD", 0, b'{"inputs": ["' + b"x" * n + b'"]}'),
    "letters of the header of version 1": lambda n: TITLE_1 + b'{"inputs": ["' + b"x" * n + b'"]}\n',
    "headers": lambda n: TITLE + struct.pack("<4sIQI", b"HEAD", 20, 0, 0) * n,
    "headers of all that follows": lambda n: TITLE + struct.pack("<4sIQI", b"HEAD", 10 * n, 0, 0) * n,
    "channels": lambda n: (
        TITLE
        + _record(b"HEAD", 0, json.dumps({"inputs": ["a"] * n}).encode())
        + _record(b"SAMP", 0, bytes(8 * n))
    ),
    "nested lists": lambda n: TITLE + _record(b"HEAD", 0, b"[" * n),
    "nested lists of version 1": lambda n: TITLE_1 + b"[" * n + b"\n",
    "nested lists of a note": lambda n: HEADER + _record(b"NOTE", 0, b"[" * n),
}

REQUEST: Mapping[str, tuple[Callable[[str], object], Mapping[str, Made], int]] = {
    "cookie": (
        lambda text: Sessions("token").are_in({b"cookie": text.encode("latin-1", "replace")}, "GET"),
        {
            "letters": run("x"),
            "cookies": run("a=b; "),
            "equal signs": run("="),
            "quotes": run('"'),
            "blanks": run(" "),
            "semicolons": run(";"),
            "backslashes": run("\\"),
            "nearly ours": lambda n: f"{Sessions('token').cookie}=1" * n,
        },
        MOST_HEAD,
    ),
    "host": (
        lambda text: Hosts("127.0.0.1", ["lab.example"]).why_not(
            text.encode("latin-1", "replace"), "127.0.0.1"
        ),
        {
            "letters": run("x"),
            "points": run("."),
            "colons": run(":"),
            "brackets": run("["),
            "digits": run("1"),
            "ports": run(":1"),
        },
        MOST_HEAD,
    ),
    "origin": (
        lambda text: is_own_origin({b"host": b"h", b"origin": text.encode("latin-1", "replace")}),
        {"letters": run("x", "http://"), "slashes": run("/"), "brackets": run("[", "http://")},
        MOST_HEAD,
    ),
    "selection": (
        lambda text: _selected(text),
        {
            "digits": run("1", "a:"),
            "colons": run(":"),
            "letters": run("a", after=":1"),
            "blanks": run(" ", "a:"),
        },
        MOST_HEAD,
    ),
    "JSON body": (
        is_small,
        {
            "letters": run("x", '"'),
            "quotes": run('"'),
            "backslashes": run("\\", '"'),
            "commas": run(",", "["),
            "brackets": run("["),
            "texts": run('"a",'),
            "escapes": run('\\"', '"'),
        },
        MOST_BYTES,
    ),
}


def _selected(text: str) -> object:
    try:
        return Selection.from_words([text], [text])
    except ValueError as refusal:
        return refusal


def _scene_of_the_service(path: Path) -> object:
    """Read a scene and find the places of its problems, like the service's validation."""
    try:
        return load_scene(path)
    except SceneError as refusal:
        problems = [problem.replace(str(path), "scene") for problem in refusal.problems]
        return located(problems, path.read_text(encoding="utf-8"))


def _of_requests() -> list[Tokens]:
    found = []
    for parser, (read, made, most) in REQUEST.items():
        found += texts(
            parser, made, lambda path, read=read: read(path.read_text(encoding="utf-8")), "tokens", most
        )  # type: ignore[misc]
    return found


def all_tokens() -> list[Tokens]:
    """Return all kinds of tokens of documents."""
    small = 2**16
    return [
        *texts("scene", {**TOML, **SCENE}, _scene_of_the_service, "tokens.toml", LARGEST_FILE),
        *texts("import settings", TOML, read_settings, "tokens.toml", small),
        *texts(
            "calibration",
            TOML,
            lambda path: read_calibrations([path], [Input("a", "Dev1/ai0", 5.0)]),
            "tokens.toml",
            small,
        ),
        *texts("rig", TOML, read_rig, "tokens.toml", small),
        *texts("campaign.json", MANIFEST, read_manifest, "campaign.json"),
        *(Tokens("journal", kind, make, read_journal) for kind, make in JOURNAL.items()),
        *_of_requests(),
    ]
