"""`make peers`: measure all ways on all problems, write record, figure and page; `--page` reuses the record."""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported: processor time then counts one thread

from peers.jax_flights import one_thread  # noqa: E402

one_thread()

from support.places import ROOT  # noqa: E402

from peers.figure import draw, finite  # noqa: E402
from peers.measure import cost_of_a_run, measured  # noqa: E402
from peers.page import with_measurement  # noqa: E402
from peers.problems import cases, orbit  # noqa: E402
from vibroimpact.analysis.figures.page import page_style  # noqa: E402

RECORD, PICTURE, PAGE = (
    ROOT / "docs" / name for name in ("accuracy/peers.json", "accuracy/peers.png", "accuracy.md")
)
PACKAGES = ("numpy", "scipy", "FMPy", "scikit-sundae", "diffrax", "jax", "mujoco")


DOTS = 110
"""Resolution of the picture, dots per inch: a page has many pictures."""


def machine() -> dict[str, str]:
    """Return the processor and the versions of the packages, for the record of the figures."""
    model = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").is_file():
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), model)
    found = {"processor": model, "cores": str(os.cpu_count()), "Python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def measure(keys: Sequence[str]) -> None:
    """Measure the problems with these keys, or all without a key; save each to the record once it is measured."""
    for case in cases():
        if keys and case.key not in keys:
            continue
        print(case.title, file=sys.stderr, flush=True)
        found, reference = measured(case)
        rows = [row.record() | {"cost": finite(row.cost)} for row in found]
        summary = {"key": case.key, "title": case.title, **{key: finite(v) for key, v in reference.items()}}
        _put(summary, rows)


def _put(case: dict[str, Any], rows: list[dict[str, Any]]) -> None:
    old = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {"cases": [], "rows": []}
    order = [one.key for one in cases()]
    entries = [one for one in old["cases"] if one["key"] != case["key"]] + [case]
    kept = [row for row in old["rows"] if row["case"] != case["key"]] + rows
    record = {
        "date": datetime.date.today().isoformat(),
        "machine": machine(),
        "one_period": finite(cost_of_a_run(orbit(1))),
        "cases": sorted(entries, key=lambda one: order.index(one["key"])),
        "rows": sorted(kept, key=lambda row: order.index(row["case"])),
    }
    RECORD.parent.mkdir(exist_ok=True)
    RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def main() -> int:
    """Measure, or reuse the existing record; write figure and page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--page", action="store_true", help="measure nothing: figure and page from the record"
    )
    parser.add_argument(
        "--only", nargs="*", default=[], metavar="PROBLEM", help="measure these; keep the others' rows"
    )
    options = parser.parse_args()
    if not options.page:
        measure(options.only)
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    with page_style():
        draw(record).savefig(PICTURE, dpi=DOTS)
    PAGE.write_text(with_measurement(PAGE.read_text(encoding="utf-8"), record), encoding="utf-8")
    print(f"{RECORD}, {PICTURE}, {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
