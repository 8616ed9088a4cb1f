"""Cost of model exchange against co-simulation: seconds per impact and error, one driven mass with a rigid stop.

FMPy steps the FMU by its own exact motion (co-simulation), and integrates it by CVode (model exchange) at a ladder of
tolerances. The third run is by this package. The error compares the last impact's time with the exact time.
A scene of components then has the mass without its stop, and an ImpactStop in a `[[contact]]`, in both kinds.

Run with `python tests/benchmarks/bench_model_exchange.py [FOLDER]`.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import xarray as xr

import vibroimpact as vi
from vibroimpact.analysis.dataset.provenance import git_commit, versions
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.shipped import fmu_path
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, RunAs, StopContactSpec

TOLERANCES = np.array([1e-4, 1e-6, 1e-8, 1e-10])
PERIODS = 100
OWN_PERIODS = 100 * PERIODS
"""Forcing periods of the run by this package, whose start and end alone take tenths of a second."""
REPETITIONS = 3
FREQUENCY = 0.9
PERIOD, STEPS = 2.0 * math.pi / FREQUENCY, 8
"""Forcing period, s, and communication steps in it of the scenes of components."""
VALUES = {
    "damping": 0.1,
    "forcing.amplitude": 0.5,
    "forcing.angular_frequency": FREQUENCY,
    "contact[1].law": 1,
    "contact[1].position": 0.1,
    "contact[1].restitution": 0.7,
}
SCENE = {
    "body": {"kind": "oscillator", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
    "forcing": {"amplitude": 0.5, "angular_frequency": FREQUENCY},
    "stop": [{"position": 0.1, "restitution": 0.7}],
    "record": {"transient_periods": 0, "recorded_periods": OWN_PERIODS},
}


def quickest(run: Callable[[], Any]) -> tuple[Any, float]:
    """Return the result and the time, s, of the quickest of some repetitions."""
    seconds, result = math.inf, None
    for _ in range(REPETITIONS):
        began = time.perf_counter()
        result = run()
        seconds = min(seconds, time.perf_counter() - began)
    return result, seconds


def simulated(kind: str, tolerance: float = 1e-6) -> tuple[float, float, float]:
    """Return the number of impacts, the time of the last one, s, and the seconds of a run by FMPy."""
    folder = str(unpack(fmu_path("Oscillator")).folder)

    def run() -> Any:
        return fmpy.simulate_fmu(
            folder,
            fmi_type=kind,
            solver="CVode",
            relative_tolerance=tolerance,
            start_values=VALUES,
            stop_time=PERIODS * PERIOD,
            output_interval=PERIOD,
            output=["contact[1].count", "contact[1].last_time"],
            record_events=False,
        )

    result, seconds = quickest(run)
    return float(result["contact[1].count"][-1]), float(result["contact[1].last_time"][-1]), seconds


def in_contact(run_as: RunAs, tolerance: float | None = None) -> tuple[float, float]:
    """Return the time of the last impact, s, and the seconds of a run of the mass and an ImpactStop."""
    free = {name: value for name, value in VALUES.items() if not name.startswith("contact")}
    mass = ComponentSpec("mass", fmu_path("Oscillator"), free, tolerance, run_as)
    stop = ComponentSpec("stop", fmu_path("ImpactStop"), {"restitution": 0.7, "position": 0.1})
    contact = StopContactSpec("mass", "displacement", "velocity", "force", "stop", 1.0)
    importer = Importer([mass, stop], contacts=[contact], macro_step=PERIOD / STEPS)

    def run() -> float:
        importer.begin()
        importer.advance(PERIODS * PERIOD)
        return importer.contacts.held[0].impacts.all[-1].time

    last, seconds = quickest(run)
    importer.free()
    return last, seconds


def measured() -> xr.Dataset:
    """Measure model exchange at all tolerances, and co-simulation and the run by this package once."""
    _, own = quickest(lambda: vi.run(SCENE))
    count, exact, stepped = simulated("CoSimulation")
    ladder = np.array([simulated("ModelExchange", float(t)) for t in TOLERANCES])
    contacts = np.array([in_contact("model_exchange", float(t)) for t in TOLERANCES])
    pulses, pulsed = in_contact("co_simulation")
    return xr.Dataset(
        {
            "impacts": ("tolerance", ladder[:, 0], {"units": "1", "long_name": "impacts"}),
            "error": (
                "tolerance",
                np.abs(ladder[:, 1] - exact),
                {"units": "s", "long_name": "error of the last impact's time"},
            ),
            "wall_time": ("tolerance", ladder[:, 2], {"units": "s", "long_name": "wall time"}),
            "contact_error": (
                "tolerance",
                np.abs(contacts[:, 0] - exact),
                {"units": "s", "long_name": "error of the last impact's time, [[contact]] in model exchange"},
            ),
            "contact_wall_time": (
                "tolerance",
                contacts[:, 1],
                {"units": "s", "long_name": "wall time, [[contact]] in model exchange"},
            ),
            "contact_co_simulation_error": (
                (),
                abs(pulses - exact),
                {"units": "s", "long_name": "error of the last impact's time, [[contact]] in co-simulation"},
            ),
            "contact_co_simulation_wall_time": (
                (),
                pulsed,
                {"units": "s", "long_name": "wall time, [[contact]] in co-simulation"},
            ),
            "co_simulation_wall_time": ((), stepped, {"units": "s", "long_name": "wall time, co-simulation"}),
            "own_wall_time": (
                (),
                own * PERIODS / OWN_PERIODS,
                {"units": "s", "long_name": "wall time of as many periods, this package's run"},
            ),
            "co_simulation_impacts": ((), count, {"units": "1", "long_name": "impacts, co-simulation"}),
        },
        coords={"tolerance": ("tolerance", TOLERANCES, {"units": "1", "long_name": "relative tolerance"})},
        attrs={
            "title": "Model exchange beside co-simulation",
            "Conventions": "CF-1.11",
            "source": f"vibroimpact {versions()['vibroimpact']}, tests/benchmarks/bench_model_exchange.py",
            "versions": json.dumps(versions()),
            "git_commit": git_commit(),
        },
    )


def table(dataset: xr.Dataset) -> None:
    """Print the ladder."""
    count, stepped = float(dataset.co_simulation_impacts), float(dataset.co_simulation_wall_time)
    print(
        f"{PERIODS} periods, {count:.0f} impacts; co-simulation in FMPy: {stepped / count * 1e6:.0f} us an impact"
    )
    print(f"this package's run: {float(dataset.own_wall_time) / stepped:.2f} of that")
    print("  tolerance   impacts   error of the last impact, s   cost / co-simulation")
    for row in range(dataset.sizes["tolerance"]):
        at = dataset.isel(tolerance=row)
        ratio = float(at.wall_time) / stepped
        print(f"  {float(at.tolerance):9.0e} {float(at.impacts):9.0f} {float(at.error):29.1e} {ratio:22.1f}")
    pulsed = float(dataset.contact_co_simulation_wall_time)
    print(f"  [[contact]] in co-simulation: {pulsed / count * 1e6:.0f} us an impact, ", end="")
    print(f"error of the last impact {float(dataset.contact_co_simulation_error):.1e} s")
    print("  tolerance   error of the last impact, s   cost / that   ([[contact]] in model exchange)")
    for row in range(dataset.sizes["tolerance"]):
        at = dataset.isel(tolerance=row)
        ratio = float(at.contact_wall_time) / pulsed
        print(f"  {float(at.tolerance):9.0e} {float(at.contact_error):29.1e} {ratio:13.2f}")


def main() -> None:
    """Measure, print, write a dataset."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results"), help="folder of the results")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    dataset = measured()
    table(dataset)
    path = folder / "model_exchange.nc"
    dataset.to_netcdf(path)
    print(f"  dataset: {path}")


if __name__ == "__main__":
    main()
