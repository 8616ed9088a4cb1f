"""Cost of watched runs and sealed files: the step budget and the checksums.

- Step budget: the loops of the engine count their steps, so that a deadline is kept and Ctrl-C is heard within one
  step. The core is compiled twice, unchanged and with a `budget` that counts and stops nothing. Both follow the same
  motions in turns: an oscillator and a clamped-free beam of 8 modes, each on its orbit of one impact per period.
- Checksums: the chunks of a campaign are computed and written. Then their parts are hashed as by the campaign: in
  memory when written, and as files when read.

Times are processor times; medians of repetitions, and their range. Run with
`python tests/benchmarks/bench_watching.py [--repetitions 15] [--points 4000]`.
"""

from __future__ import annotations

import argparse
import math
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from ctypes import CDLL
from pathlib import Path
from unittest.mock import patch

from bench_dask import SCENE, WORKERS
from bench_structure import PERIOD, SETTLING, beam, restitution

from vibroimpact.analysis.files.fingerprints import LINE_LENGTH, closing_line, matches_recorded_hash
from vibroimpact.fmus.core import Oscillator, motion, oscillator
from vibroimpact.fmus.packaging.build import NATIVE
from vibroimpact.fmus.packaging.platform_names import library_suffix
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.campaign.workers.chunks import Work, get_ready, run_chunk
from vibroimpact.orchestrator.scene import parse_scene

sys.path.insert(0, str(Path(__file__).parents[1]))
from support import structure
from support.core_doors import compile_with_doors
from support.structure import Structure

#: Largest cost of the budget and of the checksums, %.
MOST_PERCENT = 3.0
OSCILLATOR_PERIODS, BEAM_PERIODS = 50_000, 4_000
PHASE, VELOCITY = 0.3665212101960540571, 0.7910497883492130773  # values on the orbit, as in bench_fused

UNWATCHED = {
    "budget->spent += evaluations;": "(void)budget, (void)evaluations;",
    "vi_step_result vi_budget_look(": "static vi_step_result look(",
}
LOOKS_AT_NOTHING = """
vi_step_result vi_budget_look(vi_budget *budget, const vi_clock *clock, vi_instant now, int64_t event_limit,
                              const vi_step_request *request)
{
    (void)look, (void)budget, (void)clock, (void)now, (void)event_limit, (void)request;
    return VI_STEP_DONE;
}
"""


def build(folder: Path, *, watched: bool) -> CDLL:
    """Compile the core into a folder, with its budget or without, and load it."""
    source = shutil.copytree(NATIVE / "core", folder / "core")
    if not watched:
        (inline, counted), (looked, other) = UNWATCHED.items()
        for name, old, new in (("body/budget.h", inline, counted), ("body/budget.c", looked, other)):
            text = (source / name).read_text()
            if text.count(old) != 1:
                raise SystemExit(f"{name}: expected `{old}` once. Bring this benchmark up to date.")
            (source / name).write_text(text.replace(old, new))
        with (source / "body" / "budget.c").open("a") as file:
            file.write(LOOKS_AT_NOTHING)
    library = folder / f"core{library_suffix()}"
    compile_with_doors(library, source)
    return CDLL(str(library))


def oscillator_seconds() -> float:
    """Follow the oscillator's orbit; return the processor time, s."""
    body = Oscillator(1.0, 0.2, 1.0, 0.5, 1.0)
    began = time.process_time()
    motion(
        body,
        (1.0, -0.7 * VELOCITY),
        [2.0 * math.pi * OSCILLATOR_PERIODS],
        position=1.0,
        restitution=0.7,
        phase=PHASE,
    )
    return time.process_time() - began


def beam_seconds() -> float:
    """Follow the beam's orbit; return the processor time, s."""
    modes, tip, amplitude = beam(8)
    with Structure(modes, [restitution(tip, amplitude)]) as body:
        body.advance(SETTLING * PERIOD)
        began = time.process_time()
        body.advance(BEAM_PERIODS * PERIOD)
        return time.process_time() - began


def in_turns(run: Callable[[], float], libraries: dict[str, CDLL], repetitions: int) -> list[float]:
    """Return the additional cost of the watched core, %, in each repetition."""
    more = []
    for turn in range(repetitions):
        seconds = {}
        for name in sorted(libraries, reverse=bool(turn % 2)):
            forget_libraries()
            with (
                patch.object(oscillator, "core_library", lambda name=name: libraries[name]),
                patch.object(structure, "library_with_doors", lambda name=name: libraries[name]),
            ):
                seconds[name] = run()
        more.append(100.0 * (seconds["watched"] / seconds["unwatched"] - 1.0))
    forget_libraries()
    return more


def forget_libraries() -> None:
    """Clear the caches, so that the next call loads its library anew."""
    oscillator._library.cache_clear()
    structure._library.cache_clear()


def checksum_percent(points: int) -> float:
    """Return the time of hashing over the time of the chunks, %."""
    scene = parse_scene(SCENE.format(transient=300, points=points), "bench.toml")
    with tempfile.TemporaryDirectory() as folder:
        chunks = run_campaign(scene, Path(folder, "campaign"), workers=WORKERS).chunks
        parts = Path(folder, "parts")
        parts.mkdir()
        work = Work(scene, str(parts))
        get_ready(work)
        began = time.process_time()
        for chunk in chunks:
            run_chunk(work, chunk)
        computing = time.process_time() - began
        contents = {path: path.read_bytes()[:-LINE_LENGTH] for path in parts.iterdir()}
        began = time.process_time()
        for path, content in contents.items():
            closing_line(content)
            if not matches_recorded_hash(path):
                raise SystemExit(f"{path.name}: expected the content that its hash was recorded of.")
        return 100.0 * (time.process_time() - began) / computing


def main() -> int:
    """Measure and print; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=15)
    parser.add_argument("--points", type=int, default=4000)
    arguments = parser.parse_args()
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        libraries = {}
        for name in ("watched", "unwatched"):
            Path(folder, name).mkdir()
            libraries[name] = build(Path(folder, name), watched=name == "watched")
        for body, run in (("oscillator", oscillator_seconds), ("beam, 8 modes", beam_seconds)):
            more = in_turns(run, libraries, arguments.repetitions)
            worst = max(worst, statistics.median(more))
            print(
                f"step budget, {body}: {statistics.median(more):+.1f} % ({min(more):+.1f}..{max(more):+.1f})"
            )
    hashing = checksum_percent(arguments.points)
    worst = max(worst, hashing)
    print(f"checksums, campaign of {arguments.points} points: {hashing:+.2f} %")
    verdict = "within" if worst <= MOST_PERCENT else "beyond"
    print(
        f"Each is asked to cost at most {MOST_PERCENT:g} %: the dearest, {worst:+.1f} %, is {verdict} that."
    )
    return int(worst > MOST_PERCENT)


if __name__ == "__main__":
    sys.exit(main())
