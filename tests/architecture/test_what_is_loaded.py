"""Commands and names of `vi` load a heavy package only if they compute with it."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.places import EXAMPLES, ROOT, TESTS
from support.public_names import COMMANDS

import vibroimpact as vi

PACKAGES = ("analysis", "door", "fmus", "hardware", "orchestrator", "service")

BASIS = ("numpy", "pandas", "xarray", "netCDF4")
"""Packages that most commands need. Commands of `LIGHT` do not; for the others they are loaded once, beforehand."""
HEAVY = (
    "dask",
    "distributed",
    "fastapi",
    "fmpy",
    "grpc",
    "httpx",
    "matplotlib",
    "nidaqmx",
    "pint",
    "scipy",
    "uvicorn",
    "zarr",
)
WHEN_USED = ("pint", "scipy")
"""Packages that are imported only inside the functions that compute with them."""
SCENE = """
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.05
[forcing]
amplitude = 1.0
angular_frequency = 0.9
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = 20
recorded_periods = 40
time_series = { rate = 20, variables = ["displacement"] }
"""
SWEEP = """
[sweep]
"forcing.angular_frequency" = { start = 0.8, stop = 1.0, points = 5 }
"""
DRAWN = """
[sweep]
sample = { design = "saltelli", points = 8, seed = 2 }
"forcing.amplitude" = { distribution = "uniform", low = 1.0, high = 2.0 }
"body.damping_ratio" = { distribution = "uniform", low = 0.05, high = 0.1 }
"""
NOWHERE = "http://127.0.0.1:1"
"""Address without a service."""
RECOGNIZED = "dask pint scipy"
"""Packages that xarray imports to recognize an array of theirs when it computes; `dask.array` loads scipy."""
Rows = dict[str, tuple[str, int]]
LIGHT: Rows = {
    "--help": ("", 0),
    "--version": ("", 0),
    "run --help": ("", 0),
    "fmu list": ("numpy", 0),
    "fmu build --output scene.toml": ("numpy", 2),
    "fmu export oscillator -o body.fmu": ("numpy", 0),
    "fmu serve absent.fmu": ("grpc numpy", 2),
    f"submit scene.toml --service {NOWHERE} --data served": ("httpx", 1),
    f"status --service {NOWHERE} --data served": ("httpx", 1),
    f"fetch 0123456789abcdef0123456789abcdef -o fetched.nc --service {NOWHERE} --data served": ("httpx", 1),
    f"cancel 0123456789abcdef0123456789abcdef --service {NOWHERE} --data served": ("httpx", 1),
}
"""Commands that need no datasets, with the packages of `BASIS` and `HEAVY` that they may load, and their exit code."""
OTHERS: Rows = {
    "check scene.toml": ("", 0),
    "run scene.toml -o run.nc": ("", 0),
    "run swept.toml -o swept.nc": ("", 0),
    "describe run.nc": ("", 0),
    "accuracy scene.toml --tolerance 0": ("", 2),
    "effects scene.toml -o absent/effects.nc": ("", 2),
    "replay scene.toml signal.nc -o replayed.nc": ("", 2),
    "orbit scene.toml --impacts 1": ("", 0),
    "control scene.toml --from 0.9 --to 0.89 --step 0": ("", 2),
    "fmu check body.fmu": ("fmpy", 0),
    "ssp export two_oscillators.toml -o two.ssp": ("fmpy", 0),
    "ssp import two.ssp -o imported.toml": ("fmpy", 0),
    "classify swept.nc": ("dask", 0),
    "convert swept.nc swept.zarr": ("zarr", 0),
    "run drawn.toml -o drawn.nc": ("scipy", 0),
    "follow scene.toml --parameter forcing.angular_frequency --from 0.88 --to 0.9": ("scipy", 0),
    "diagram scene.toml --parameter forcing.angular_frequency --from 0.88 --to 0.9 --values 3 --parts sweep": (
        "scipy dask",
        0,
    ),
    # the names of connections are labels
    "run two_oscillators.toml -o two.nc": (f"{RECOGNIZED} fmpy", 0),
    "sensitivity drawn.nc": (RECOGNIZED, 0),
    "hard-cases --only grazing-from-below": (RECOGNIZED, 0),
    "import signal.csv --rate 100 --unit m -o signal.nc": (RECOGNIZED, 0),
    "estimate decay signal.nc": (RECOGNIZED, 0),
    "estimate impacts run.nc --angular-frequency 0.9 --channel displacement": (RECOGNIZED, 0),
    "estimate bounces signal.nc": (RECOGNIZED, 1),
    "estimate response signal.nc --drive absent": (RECOGNIZED, 2),
    "spikes signal.nc": (RECOGNIZED, 0),
    "fmu replay signal.nc -o signal.fmu": (RECOGNIZED, 0),
    "lyapunov swept.nc": (RECOGNIZED, 0),
    "energies swept.nc": (RECOGNIZED, 0),
    "resonances swept.nc": (RECOGNIZED, 2),
    "modes absent.csv": (RECOGNIZED, 2),
    "basins scene.toml --points 5": (RECOGNIZED, 0),
    "transients scene.toml --starts 1": (RECOGNIZED, 0),
    # xarray looks for a scheduler of Dask when it writes
    "maps --kind square-root --points 20 --from 0.1 --to 0.2 -o map.nc": (f"{RECOGNIZED} distributed", 0),
    "plot swept.nc -o swept.png": ("dask matplotlib", 0),
    "campaign swept.toml -o few": ("", 0),
    # no worker answers there: only the client's own needs are loaded
    "campaign swept.toml -o campaign --scheduler tcp://127.0.0.1:1": ("dask distributed", 2),
    "demo -o scene.toml": ("dask distributed matplotlib", 2),
    "rig devices --rig virtual:oscillator.toml": ("grpc nidaqmx", 0),
    "rig serve absent.toml": ("grpc nidaqmx", 2),
    "rig record --rig virtual:oscillator.toml --channel tip=Dev9/ai0,5 --rate 1000 -o r.nc": (
        "grpc nidaqmx",
        2,
    ),
    "rig spikes --rig virtual:oscillator.toml --channel a=Dev9/ai0,5 --rate 1000 --threshold 1 -o s.nc": (
        "grpc nidaqmx",
        2,
    ),
    "rig recover absent.journal": ("grpc nidaqmx", 2),
    "rig sine --output Dev1/ao0 --frequency 5 --amplitude 99": ("grpc nidaqmx", 2),
    "rig sweep sweep.toml -o rig_sweep --dry-run": (f"{RECOGNIZED} grpc matplotlib nidaqmx", 0),
    "serve --data served --host 192.0.2.1": ("dask distributed fastapi fmpy matplotlib uvicorn", 2),
}
"""All other commands, with the packages of `HEAVY` that they may load, and their exit code."""
NAMES = {
    "figures": "matplotlib",
    "draw": "matplotlib",
    **dict.fromkeys(("export_fmu", "export_ssp", "import_ssp"), "fmpy"),
    **dict.fromkeys(("drive_sine", "record", "record_spikes", "recover"), "grpc nidaqmx"),
}
"""Names of `vi` that load packages of `HEAVY`, with these packages; all others load none."""
CALLS: Rows = {
    "vi.run('scene.toml', progress=False)": ("", 0),
    "vi.cost_of('scene.toml')": ("", 0),
    "vi.runner('scene.toml', 'forcing.amplitude')(1.0)": ("", 0),
    "vi.find_orbits('scene.toml', 1)": ("", 0),
    "vi.classify(vi.open_dataset('swept.nc'))": ("dask", 0),
    "vi.draw(vi.open_dataset('swept.nc'))": ("dask matplotlib", 0),
}
"""Calls, with the packages of `HEAVY` that they may load."""
WARM = OTHERS | {f"vi.{name}": (NAMES.get(name, ""), 0) for name in dir(vi)} | CALLS


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, set[str], str]]:
    """Return for each row exit code, modules that the rows before it in its group had not loaded, end of output."""
    folder = tmp_path_factory.mktemp("loaded")
    for name, text in (("scene", SCENE), ("swept", SCENE + SWEEP), ("drawn", SCENE + DRAWN)):
        (folder / f"{name}.toml").write_text(text)
    decay = (f"{0.99**n * math.cos(0.3 * n)}\n" for n in range(400))
    (folder / "signal.csv").write_text("signal\n" + "".join(decay))
    (folder / "served").mkdir()
    (folder / "served" / "token").write_text("0" * 64)
    for name in (
        "two_oscillators.toml",
        "rig/oscillator.toml",
        "rig/oscillator_scene.toml",
        "rig/sweep.toml",
    ):
        shutil.copy(EXAMPLES / name, folder)
    cold, warm = grouped(LIGHT), grouped(WARM)
    orders = [
        {"beforehand": (), "looked_for": (*BASIS, *HEAVY), "groups": [list(map(order_of, g)) for g in cold]},
        {"beforehand": BASIS, "looked_for": HEAVY, "groups": [list(map(order_of, g)) for g in warm]},
    ]
    found: dict[str, tuple[int, set[str], str]] = {}
    for group, ended in zip((*cold, *warm), answers(orders, folder), strict=True):
        before: set[str] = set()
        for row, (code, modules, said) in zip(group, ended, strict=True):
            found[row] = (code, set(modules) - before, said)
            before = set(modules)
    return found


def grouped(rows: Rows) -> list[list[str]]:
    """Return rows grouped by allowed packages: one process runs a group, and names its first row that loads more."""
    groups: dict[str, list[str]] = {}
    for row, (may_load, _) in rows.items():
        groups.setdefault(may_load, []).append(row)
    return list(groups.values())


def order_of(row: str) -> list[str] | str:
    """Return a row in the form that the other process reads."""
    return f"import vibroimpact as vi; {row}" if row.startswith("vi.") else row.split()


def answers(orders: list[dict[str, object]], folder: Path) -> list[list[tuple[int, list[str], str]]]:
    """Return the answers to all groups of some orders, from a process that has loaded nothing of the package."""
    command = [sys.executable, "-P", str(TESTS / "support" / "loaded_modules.py")]
    # Python warns of a fork when threads run, and OpenBLAS would start some
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "COLUMNS": "200"}
    done = subprocess.run(
        command, input=json.dumps(orders), capture_output=True, text=True, cwd=folder, env=environment
    )
    assert (done.returncode, done.stderr) == (0, "")
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("row", [*LIGHT, *WARM])
def test_a_command_or_name_loads_no_heavy_package_that_it_does_not_use(
    row: str, loaded: dict[str, tuple[int, set[str], str]]
) -> None:
    may_load, code = (LIGHT | WARM)[row]
    ended, modules, said = loaded[row]
    assert ended == code, said
    assert modules <= set(may_load.split())


def test_a_package_that_is_used_is_seen_to_be_loaded(loaded: dict[str, tuple[int, set[str], str]]) -> None:
    assert "matplotlib" in loaded["plot swept.nc -o swept.png"][1]
    assert "numpy" in loaded["fmu list"][1]
    assert "grpc" in loaded["rig devices --rig virtual:oscillator.toml"][1]


def test_every_command_has_a_row() -> None:
    listed = {
        line.removeprefix("vibroimpact ")
        for line in COMMANDS.read_text(encoding="utf-8").splitlines()
        if line.startswith("vibroimpact ")
    }
    groups = {name.split()[0] for name in listed if " " in name}
    rows = [*LIGHT, *OTHERS]
    assert [
        name for name in sorted(listed - groups) if not any(f"{row} ".startswith(f"{name} ") for row in rows)
    ] == []


def test_no_module_imports_what_only_some_of_its_functions_compute_with() -> None:
    at_once = re.compile(rf"^(?:from|import) (?:{'|'.join(WHEN_USED)})\b", re.MULTILINE)
    paths = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    assert len(paths) > 500
    assert [str(path) for path in paths if at_once.search(path.read_text(encoding="utf-8"))] == []
