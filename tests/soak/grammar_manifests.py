"""campaign.json of drawn scenes: read equal; damaged or odd ones: refused, or read equal, since they have a SHA-256."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

from soak import _drawn_files as files
from soak.cut_runs import body_tables
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.campaign.manifest import read_manifest, write_manifest
from vibroimpact.orchestrator.run import RunnerIdentity
from vibroimpact.orchestrator.scene import Scene

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

ODD: tuple[Any, ...] = (
    None,
    [],
    {},
    "",
    0,
    -1,
    1e999,
    "x" * 3000,
    [[]] * 50,
    {"a": {}},
    True,
    2**70,
    "\u202e",
    "1",
)


def _changed(draw: random.Random, content: bytes) -> bytes:
    """Return the JSON with odd values, without keys, or damaged; its hash stays."""
    if draw.random() < 0.4:
        return files.damaged(draw, content)
    document = json.loads(content)
    for _ in range(draw.choice((1, 1, 3))):
        key = draw.choice(sorted(document))
        match draw.randrange(3):
            case 0:
                document.pop(key)
            case 1:
                document[key] = draw.choice(ODD)
            case _:
                document[
                    draw.choice(("format", "scene", "runs", "fmu_hashes", "sha256", "continued_with"))
                ] = draw.choice(ODD)
        if not document:
            break
    text = json.dumps(document, ensure_ascii=draw.random() < 0.5)
    return draw.choice((text, f" {text} ", f"[{text}]", text * 2, "[" * 9000)).encode(
        "utf-8", "surrogatepass"
    )


def check(seed: int) -> str | None:
    """Read one manifest."""
    draw = random.Random(seed)
    path = Path("campaign.json")
    scene = Scene.from_dict(body_tables(draw))
    identity = RunnerIdentity(draw.choice(("fused", "coupled")), "avx2", {"a.fmu": "0" * 64}, 3)
    write_manifest(path, scene, identity, draw.choice((1, 7, 10_000)))
    known = read_manifest(path)
    if known is None or known.scene_text != scene.text or known.identity != identity:
        return f"{known} for {identity}"
    path.write_bytes(_changed(draw, path.read_bytes()))
    with files.bounded_memory() as grown:
        try:
            found = read_manifest(path)
        except VibroimpactError as refusal:
            return files.badly_said(refusal, path) or grown()
    return None if found == known else f"another manifest is read: {str(found)[:300]}"
