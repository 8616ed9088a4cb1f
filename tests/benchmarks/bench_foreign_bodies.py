"""A body of another tool in contact with a compliant stop: energy of one elastic contact, and cost of an impact.

The body is a mass that holds a force over a step (`tests/support/fmus/mass.c`). It is free or on a spring of its own,
and its states can be saved or not. Three parts:

- one contact, by a plain connection of the stop's force and by `[[contact]]`, over the steps per contact
- rigid impacts: random masses, speeds and restitutions against the closed form, and a long run
- microseconds per impact, also of a body of this package with the stop in another FMU, and fused

Each compliant law leaves a dataset and a figure.

Run with `python tests/benchmarks/bench_foreign_bodies.py [FOLDER]`.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.compliant_parts import FREE, contact_time, follows, yielding_contact, yielding_stop
from support.coupled_parts import VERSIONS, body, events_of, link, part, values
from support.energy_ladders import energy_ladder
from support.fmu_factory import mass
from support.held_parts import held
from support.pair_parts import hit

from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import BodyPoint, PairSpec

STEPS = np.array([8, 15, 30, 60, 120, 240])
STIFFNESS = {"kelvin_voigt": 1e4, "hertz": 1e6}
SPRING, WAY, SPEED = 100.0, 0.1, 2.0
"""Stiffness of the body's own spring, N/m; position of the stop, m; velocity at time 0, m/s."""
METHODS = ("plain", "free", "free_stateless", "spring", "spring_stateless")
DEFAULT_STEPS, GOAL = 30, 1e-6
"""Steps per contact of the goal, and the largest relative energy error of a contact with them."""
ROUNDING = 1e-11
"""Relative error below which it is rounding and written as 0: it has no order."""
REPETITIONS = 5


def error_and_residual(law: str, method: str, steps: int, folder: Path) -> tuple[float, float]:
    """Return the energy gained in one contact and the reported residual, both relative."""
    spring = SPRING if method.startswith("spring") else 0.0
    start = {"v": SPEED, "k": spring}
    stop = yielding_stop("s", law, {"stiffness": STIFFNESS[law]}, WAY)
    step = contact_time(law, STIFFNESS[law]) * (SPEED**-0.2 if law == "hertz" else 1.0) / steps
    if method == "plain":
        links = [
            link("b.x", "s.displacement"),
            link("b.v", "s.velocity"),
            link("s.applied_force", "b.f", -1.0),
        ]
        importer = Importer([part("b", mass(folder), **start), stop], links, macro_step=step)
        energy = InterfaceEnergy(importer, links)
        importer.begin()
        energy.begin(links)
    else:
        run = held(
            folder,
            [stop],
            start,
            states=not method.endswith("stateless"),
            macro_step=step if spring else 1.0,
            contact_steps=float(steps),
        )
        importer, energy = run.importer, run.energy
    importer.advance(2.0 * WAY / SPEED)
    displacement, velocity = values(importer, "b", "x", "v")
    importer.free()
    before = 0.5 * SPEED**2
    return (
        0.5 * (velocity**2 + spring * displacement**2) / before - 1.0,
        float(energy.residuals().sum()) / before,
    )


def ladder(law: str, folder: Path) -> xr.Dataset:
    """Measure all methods on the ladder of steps."""
    found = np.array([[error_and_residual(law, m, int(n), folder) for n in STEPS] for m in METHODS])
    energies = np.where(np.abs(found[:, :, 0]) > ROUNDING, found[:, :, 0], 0.0)
    words = {
        "error": (SPEED * (np.sqrt(1.0 + energies) - 1.0), "m/s", "error of the speed after the contact"),
        "energy_drift": (energies, "1", "energy gained, relative"),
        "interface_residual": (found[:, :, 1], "1", "energy residual as reported, relative"),
    }
    methods, steps = (METHODS, "body and how its force is given"), (STEPS, "step / contact time")
    title = f"One elastic contact of a foreign mass, {law}"
    return energy_ladder(words, methods, steps, title, "bench_foreign_bodies.py")


def table(law: str, dataset: xr.Dataset) -> None:
    """Print the ladder of one law."""
    print(f"\n{law}: relative energy error of one elastic contact (residual reported)")
    print("  steps   " + "".join(f"{method:>24}" for method in METHODS))
    for i, n in enumerate(STEPS):
        cells = [
            f"{dataset['energy_drift'].values[k, i]:10.1e} ({dataset['interface_residual'].values[k, i]:8.1e})"
            for k in range(len(METHODS))
        ]
        print(f"  {n:<8d}" + "".join(f"{cell:>24}" for cell in cells))


def draw(dataset: xr.Dataset, figure: Path) -> None:
    """Write the figure of errors over the step, where matplotlib is installed."""
    try:
        from vibroimpact.analysis.figures import convergence, save
    except ImportError as error:
        print(f"  no figure: {error}")
        return
    save(convergence(dataset), figure)
    print(f"  figure: {figure}")


# ---- rigid impacts ----

IMPACTS, SEED = 200, 13
LONG_RUN = 2000.0
"""Duration of a run in which an own and a foreign body hit each other about every 3.5 s, s."""


