"""A chain of 12 masses with stiff dashpots: the number of an integrator's steps shows whether it has the Jacobian.

PyFMI and CasADi compute the Jacobian by setting states one by one. PyFMI ignores a refusal, and its Jacobian is zero
then. Its steps become those of a method for non-stiff problems: 5,669,129 in place of 3,238 in a chain of five masses.
Runs in the Python with the tool.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from exchange._single import Request, Rows

MASSES = 12
STOP_TIME = 5.0
TOLERANCE = 1e-6
MOST_STEPS = 5000
"""Largest number of steps with the Jacobian, with a margin; without the Jacobian it is a hundred times as large."""
STARTS = {
    **{f"mass[{k}]": 1.0 + 0.1 * k for k in range(1, MASSES + 1)},
    **{f"stiffness[{k}]": 1000.0 for k in range(1, MASSES + 1)},
    **{f"damping[{k}]": 3e5 for k in range(1, MASSES + 1)},
    **{f"displacement_start[{k}]": 0.01 * (-1) ** k for k in range(1, MASSES + 1)},
    "forcing.angular_frequency": 20.0,
    **{f"forcing.amplitude[{k}]": 100.0 for k in range(1, MASSES + 1)},
}
VERSIONS = {"FMPy": ("2.0", "3.0"), "CasADi": ("2.0", "3.0"), "PyFMI": ("2.0", "3.0")}
"""Tools that report the number of their steps."""


def fmpy(request: Request) -> Rows:
    """Count the steps of FMPy's CVode."""
    import ctypes

    from fmpy import simulate_fmu, sundials
    from fmpy.sundials.libraries import sundials_cvode

    made: list[Any] = []

    class Kept(sundials.CVodeSolver):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **{**options, "maxNumSteps": -1})
            made.append(self)

    usual, sundials.CVodeSolver = sundials.CVodeSolver, Kept
    try:
        simulate_fmu(
            request["fmu"],
            fmi_type="ModelExchange",
            solver="CVode",
            relative_tolerance=request["tolerance"],
            stop_time=request["stop_time"],
            output_interval=request["stop_time"],
        )
    finally:
        sundials.CVodeSolver = usual
    steps = ctypes.c_long()
    sundials_cvode.CVodeGetNumSteps(ctypes.c_void_p(made[0].cvode_mem), ctypes.byref(steps))
    return [[float(steps.value)]]


def casadi(request: Request) -> Rows:
    """Count the steps of CasADi's CVodes."""
    import casadi as ca

    folder = Path("unpacked")
    with zipfile.ZipFile(request["fmu"]) as archive:
        archive.extractall(folder)
    dae = ca.DaeBuilder("chain", str(folder.absolute()))
    dynamics = dae.create("dynamics", ["t", "x"], ["ode"])
    t, x = ca.MX.sym("t"), ca.MX.sym("x", len(dae.x()))
    problem = {"t": t, "x": x, "ode": dynamics(t, x)}
    options = {"reltol": request["tolerance"], "abstol": request["tolerance"] * 1e-2, "max_num_steps": 10**7}
    flight = ca.integrator("flight", "cvodes", problem, 0.0, request["stop_time"], options)
    flight(x0=dae.start(dae.x()))
    return [[float(flight.stats()["nsteps"])]]


def pyfmi(request: Request) -> Rows:
    """Count the steps of PyFMI's CVode."""
    from pyfmi import load_fmu

    model = load_fmu(request["fmu"], kind="me")
    options = model.simulate_options()
    options["ncp"] = 1
    options["result_handling"] = "binary"
    options["CVode_options"] |= {"rtol": request["tolerance"], "verbosity": 50}
    found = model.simulate(final_time=request["stop_time"], options=options)
    return [[float(found.solver.statistics["nsteps"])]]


DRIVERS: dict[str, Callable[[Request], Rows]] = {"FMPy": fmpy, "CasADi": casadi, "PyFMI": pyfmi}
