"""Cost of the modes of a solid of 50,000 unknowns: read, reduced to 60 modes with residual vectors, and kept.

A steel bar of 8 x 8 x 205 elements of eight nodes is held at one end; its matrices have 3.4 million entries each. They
are read from Matrix Market files (or from .npz files: `--format npz`) in processes of their own. Each run is a process
with a cache of its own. Processor times and peak memories include the readers.
Other solids (`--cells 12 12 200` has 101,400 unknowns) have no goals.
Run with `python tests/benchmarks/bench_reduction.py [--format mtx] [--cells 8 8 205] [--output results]`.
"""

from __future__ import annotations

import argparse
import csv
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import scipy.io
import scipy.sparse

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.finite_elements import solid

CELLS = (8, 8, 205)
NATURAL, POINTS = 60, ("16685.x", "16685.y", "8000.x", "12000.y")
#: Goals: processor time of the first run, s, its peak memory, GB, and the processor time of a run with kept modes, s.
MOST_SECONDS, MOST_MEMORY, MOST_KEPT_SECONDS = 15.0, 1.0, 1.0
RUN = """
import sys
from pathlib import Path
from vibroimpact.orchestrator.structures.find import find_modes
from vibroimpact.orchestrator.structures.request import Request
folder, kind, *points = sys.argv[1:]
request = Request(f"stiffness.{{kind}}", f"mass.{{kind}}", Path(folder), {{}}, freedoms="freedoms.csv",
                  named=tuple(points), modes={modes})
found = find_modes(request)
print(found.natural[0] / 6.283185307179586, found.residual_vectors, found.error)
"""


def write_matrices(folder: Path, kind: str, cells: tuple[int, int, int] = CELLS) -> int:
    """Write the matrices of a bar, and return the number of its unknowns."""
    model = solid(cells, 0.00125)
    for name in ("stiffness", "mass"):
        matrix = getattr(model, name)
        if kind == "npz":
            scipy.sparse.save_npz(folder / f"{name}.npz", matrix)
        else:
            scipy.io.mmwrite(folder / f"{name}.mtx", matrix, symmetry="symmetric")
    (folder / "freedoms.csv").write_text("name\n" + "\n".join(model.freedoms) + "\n", encoding="ascii")
    return len(model.freedoms)


def measured(folder: Path, kind: str) -> tuple[float, float, str]:
    """Return the processor time, s, the peak memory of the largest process so far, GB, and the output of a run."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-c", RUN.format(modes=NATURAL + len(POINTS)), str(folder), kind, *POINTS]
    environment = os.environ | {"VIBROIMPACT_CACHE": str(folder / "cache")}
    text = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, after.ru_maxrss / 1e6, text.strip()


def main() -> int:
    """Measure, print and write a CSV; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--format", choices=("mtx", "npz"), default="mtx")
    parser.add_argument("--cells", type=int, nargs=3, default=CELLS)
    parser.add_argument("--output", type=Path, default=Path("results/bench_reduction"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        unknowns = write_matrices(folder, options.format, tuple(options.cells))
        first, memory, text = measured(folder, options.format)
        again, _, kept = measured(folder, options.format)
    if text != kept:
        raise AssertionError(f"expected the kept modes to be equal, got {text} and {kept}.")
    rows = [("read and reduced", first), ("kept", again)]
    options.output.mkdir(parents=True, exist_ok=True)
    with (options.output / "reduction.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("case", "s"), *rows, ("memory, GB", memory)])
    print(f"{unknowns} unknowns; first frequency, Hz, residual vectors and error: {text}")
    print(f"read and reduced: {first:.1f} s, {memory:.2f} GB; kept: {again:.2f} s")
    if tuple(options.cells) != CELLS:
        return 0
    missed = first > MOST_SECONDS or memory > MOST_MEMORY or again > MOST_KEPT_SECONDS
    goals = f"{MOST_SECONDS:g} s, {MOST_MEMORY:g} GB and {MOST_KEPT_SECONDS:g} s"
    print(f"goals of {goals}: {'missed' if missed else 'reached'}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
