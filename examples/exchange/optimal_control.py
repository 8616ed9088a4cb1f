"""The least force that keeps an oscillator on a periodic motion P(1,1): CasADi optimizes, our FMU is the flight.

The flight between two impacts is the ODE of the FMU, whose exact Jacobian CasADi gets by directional derivatives.
The impact is a constraint: the flight begins at the stop with the rebound, and ends there after one period with the
impact velocity.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from fmpy import simulate_fmu

import vibroimpact as vi

STOP, RESTITUTION, IMPACT, PERIOD = 0.5, 0.7, 0.8, 2.0 * np.pi  # m, 1, m/s, s
INTERVALS, SUBSTEPS = 40, 3  # of the force, which is constant in each; of its integration
BODY = {"mass": 1.0, "stiffness": 1.0, "damping": 0.2}
INPUTS = ("force", "force_rate", "base_acceleration", "base_acceleration_rate")
START = {"displacement_start": STOP, "velocity_start": -RESTITUTION * IMPACT}
CONTACT: dict[str, float | str] = {
    "contact[1].law": "restitution",
    "contact[1].position": STOP,
    "contact[1].restitution": RESTITUTION,
}


def flight_of(fmu: Path, folder: Path) -> ca.Function:
    """Return the state after one interval, from the state and the force."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    dae = ca.DaeBuilder("body", str(folder))
    inputs = [0.0] * len(dae.u())
    x, force, force_at = ca.MX.sym("x", 2), ca.MX.sym("force"), dae.u().index("force")
    ode = dae.create("ode", ["x", "u"], ["ode"])
    u = ca.vertcat(*inputs[:force_at], force, *inputs[force_at + 1 :])
    h, state = PERIOD / INTERVALS / SUBSTEPS, x
    for _ in range(SUBSTEPS):  # Runge and Kutta's rule of order 4
        k1 = ode(state, u)
        k2 = ode(state + 0.5 * h * k1, u)
        k3 = ode(state + 0.5 * h * k2, u)
        k4 = ode(state + h * k3, u)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return ca.Function("flight", [x, force], [state])


def least_force(flight: ca.Function) -> np.ndarray:
    """Return the forces of the intervals that make the motion periodic with the least sum of squares."""
    problem = ca.Opti()
    x, force = problem.variable(2, INTERVALS + 1), problem.variable(INTERVALS)
    problem.minimize(ca.sumsqr(force))
    for i in range(INTERVALS):
        problem.subject_to(x[:, i + 1] == flight(x[:, i], force[i]))
        problem.subject_to(x[0, i] <= STOP)
    problem.subject_to(x[:, 0] == ca.vertcat(STOP, -RESTITUTION * IMPACT))  # after the impact
    problem.subject_to(x[:, INTERVALS] == ca.vertcat(STOP, IMPACT))  # before the next
    quiet: dict[str, Any] = {
        "print_level": 0,
        "sb": "yes",
        "hessian_approximation": "limited-memory",
        "tol": 1e-10,
    }
    problem.solver("ipopt", {"print_time": False}, quiet)
    return np.array(problem.solve().value(force))


def main() -> int:
    """Optimize, and let the FMU run three periods with its stop under the forces found."""
    with tempfile.TemporaryDirectory() as folder:
        fmu = vi.fmus.export("Oscillator", Path(folder, "body.fmu"), starts={**BODY, **CONTACT, **START})
        force = least_force(flight_of(fmu, Path(folder, "unpacked")))
        size = PERIOD / INTERVALS
        signal = np.zeros(3 * INTERVALS + 1, dtype=[(name, float) for name in ("time", *INPUTS)])
        signal["time"] = size * np.arange(len(signal))
        signal["force"] = np.append(np.tile(force, 3), force[0])
        end = simulate_fmu(
            str(fmu),
            fmi_type="CoSimulation",
            input=signal,
            start_values={"force": force[0]},
            output=["displacement", "velocity", "contact[1].count", "contact[1].impulse"],
            step_size=size,
            output_interval=size,
            stop_time=3.0 * PERIOD,
        )[-1]
    velocity = end["contact[1].impulse"] / (1.0 + RESTITUTION)
    print(f"rms force {np.sqrt(np.mean(force**2)):.6f} N, {end['contact[1].count']} impacts in 3 periods")
    print(f"last impact at {velocity:.6f} m/s, asked {IMPACT} m/s")
    return 0 if abs(velocity - IMPACT) < 1e-4 else 1


if __name__ == "__main__":
    sys.exit(main())
