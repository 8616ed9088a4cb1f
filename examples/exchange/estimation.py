"""Parameters of an oscillator at a stop from a recorded displacement: FMPy runs the FMU, which gives the derivatives.

Each run returns the displacement and its derivatives over the parameters since the start, through every impact.
Gauss and Newton's method therefore needs one run an iteration, and no differences.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from fmpy import simulate_fmu

import vibroimpact as vi

KEYS = ("contact[1].restitution", "contact[1].position", "forcing.amplitude", "stiffness", "damping")
TRUE = np.array([0.7, 0.6, 0.5, 1.0, 0.2])
GUESS = np.array([0.74, 0.61, 0.51, 0.98, 0.22])
STARTS: dict[str, float | str] = {
    "forcing.angular_frequency": 1.0,
    "contact[1].law": "restitution",
    "contact[1].position": 0.6,
}


def run(fmu: Path, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacement and its derivatives over the keys, at 400 instants of 20 s."""
    columns = [f"sensitivity.displacement.{key}" for key in KEYS]
    rows = simulate_fmu(
        str(fmu),
        start_values=dict(zip(KEYS, values, strict=True)),
        output=["displacement", *columns],
        output_interval=0.05,
        stop_time=20.0,
    )
    return rows["displacement"], np.array([rows[column] for column in columns]).T


def estimate(fmu: Path, record: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the parameters whose run is the record; print each iteration."""
    for iteration in range(20):
        found, slopes = run(fmu, values)
        step = np.linalg.lstsq(slopes, record - found, rcond=None)[0]
        values = values + step
        print(f"{iteration}: residual {np.linalg.norm(record - found):.2e}, {np.round(values, 9)}")
        if np.abs(step).max() < 1e-10:
            break
    return values


def main() -> int:
    """Record a run of the true parameters, and find them again."""
    with tempfile.TemporaryDirectory() as folder:
        fmu = vi.fmus.export(
            "Oscillator", Path(folder, "body.fmu"), starts=STARTS, sensitivities=",".join(KEYS)
        )
        record, _ = run(fmu, TRUE)
        found = estimate(fmu, record, GUESS)
    print(f"largest error: {np.abs(found - TRUE).max():.1e}")
    return 0 if np.abs(found - TRUE).max() < 1e-6 else 1


if __name__ == "__main__":
    sys.exit(main())