def rigid_errors(version: str, ours: bool, folder: Path) -> tuple[float, float, float]:
    """Return the largest relative errors of momentum, closing speed and energy over impacts with random parameters."""
    fmu, random, worst = mass(folder, version), np.random.default_rng(SEED), np.zeros(3)
    for _ in range(IMPACTS):
        lower, upper, speed = (float(10.0**power) for power in random.uniform(-3.0, 3.0, 3))
        restitution = float(random.uniform(0.0, 1.0))
        other = hit("b", version=version, mass=upper, stiffness=0.0) if ours else part("b", fmu, m=upper)
        ends = BodyPoint("a", "x", "v", "f", lower), BodyPoint("b", "x", "v", "f", upper)
        pair = PairSpec(ends[0], ("b", "contact[1]") if ours else ends[1], 0.5, restitution=restitution)
        importer = Importer([part("a", fmu, v=speed, m=lower), other], pairs=[pair], macro_step=0.3 / speed)
        importer.begin()
        importer.advance(0.6 / speed)
        (one,), (two,) = values(importer, "a", "v"), values(importer, "b", "velocity" if ours else "v")
        importer.free()
        after = 0.5 * lower * speed**2 * (1.0 - (1.0 - restitution**2) * upper / (lower + upper))
        found = (
            (lower * one + upper * two) / (lower * speed) - 1.0,
            (two - one) / speed - restitution,
            0.5 * (lower * one**2 + upper * two**2) / after - 1.0,
        )
        worst = np.maximum(worst, np.abs(found))
    return float(worst[0]), float(worst[1]), float(worst[2])


def long_run(version: str, folder: Path) -> tuple[int, float, float]:
    """Return impacts, relative energy gain and seconds of a run with an own and a foreign body on springs."""
    theirs = part("b", mass(folder, version), m=3.0, k=3.0)
    pair = PairSpec(("a", "contact[1]"), BodyPoint("b", "x", "v", "f", 3.0), 0.2)
    importer = Importer(
        [hit("a", version=version, displacement_start=-1.0), theirs], pairs=[pair], macro_step=0.5
    )
    importer.begin()
    events = events_of(importer)
    began = time.perf_counter()
    importer.advance(LONG_RUN)
    seconds = time.perf_counter() - began
    v, x = values(importer, "a", "velocity", "displacement")
    w, y = values(importer, "b", "v", "x")
    importer.free()
    return len(events), v * v + x * x + 3.0 * (w * w + y * y) - 1.0, seconds


def rigid_table(folder: Path) -> None:
    """Print the errors of rigid impacts."""
    print(f"\nrestitution: largest errors of {IMPACTS} random impacts    momentum  closing speed  energy")
    for version in VERSIONS:
        for ours in (False, True):
            label = f"FMI {version}, two foreign bodies" if not ours else f"FMI {version}, foreign and ours"
            cells = "".join(f"{error:12.1e}" for error in rigid_errors(version, ours, folder))
            print(f"  {label:40}{cells}")
    for version in VERSIONS:
        impacts, gained, seconds = long_run(version, folder)
        print(
            f"  FMI {version}: {impacts} impacts in a run gain {gained:.1e} of the energy, "
            f"{seconds / impacts * 1e6:.0f} us each with the flight before it"
        )


# ---- microseconds per impact ----

CONTACTS = 40
"""Contacts of a mass that travels to and fro between two springs at -1 and 1 m."""
CYCLE = 4.0 + 2.0 * math.pi / 100.0


def shuttle(kind: str, folder: Path) -> Callable[[], None]:
    """Return a function that runs the contacts once."""
    sides = (("high", 1.0, "upper"), ("low", -1.0, "lower"))
    stops = [yielding_stop(n, "kelvin_voigt", {"stiffness": 1e4}, p, side) for n, p, side in sides]
    if kind == "fused":
        inside = {
            f"contact[{k}].{name}": value
            for k, (_, position, side) in enumerate(sides, 1)
            for name, value in (
                ("law", "kelvin_voigt"),
                ("position", position),
                ("side", side),
                ("stiffness", 1e4),
            )
        }
        importer = Importer([body("b", {**FREE, **inside})])
    elif kind == "ours":
        own = {**FREE, **follows(1.0), **follows(-1.0, "lower", k=2)}
        links = [*yielding_contact("b", "high", 1), *yielding_contact("b", "low", 2)]
        importer = Importer([body("b", own), *stops], links)
    else:
        importer = held(folder, stops, {"v": 1.0}, states=kind == "foreign, states", macro_step=10.0).importer

    def run() -> None:
        importer.begin()
        importer.advance(0.5 * CONTACTS * CYCLE)

    return run


def impact_table(folder: Path) -> None:
    """Print microseconds per impact."""
    kinds = ("fused", "ours", "foreign, states", "foreign, no states")
    tasks = {kind: shuttle(kind, folder) for kind in kinds}
    seconds: dict[str, list[float]] = {kind: [] for kind in kinds}
    for _ in range(REPETITIONS):
        for kind, task in tasks.items():
            began = time.perf_counter()
            task()
            seconds[kind].append((time.perf_counter() - began) / CONTACTS)
    print(f"\ncontact with a spring over {DEFAULT_STEPS} steps     median      min  us per impact")
    for kind, found in seconds.items():
        print(f"  {kind:34}{statistics.median(found) * 1e6:10.1f}{min(found) * 1e6:10.1f}")


def main() -> int:
    """Measure, print, write datasets and figures; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results"), help="folder of the results")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    held = True
    with tempfile.TemporaryDirectory() as made:
        for law in STIFFNESS:
            dataset = ladder(law, Path(made))
            table(law, dataset)
            path = folder / f"foreign_bodies_{law}.nc"
            dataset.to_netcdf(path)
            print(f"  dataset: {path}")
            draw(dataset, path.with_suffix(".png"))
            worst = float(np.abs(dataset["energy_drift"].values[1:, list(STEPS).index(DEFAULT_STEPS)]).max())
            held = held and worst <= GOAL
            verdict = "met" if worst <= GOAL else "MISSED"
            print(
                f"  [[contact]] at {DEFAULT_STEPS} steps: {worst:.1e} of the energy; goal <= {GOAL:g}: {verdict}"
            )
        rigid_table(Path(made))
        impact_table(Path(made))
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
