"""Example scenes with one or two numbers of extreme size: an outcome or one clear error, before their deadline."""

from __future__ import annotations

import random
import re
import time
from pathlib import Path

from support.places import EXAMPLES

from vibroimpact.fmus.errors import ComponentError, SceneError, UsageError
from vibroimpact.orchestrator.run import named_runner
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import expand

SAMPLE = 12
DEADLINE = 1.0
GRACE = 1.5
"""Processor time beyond the deadline for reading a scene, its start and the piece of work under way, s."""
LONGEST_MESSAGE = 4000

SCENES = sorted(path for path in EXAMPLES.rglob("*.toml") if path.parent.name != "recordings")
EXTREMES = (
    *("1e300", "1e100", "1e30", "1e15", "1e9", "1e5", "1000", "1", "0"),
    *("1e-3", "1e-9", "1e-15", "1e-30", "1e-160", "1e-300", "5e-324"),
    *("-1", "-1e-15", "-5e-324", "-1e15", "-1e300", "inf", "nan"),
)
_NUMBER = re.compile(r"(?<![\w.\"-])[-+]?\d[\d_]*(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")


def check(seed: int) -> str | None:
    """Run the first point of a scene of this seed; None where it ended in time with one outcome or error."""
    draw = random.Random(seed)
    path = draw.choice(SCENES)
    text, changes = _changed(draw, path.read_text(encoding="utf-8"))
    case = f"{path.relative_to(EXAMPLES)} with {'; '.join(changes)}"
    began = time.process_time()
    message = _run(_limited(text), path)
    taken = time.process_time() - began
    if taken > DEADLINE + GRACE:
        return f"{case}: {taken:.1f} s of processor time with a deadline of {DEADLINE} s"
    if message is not None and (not message or len(message) > LONGEST_MESSAGE):
        return f"{case}: a message of {len(message)} characters"
    return None


def _run(text: str, path: Path) -> str | None:
    """Return the message of the error; None where the run has an outcome."""
    try:
        scene = parse_scene(text, str(path))
        _run_first(scene)
    except (SceneError, ComponentError, UsageError) as error:  # a replay whose recording is not named, too
        return str(error)
    return None


def _run_first(scene: Scene) -> None:
    runner = named_runner(scene, DEFAULT_RUNNER)
    try:
        runner.run(expand(scene)[0].points[0].values if scene.sweep else {}, None)
    finally:
        runner.close()


def _changed(draw: random.Random, text: str) -> tuple[str, list[str]]:
    """Replace one or two of the numbers to the right of an equals sign."""
    lines, changes = text.splitlines(), []
    places = [i for i, line in enumerate(lines) if _numbers(line)]
    for i in draw.sample(places, min(len(places), draw.choice((1, 1, 2)))):
        found, value = draw.choice(_numbers(lines[i])), draw.choice(EXTREMES)
        lines[i] = f"{lines[i][: found.start()]}{value}{lines[i][found.end() :]}"
        changes.append(lines[i].strip())
    return "\n".join(lines) + "\n", changes


def _numbers(line: str) -> list[re.Match[str]]:
    code = line.split("#")[0]
    return list(_NUMBER.finditer(code, code.find("=") + 1)) if "=" in code else []


def _limited(text: str) -> str:
    """Give the scene its deadline."""
    text = re.sub(r"^deadline\s*=.*$", "", text, flags=re.M)
    if re.search(r"^\[execution\]", text, flags=re.M):
        return re.sub(r"^\[execution\].*$", f"[execution]\ndeadline = {DEADLINE}", text, count=1, flags=re.M)
    return f"{text}\n[execution]\ndeadline = {DEADLINE}\n"
