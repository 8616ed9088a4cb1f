"""Accuracy of coupling: two oscillators with a spring between them over a ladder of macro steps, by each exchange.

The ladder is printed, written as a dataset and drawn: errors, energy drifts and residuals of the interface, wall times.

Run with `python tests/benchmarks/bench_exchange.py [FOLDER]`.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import xarray as xr

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.coupled_parts import EXCHANGES, body, link, values

from vibroimpact.analysis.dataset.provenance import git_commit, versions
from vibroimpact.analysis.landmarks import observed_order
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.master import Importer

STIFFNESS, SPRING, END = 1.0, 0.1, 50.0
ROUNDING = 1e-12
"""Energy drift, J, below which it is rounding and written as 0: it has no order."""
STEPS = np.array([0.4, 0.2, 0.1, 0.05, 0.025, 0.0125])


def exact_pair(t: float) -> np.ndarray:
    """Return displacements and velocities of both masses: the normal modes 1 and sqrt(1.2) rad/s."""
    w = math.sqrt(STIFFNESS + 2.0 * SPRING)
    same, against = (math.cos(t), -math.sin(t)), (math.cos(w * t), -w * math.sin(w * t))
    return 0.5 * np.array(
        [same[0] + against[0], same[0] - against[0], same[1] + against[1], same[1] - against[1]]
    )


def pair_energy(state: np.ndarray) -> float:
    """Return the energy of both masses and the three springs, J."""
    x, v = state[:2], state[2:]
    return float(0.5 * (v @ v + STIFFNESS * (x @ x) + SPRING * (x[0] - x[1]) ** 2))


def exchanged(exchange: str, step: float) -> tuple[float, float, float, float]:
    """Return largest error (m), energy drift (J), residual of the interface (J) and seconds of one run."""
    soft = {"stiffness": STIFFNESS + SPRING}
    links = [link("b.displacement", "a.force", SPRING), link("a.displacement", "b.force", SPRING)]
    importer = Importer(
        [body("a", {**soft, "displacement_start": 1.0}), body("b", soft)],
        links,
        exchange=exchange,  # type: ignore[arg-type]
        macro_step=step,
    )
    energy = InterfaceEnergy(importer, links)
    importer.begin()
    energy.begin(links)
    began, error = time.perf_counter(), 0.0
    for t in np.arange(1.0, END + 0.5):
        importer.advance(float(t))
        state = np.array(
            [v for name in ("displacement", "velocity") for c in "ab" for v in values(importer, c, name)]
        )
        error = max(error, float(np.abs(state - exact_pair(float(t)))[:2].max()))
    seconds = time.perf_counter() - began
    drift = pair_energy(state) - pair_energy(exact_pair(0.0))
    drift = drift if abs(drift) > ROUNDING else 0.0
    residual = float(energy.residuals().sum())
    importer.free()
    return error, drift, residual, seconds


def exchange_dataset() -> xr.Dataset:
    """Measure all exchanges on the ladder of macro steps."""
    found = np.array([[exchanged(exchange, float(step)) for step in STEPS] for exchange in EXCHANGES])
    axes = ("exchange", "macro_step")
    words = {
        "error": ("m", "largest error of a displacement"),
        "energy_drift": ("J", "energy gained"),
        "interface_residual": ("J", "energy residual of the connections"),
        "wall_time": ("s", "wall time"),
    }
    dataset = xr.Dataset(
        {
            name: (axes, found[:, :, i], {"units": unit, "long_name": long_name})
            for i, (name, (unit, long_name)) in enumerate(words.items())
        },
        coords={
            "exchange": ("exchange", list(EXCHANGES), {"long_name": "exchange of values"}),
            "macro_step": ("macro_step", STEPS, {"units": "s", "long_name": "macro step"}),
        },
        attrs={
            "title": "Two oscillators as two FMUs, spring between them",
            "Conventions": "CF-1.11",
            "source": f"vibroimpact {versions()['vibroimpact']}, tests/benchmarks/bench_exchange.py",
            "versions": json.dumps(versions()),
            "git_commit": git_commit(),
        },
    )
    for name in ("error", "energy_drift"):
        orders = [observed_order(STEPS, dataset[name].values[i]) for i in range(len(EXCHANGES))]
        dataset[f"{name}_order"] = (
            "exchange",
            orders,
            {"units": "1", "long_name": f"observed order of {name}"},
        )
    return dataset


def exchange_table(folder: Path) -> None:
    """Print, write and draw the ladder."""
    dataset = exchange_dataset()
    print(f"\ntwo oscillators, spring {SPRING} N/m, {END:g} s: largest error, m (energy drift, J)")
    print("  H, s    " + "".join(f"{exchange:>26}" for exchange in EXCHANGES))
    for i, step in enumerate(STEPS):
        cells = [
            f"{dataset['error'].values[k, i]:14.1e} ({dataset['energy_drift'].values[k, i]:8.1e})"
            for k in range(len(EXCHANGES))
        ]
        print(f"  {step:<8g}" + "".join(f"{cell:>26}" for cell in cells))
    orders = [
        f"{dataset['error_order'].values[k]:14.2f} ({dataset['energy_drift_order'].values[k]:8.2f})"
        for k in range(len(EXCHANGES))
    ]
    print("  order   " + "".join(f"{cell:>26}" for cell in orders))
    path = folder / "coupled_exchange.nc"
    dataset.to_netcdf(path)
    print(f"  dataset: {path}")
    try:
        from vibroimpact.analysis.figures import convergence, save, work_precision
    except ImportError as error:
        print(f"  no figure: {error}")
        return
    figure, costs = folder / "coupled_exchange.png", folder / "coupled_exchange_work_precision.png"
    save(convergence(dataset), figure)
    save(work_precision(dataset), costs)
    print(f"  figures: {figure}, {costs}")


def main() -> None:
    """Measure the ladder; print, write and draw it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results"), help="folder of the results")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    exchange_table(folder)


if __name__ == "__main__":
    main()
