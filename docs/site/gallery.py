"""Make the pictures of the gallery by their own commands: `python docs/site/gallery.py FOLDER`.

The commands of the index in examples/README.md run and draw every scene of it. Then every kind of figure is drawn,
from those runs where possible. `gallery_page.py` makes the page of the same lists.
"""

from __future__ import annotations

import re
import shlex
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.signal import lsim

from vibroimpact.analysis import open_dataset
from vibroimpact.orchestrator.commands.cli import main
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
INDEX = ROOT / "examples" / "README.md"
#: Folder of the pictures in a build of the site.
PICTURES = ROOT / "build" / "docs" / "gallery"
_ROW = re.compile(
    r"^\| \[\w+\]\([\w/.]+\) \| (?P<shows>.*?) \| `(?P<run>vibroimpact (?:run|basins|maps) .*?)` \| `(?P<plot>.*?)` \|$"
)
_USER_LAW = "user_contact_law"


@dataclass(frozen=True)
class Picture:
    """One picture of the gallery.

    Attributes
    ----------
    file : str
        Name of the file in the folder of the gallery.
    shows : str
        One line in Markdown.
    commands : tuple of str
        Commands that make it, in the root of the project.
    """

    file: str
    shows: str
    commands: tuple[str, ...]


def scenes() -> list[Picture]:
    """Return a picture of every scene without foreign parts, in the order of the index."""
    text = INDEX.read_text(encoding="utf-8")
    found = [match for line in text.splitlines() if (match := _ROW.match(line))]
    pictures = [Picture(_output(row["plot"]), row["shows"], (row["run"], row["plot"])) for row in found]
    blocks = [
        block
        for block in re.findall(r"^```\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
        if _USER_LAW in block
    ]
    own = tuple(blocks[0].splitlines())
    return [*pictures, Picture(_output(own[-1]), "a stop whose law is a function in Python", own)]


def kinds() -> dict[str, Picture]:
    """Return a picture of every kind of figure. Their files are made in this order, after those of the scenes."""
    board, fit = "examples/recordings/board.toml", "--fit body.frequency,body.damping_ratio,sensor.gain"
    fine = 'sweep."stop[1].position"={start=0.0005,stop=0.004,points=36}'
    span = "--parameter forcing.angular_frequency --from 0.6 --to 1.6"
    hit = "vibroimpact import hit.csv --name base --name board --unit g -o hit.nc"
    return {
        "bifurcation": _of("bifurcation", "bifurcation"),
        "branches": _of(
            "branches", "branches", f"vibroimpact follow examples/bifurcation.toml {span} -o branches.nc"
        ),
        "diagram": _of(
            "diagram", "diagram", "vibroimpact diagram examples/bifurcation.toml --points 20 -o diagram.nc"
        ),
        "classes": _of("classes", "classes", "vibroimpact classify bifurcation.nc -o classes.nc"),
        "map": _of("map", "fine", f"vibroimpact run examples/gap_sweep.toml -o fine.nc --set '{fine}'"),
        "impacts-per-period": _of("impacts-per-period", "fine"),
        "impact-frequency": _of("impact-frequency", "figure_2_7"),
        "strobe": _of("strobe", "bifurcation"),
        "run": _of("run", "chatter"),
        "steps": _of(
            "steps",
            "steps",
            "vibroimpact run examples/two_oscillators.toml --set execution.macro_step=auto -o steps.nc",
        ),
        "portrait": _of("portrait", "two_stops"),
        "impact-map": _of("impact-map", "figure_2_11"),
        "return-map": _of("return-map", "figure_2_11"),
        "spectrum": _of("spectrum", "single_run"),
        "density": _of("density", "single_run"),
        "energies": _of("energies", "figure_6_15"),
        "shapes": _of("shapes", "figure_7_2"),
        "recording": _of("recording", "hit", hit),
        "replay": _of("replay", "fit", f"vibroimpact replay {board} hit.nc -o fit.nc {fit}"),
        "scores": _of("scores", "grid", "vibroimpact replay grid.toml hit.nc -o grid --workers 2"),
        "estimates": _of("estimates", "found", "vibroimpact estimate impacts single_run.nc -o found.nc"),
        "intervals": _of("intervals", "trains", "vibroimpact spikes figure_2_11.nc -o trains.nc"),
        "accuracy": _of(
            "accuracy", "study", "vibroimpact accuracy examples/single_run.toml -o study.nc --tolerance 1e-6"
        ),
        "effects": _of(
            "effects", "parts", "vibroimpact effects examples/thesis/figure_7_11.toml -o parts.nc"
        ),
        "sensitivity": _of("sensitivity", "shares", "vibroimpact sensitivity tolerances.nc -o shares.nc"),
        "modes": _of(
            "modes",
            "shapes",
            "vibroimpact modes examples/bracket/bracket.sti.gz --point tip=42.z -o shapes.nc",
        ),
        "resonances": _of(
            "resonances", "peaks", "vibroimpact resonances examples/thesis/figure_6_4.toml -o peaks.nc"
        ),
        "lyapunov": _of(
            "lyapunov",
            "exponents",
            "vibroimpact lyapunov examples/bifurcation.toml --set record.recorded_periods=400 -o exponents.nc",
        ),
        "maps": _of(
            "maps",
            "sets",
            "vibroimpact maps examples/thesis/figure_2_12.toml --kind discontinuity -o sets.nc",
        ),
        "basins": _of("basins", "basins", "vibroimpact basins examples/basins.toml -o basins.nc"),
        "basin_shares": _of(
            "basin_shares",
            "basin_shares",
            "vibroimpact basins examples/basins.toml --parameter forcing.angular_frequency --from 0.9 --to 1.6 "
            "--points 20 -o basin_shares.nc",
        ),
        "control": _of(
            "control",
            "kept",
            "vibroimpact control examples/bifurcation.toml --from 1 --to 0.7 --step 1e-3 -o kept.nc",
        ),
        "transients": _of(
            "transients", "transients", "vibroimpact transients examples/basins.toml -o transients.nc"
        ),
        "hard-cases": _of("hard-cases", "cases", "vibroimpact hard-cases -o cases.nc"),
        "convergence": _of("convergence", "ladder"),
        "work-precision": _of("work-precision", "ladder"),
    }


def _of(kind: str, data: str, *before: str) -> Picture:
    file = f"kind_{kind}.png"
    name = "grid" if data == "grid" else f"{data}.nc"
    draw = f"vibroimpact plot {name} --kind {kind} -o {file}"
    return Picture(file, f"`{kind}`", (*before, draw))


def _output(command: str) -> str:
    words = shlex.split(command)
    return words[words.index("-o") + 1]


def make(folder: Path) -> None:
    """Make all pictures.

    Raises
    ------
    RuntimeError
        A command fails; its messages are on the standard error output.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    shutil.copytree(ROOT / "examples", folder / "examples")
    with chdir(folder):
        for picture in scenes():
            _run_all(picture)
        write_hit(Path("hit.csv"))
        write_grid(Path("grid.toml"))
        measure_ladder(Path("examples/two_oscillators.toml")).to_netcdf("ladder.nc")
        for picture in kinds().values():
            _run_all(picture)


def _run_all(picture: Picture) -> None:
    for command in picture.commands:
        try:
            main(shlex.split(command)[1:])
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"gallery: `{command}` ended with exit code {end.code}.") from end


def write_hit(path: Path) -> None:
    """Write a made-up measurement: a board of one mode, 802 Hz and damping ratio .01, hit through its base.

    Columns are time (s), acceleration of the base (g) and of the board (g), both with noise.
    """
    rate, natural, damping = 50_000.0, 2.0 * np.pi * 802.0, 0.01
    instants = np.arange(2500) / rate
    pulse = 500.0 * np.exp(-0.5 * ((instants - 0.003) / 0.0001) ** 2)
    # absolute acceleration of a mass on a spring and a dashpot with a moving foot
    damper, spring = 2.0 * damping * natural, natural**2
    _, board, _ = lsim(([damper, spring], [1.0, damper, spring]), pulse, instants)
    noise = np.random.default_rng(1).normal(size=(2, instants.size))
    columns = np.column_stack([instants, pulse + 0.5 * noise[0], 1.2 * board + 0.5 * noise[1]])
    np.savetxt(path, columns, fmt="%.6f", delimiter=",", header="time,base,board", comments="")


def write_grid(path: Path) -> None:
    """Write the scene of the board with a sweep of frequency and damping ratio in place of a fit."""
    text = Path("examples/recordings/board.toml").read_text(encoding="utf-8")
    sweep = [
        '"body.damping_ratio" = { values = [0.005, 0.0075, 0.01, 0.0125, 0.015] }',
        '"body.frequency" = { start = 790.0, stop = 814.0, points = 49 }',
    ]
    path.write_text("\n".join([text, "[sweep]", *sweep, ""]), encoding="utf-8")


def measure_ladder(scene: Path) -> xr.Dataset:
    """Return errors of two coupled oscillators, over the macro step and the exchange scheme.

    The reference is the motion in closed form: one mass is (cos t + cos(sqrt(1.2) t)) / 2, the energy is constant.
    """
    steps, ways = [0.02, 0.04, 0.08, 0.16], ["jacobi", "gauss_seidel", "iterated"]
    measured = np.array([[_errors(scene, way, step) for step in steps] for way in ways])
    units = ("m", "1", "s")
    return xr.Dataset(
        {
            name: (("exchange", "macro_step"), measured[..., place], {"units": units[place]})
            for place, name in enumerate(("error", "energy_drift", "wall_time"))
        },
        coords={"exchange": ways, "macro_step": ("macro_step", steps, {"units": "s"})},
    )


def _errors(scene: Path, exchange: str, step: float) -> tuple[float, float, float]:
    changes = [f"execution.exchange={exchange}", f"execution.macro_step={step}"]
    loaded = load_scene(scene, changes)
    start = time.perf_counter()
    run_scene(loaded, Path("rung.nc"))
    seconds = time.perf_counter() - start
    with open_dataset("rung.nc") as run:
        instants, (a, v, b, w) = _samples(run)
    exact = 0.5 * (np.cos(instants) + np.cos(np.sqrt(1.2) * instants))
    energy = 0.5 * (v**2 + w**2 + a**2 + b**2 + 0.1 * (a - b) ** 2)
    return float(np.abs(a - exact).max()), float(np.ptp(energy) / energy[0]), seconds


def _samples(run: xr.Dataset) -> tuple[NDArray[np.float64], Iterator[NDArray[np.float64]]]:
    names = ("a_displacement", "a_velocity", "b_displacement", "b_velocity")
    return run["time"].values.ravel(), (run[name].values.ravel() for name in names)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("gallery: expected one argument, the folder of the pictures, got another number of them.")
    make(Path(sys.argv[1]).resolve())
