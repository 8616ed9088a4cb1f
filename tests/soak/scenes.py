"""Any text as a scene: valid examples with keys, values and structure changed, or bytes of any kind.

Each text is a scene or one clear refusal; a valid scene is run for a moment, and ends.
"""

from __future__ import annotations

import random
import unicodedata
from functools import lru_cache
from pathlib import Path

from support.places import EXAMPLES

from vibroimpact.fmus.errors import SceneError, UsageError, VibroimpactError
from vibroimpact.fmus.printable import printable
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.run.result_size import bytes_of_a_run
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count

SAMPLE = 80
SECONDS = 10.0
LONGEST_MESSAGE = 100_000
DEADLINE = 1.0
LARGEST_RUN = 2**24

VALUES = (
    "0", "-1", "1", "0.5", "-0.0", "1e-300", "1e300", "5e-324", "1.8e308", "1e999", "nan", "-inf", "inf", "true", '""',
    '"nan"', '"0.5"', '"\\u202e\\u001b[31m\\u0000"', '"ä€𝄞"', "[]", "[1]", "[1, 2, 3]", "[[1], [2]]", "{}",
    "{ a = 1 }", "9223372036854775807", "-9223372036854775809", "1" * 400, "1" * 5000, "1979-05-27", "07:32:00",
    "0x7f", "1_000", "64", "65", "100000001", '"hertz"', '"upper"', '"lower"', '"coupled"', '"fused"', '"chain"',
    '"beam"', "[" * 200 + "]" * 200, "{a=" * 90 + "1" + "}" * 90, '"""\n\n"""', "'x'", "1.0.0", "-", "= =", "#",
    "{ start = 0, stop = 1, points = 3 }", "{ values = [1, 2], path = \"up-down\" }",
)  # fmt: skip
LINES = (
    "[body]", "[[body]]", "[stop]", "[[stop]]", "[forcing]", "[record]", "[sweep]", "[execution]", "[sensor]",
    "[replay]", "[component.a]", "[[connection]]", "[[event]]", "[record.time_series]", '["\\u0000"]', "[a.b.c]",
    "a.b.c = 1", '"stop[1].position" = { values = [1.0, 2.0] }',
    '"body.mass" = { start = 1, stop = 2, points = 3, path = "up" }',
    "kind = \"chain\"", "law = \"kelvin_voigt\"", "restitution = 2", "rate = 1e9", "recorded_time = 1e12", "\x00",
    "\x1b[31m", "é = 1", "\u202e = 1", "a." * 300 + "b = 1", "x = " + "[" * 3000,
)  # fmt: skip
BYTES = (
    b"\x00",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\r",
    b"\x1b[2J",
    b"\xc3",
    b"\xe2\x80\xae",
    b"=",
    b"[",
    b'"',
    b"'",
    b".",
    b"#",
)


@lru_cache(maxsize=1)
def examples() -> tuple[bytes, ...]:
    """Return the texts of the examples."""
    return tuple(path.read_bytes() for path in sorted(EXAMPLES.rglob("*.toml")) if "import" not in path.parts)


def changed_lines(draw: random.Random, content: bytes) -> bytes:
    """Return a scene with values, keys and lines changed, dropped, doubled or put in."""
    lines = content.decode().splitlines()
    for _ in range(draw.choice((1, 1, 2, 3, 8))):
        place = draw.randrange(len(lines) or 1)
        line = lines[place] if lines else ""
        key, equals, _ = line.partition("=")
        match draw.randrange(6):
            case 0 | 1 if equals:
                lines[place] = f"{key}= {draw.choice(VALUES)}"
            case 2 if equals:
                letters = list(key)
                letters[draw.randrange(len(letters))] = draw.choice(("", "x", ".", "\u202e", "[2]", '"', " "))
                lines[place] = "".join(letters) + line[len(key) :]
            case 3:
                lines.insert(place, draw.choice(LINES))
            case 4:
                lines[place : place + draw.randint(1, 3)] = []
            case _:
                lines.insert(draw.randrange(len(lines) + 1), line)
        if not lines:
            break
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def changed_bytes(draw: random.Random, content: bytes) -> bytes:
    """Return a scene with bytes changed, put in, or cut off."""
    changed = bytearray(content)
    for _ in range(draw.choice((1, 2, 5, 40))):
        place = draw.randrange(len(changed) + 1)
        changed[place : place + draw.randint(0, 2)] = draw.choice((*BYTES, bytes([draw.randrange(256)])))
    return bytes(changed[: draw.randrange(len(changed) + 1)] if draw.random() < 0.2 else changed)


def case(draw: random.Random) -> bytes:
    """Return the content of a scene file."""
    content = draw.choice(examples())
    match draw.randrange(8):
        case 0:
            return changed_bytes(draw, content)
        case 1:
            return draw.randbytes(draw.randrange(3000))
        case 2:
            return "".join(f"{draw.choice(LINES)}\n" for _ in range(draw.randrange(60))).encode()
        case 3:
            return content + f"[sweep]\nx = {draw.choice(VALUES)}\n".encode() * draw.choice((1, 2, 3000))
        case _:
            return changed_lines(draw, content)


def wrong_message(text: str) -> str | None:
    """Return the problem of a message; None without one."""
    if len(text) > LONGEST_MESSAGE:
        return f"a message of {len(text)} characters"
    shown = printable(text)
    if any(unicodedata.category(c) in ("Cc", "Cf", "Cs") and c not in "\n\t" for c in shown):
        return f"a control character in {shown[:200]!r}"
    return None if text else "an empty message"


def run_shortly(scene: Scene) -> str | None:
    """Run the first point of a valid scene for a moment."""
    if bytes_of_a_run(scene) > LARGEST_RUN or not scene.is_lone_body:
        return None
    lines = [line for line in scene.text.splitlines() if not line.lstrip().startswith("deadline")]
    text = "\n".join(lines)
    limit = f"deadline = {DEADLINE}"
    text = (
        text.replace("[execution]", f"[execution]\n{limit}", 1)
        if "[execution]" in text
        else f"{text}\n[execution]\n{limit}\n"
    )
    try:
        limited = parse_scene(text, scene.source)
    except SceneError:  # the text's spelling takes no further table
        return None
    with open_scene(limited) as runner:
        if run_count(limited.sweep) >= 10_000:
            return None
        record = runner.record_of(columns_of_points(expand(limited), 0, 1).place(0).point.values)
    return wrong_message(record.message) if record.message else None


def check(seed: int) -> str | None:
    """Read one text as a scene."""
    path = Path("scene.toml")
    path.write_bytes(case(random.Random(seed)))
    try:
        scene = load_scene(path)
    except SceneError as refusal:
        return wrong_message(str(refusal))
    try:
        return run_shortly(scene)
    except (VibroimpactError, UsageError) as refusal:
        return wrong_message(str(refusal))
