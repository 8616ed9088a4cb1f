"""A master of CasADi solves a loop through two FMUs: a rigid rod joins two oscillators.

The rod's force is an input of both bodies, and their accelerations, which follow from it at once, must be equal.
CasADi's Newton method finds the force at each instant by the FMUs' directional derivatives. The two bodies then move
like one.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from pathlib import Path

import casadi as ca
import numpy as np

import vibroimpact as vi

FIRST = {"mass": 1.0, "stiffness": 1.0, "damping": 0.1}
SECOND = {"mass": 2.0, "stiffness": 5.0, "damping": 0.3}
START, END, STEPS = 0.1, 10.0, 1000  # m, s


def rate_of(parameters: dict[str, float], folder: Path) -> ca.Function:
    """Return the derivatives of a body's states, from the states and the force of the rod."""
    fmu = vi.fmus.export(
        "Oscillator", folder / "body.fmu", starts={**parameters, "displacement_start": START}
    )
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder / "unpacked")
    dae = ca.DaeBuilder(folder.name, str(folder / "unpacked"))
    force, place = ca.MX.sym("force"), dae.u().index("force")
    u = ca.vertcat(*[0.0] * place, force, *[0.0] * (len(dae.u()) - place - 1))
    x = ca.MX.sym("x", 2)
    return ca.Function("rate", [x, force], [dae.create("ode", ["x", "u"], ["ode"])(x, u)])


def joined(first: ca.Function, second: ca.Function) -> ca.Function:
    """Return the derivatives of both bodies, with the force of the rod between them."""
    x, force = ca.MX.sym("x", 4), ca.MX.sym("force")
    apart = first(x[:2], force)[1] - second(x[2:], -force)[1]
    solve = ca.rootfinder("solve", "newton", {"x": force, "p": x, "g": apart})
    found = solve(x0=0.0, p=x)["x"]
    return ca.Function("joined", [x], [ca.vertcat(first(x[:2], found), second(x[2:], -found)), found])


def exact(time: float) -> float:
    """Return the displacement of one body with both masses, springs and dashpots."""
    mass, stiffness, damping = (FIRST[name] + SECOND[name] for name in ("mass", "stiffness", "damping"))
    decay = 0.5 * damping / mass
    rate = np.sqrt(stiffness / mass - decay**2)
    return float(START * np.exp(-decay * time) * (np.cos(rate * time) + decay / rate * np.sin(rate * time)))


def main() -> int:
    """Integrate by Runge and Kutta's rule of order 4, and compare with the one body."""
    with tempfile.TemporaryDirectory() as folder:
        folders = [Path(folder, name) for name in ("first", "second")]
        for one in folders:
            one.mkdir()
        rate = joined(*(rate_of(given, one) for given, one in zip((FIRST, SECOND), folders, strict=True)))
        x, h = np.array([START, 0.0, START, 0.0]), END / STEPS
        for _ in range(STEPS):
            k1 = np.array(rate(x)[0]).ravel()
            k2 = np.array(rate(x + 0.5 * h * k1)[0]).ravel()
            k3 = np.array(rate(x + 0.5 * h * k2)[0]).ravel()
            k4 = np.array(rate(x + h * k3)[0]).ravel()
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        force = float(rate(x)[1])
    error, gap = abs(x[0] - exact(END)), abs(x[0] - x[2])
    print(
        f"displacement {x[0]:.9f} m, error {error:.1e} m; the rod is {gap:.1e} m longer; its force is {force:.6f} N"
    )
    return 0 if error < 1e-8 and gap < 1e-10 else 1


if __name__ == "__main__":
    sys.exit(main())
