"""The frequency response from a simulated sweep of the forcing frequency."""

from __future__ import annotations

import os

import numpy as np

from vibroimpact.analysis.dataset.clock import refuse_several_forces
from vibroimpact.analysis.dataset.schema import Outcome, scene_of, swept_names
from vibroimpact.analysis.dataset.stores.runs import read_runs
from vibroimpact.analysis.decay.resonance import Curve
from vibroimpact.analysis.decay.samples import Floats
from vibroimpact.fmus.errors import DatasetError

_FEWEST_RUNS = 8


def swept_response(
    path: str | os.PathLike[str],
    drive_amplitude: float = 1.0,
    drive_unit: str = "1",
    band: tuple[float, float] | None = None,
) -> tuple[Curve, tuple[str, ...]]:
    """Return the amplitude against the forcing frequency over the runs of a campaign, and remarks.

    The amplitude is half the range of the displacement, over the amplitude of the drive. Runs that hit a stop have no
    frequency response, and are left out.

    Parameters
    ----------
    path : path
        Dataset of a campaign that sweeps `forcing.angular_frequency` or `forcing.frequency`.
    drive_amplitude : float
        Amplitude of the drive in `drive_unit`; with 1, the modal constant contains it.
    drive_unit : str
        CF unit: `N`, or `1`.
    band : tuple of float, optional
        Band in Hz; runs outside are left out.

    Raises
    ------
    DatasetError
        Nothing is swept, no extrema are recorded, or too few runs remain.
    """
    flat = read_runs(path)
    refuse_several_forces(scene_of(flat.attrs), os.fspath(path))
    swept = swept_names(flat)
    name = next((name for name in ("angular_frequency", "frequency") if name in swept), None)
    if name is None or "displacement_max" not in flat:
        raise DatasetError(
            f"{os.fspath(path)}: expected a sweep of the forcing frequency with extrema, got none. "
            "Sweep forcing.angular_frequency and record extrema."
        )
    half = 0.5 * (flat.displacement_max.values - flat.displacement_min.values)
    free = flat.outcome.values == int(Outcome.ok)
    if "impact_count" in flat:
        free &= flat.impact_count.values == 0
    free &= np.all(np.isfinite(half), axis=1)
    omega = np.asarray(flat[name].values * (2.0 * np.pi if name == "frequency" else 1.0), dtype=np.float64)
    if band is not None:
        hertz = omega / (2.0 * np.pi)
        free &= (hertz >= band[0]) & (hertz <= band[1])
    if np.count_nonzero(free) < _FEWEST_RUNS:
        raise DatasetError(
            f"{os.fspath(path)}: expected {_FEWEST_RUNS} runs or more that touch no stop, got {np.count_nonzero(free)} "
            f"of {len(free)}. Sweep a wider range, or with less forcing."
        )
    omega, half = omega[free], half[free]
    amplitude = np.mean(half, axis=1) / drive_amplitude
    order = np.argsort(omega, kind="stable")
    unit = "kg-1" if drive_unit == "N" else "m s-2"
    if flat.attrs.get("units_system") == "nondimensional":
        unit = "1"
    curve = Curve(omega[order], amplitude[order], np.zeros(len(order)), "displacement", unit)
    others = [key for key in swept if key != name]
    return curve, _remarks(int(np.count_nonzero(~free)), others, half)


def _remarks(left_out: int, others: list[str], half: Floats) -> tuple[str, ...]:
    found = []
    if left_out:
        found.append(f"{left_out} runs that hit a stop, or did not finish, are left out.")
    if others:
        found.append(f"{', '.join(others)} is swept too: runs of all its values are taken together.")
    spread = float(np.max(np.ptp(half, axis=1) / np.max(half)))
    if spread > 1e-6:
        found.append(f"amplitudes still change by {spread:.1g} between periods: the transients are not over.")
    return tuple(found)
