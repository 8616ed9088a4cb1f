"""Files of modes: sound ones are read equal; cut, damaged and odd ones are read, or refused in a line."""

from __future__ import annotations

import gzip
import random
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from support import modes_files

from soak import _drawn_files as files
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files import read_modes, write_modes

CASES, SAMPLE, SECONDS = files.CASES, 20, files.SECONDS

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
INSERTED = (
    b" ", b"\n", b"\r", b"\t", b"\0", b"#", b",", b"-", b"9" * 30, b"1e999", b"nan", b"\x1b[31m", b"\xe2\x80\xae",
    b"    -1\n", b"    55\n", b"frequency,1\n", b"[body]\n", b"a.b.c = 1\n", b"[[[[[[[[",
)  # fmt: skip
ROUNDING = {".uff": 5e-6, ".csv": 0.0, ".toml": 1e-15, ".nc": 0.0}
"""Relative rounding of the numbers of a file; a table in TOML has its frequencies in Hz."""


def _drawn(draw: random.Random) -> Modes:
    """Return modes at nodes, in ascending order of frequency."""
    chance = np.random.default_rng(draw.randrange(2**32))
    count, nodes = draw.randint(1, 8), draw.sample(range(1, 10**6), draw.randint(1, 5))
    natural = np.sort(chance.random(count)) * 10.0 ** draw.randint(-2, 5)
    natural[: draw.choice((0, 0, 0, 1))] = 0.0
    places = [(node, direction) for node in sorted(nodes) for direction in DIRECTIONS[: draw.choice((3, 6))]]
    shapes = chance.normal(size=(len(places), count)) * 10.0 ** chance.integers(-6, 6, (len(places), count))
    names = [f"{node}.{direction}" for node, direction in places]
    return Modes(natural, 0.1 * chance.random(count), None, dict(zip(names, shapes, strict=True)))


def _universal(modes: Modes) -> bytes:
    """Return a universal file as the package writes it."""
    write_modes("written.uff", modes)
    path = Path("written.uff")
    content = path.read_bytes()
    path.unlink()
    return content


def _csv(modes: Modes) -> bytes:
    rows = {
        "angular_frequency": modes.natural,
        "damping_ratio": modes.damping_ratios,
        **modes.shapes,
    }
    return "".join(f"{name};{';'.join(map(repr, row.tolist()))}\n" for name, row in rows.items()).encode()


def _netcdf(modes: Modes) -> bytes:
    variables: dict[str, Any] = {
        "angular_frequency": (("mode",), modes.natural),
        "damping_ratio": (("mode",), modes.damping_ratios),
        "point": (("point",), list(modes.shapes)),
        "shape": (("point", "mode"), np.array(list(modes.shapes.values()))),
    }
    return modes_files.netcdf(variables)


WRITERS: Mapping[str, Callable[[Modes], bytes]] = {
    ".uff": _universal,
    ".csv": _csv,
    ".nc": _netcdf,
    ".toml": lambda modes: tomli_w.dumps(modes.table()).encode(),
}


def _damaged(draw: random.Random, content: bytes) -> bytes:
    """Return a file with bytes changed, cut off, put in between, or with a line that comes twice."""
    lines = files.spoiled(draw, content, INSERTED).split(b"\n")
    if draw.random() < 0.3:
        lines.insert(draw.randrange(len(lines)), draw.choice(lines))
    return b"\n".join(lines) or b"\n"


def _differs(found: Modes, written: Modes, rounding: float) -> str | None:
    """Return the first difference between modes; None without one."""
    pairs = {
        "frequencies": (found.natural, written.natural),
        "damping ratios": (found.damping_ratios, written.damping_ratios),
        **{name: (found.shapes.get(name, np.empty(0)), shape) for name, shape in written.shapes.items()},
    }
    for name, (got, known) in pairs.items():
        if got.shape != known.shape or not np.allclose(got, known, rtol=rounding, atol=0.0):
            return f"{name}: {got} for {known}"
    return None if list(found.shapes) == list(written.shapes) else f"points {list(found.shapes)}"


def _unsound(found: Modes) -> str | None:
    """Return the fault of modes that were read from a damaged file."""
    arrays = [found.natural, found.damping_ratios, *found.shapes.values()]
    if any(one.shape != found.natural.shape or not np.all(np.isfinite(one)) for one in arrays):
        return "numbers that are not finite, or of another number of modes"
    return None if np.all(np.diff(found.natural) >= 0.0) else "frequencies in another order"


def check(seed: int) -> str | None:
    """Read one file of modes."""
    draw = random.Random(seed)
    suffix, written, is_sound = draw.choice(sorted(WRITERS)), _drawn(draw), draw.random() < 0.4
    content = WRITERS[suffix](written)
    content = content if is_sound else _damaged(draw, content)
    path = Path(f"modes{suffix}")
    path.write_bytes(gzip.compress(content) if draw.random() < 0.1 else content)
    with files.bounded_memory() as grown:
        try:
            found = read_modes(path)
        except UsageError as refusal:
            said = f"a sound file is refused: {refusal}" if is_sound else None
            return said or files.badly_said(refusal, path) or grown()
    return (_differs(found, written, ROUNDING[suffix]) if is_sound else _unsound(found)) or grown()
