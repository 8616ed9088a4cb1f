"""Bodies of several modes: measured coordinates projected on modes, then weak form and restitution (thesis 6.3).

With mass-normalised shapes the kinetic energy is half the sum of the squares of the modal velocities. At an impact at
a point of shape phi, displacements stay, and the speed of the point changes from V to -r V.

With the contact mass m_c = 1 / (phi . phi), the energy lost is
RE = sum_j (q_j'(before)^2 - q_j'(after)^2) / 2 = (1 - r^2) m_c V^2 / 2.
So r = sqrt(1 - RE / KE) with KE = m_c V^2 / 2 (thesis eq. 6.38). Modes that are left out take energy that then counts
as lost: the restitution from too few modes is too low.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.estimation.estimates import MethodEstimate
from vibroimpact.analysis.estimation.flight_fit import FittedFlight, fit_flight, pairs_of
from vibroimpact.analysis.estimation.noise import noise_level
from vibroimpact.analysis.estimation.physics import Floats, Forcing, Parameters
from vibroimpact.analysis.estimation.segments import Flight, segment
from vibroimpact.analysis.estimation.signals import Signal
from vibroimpact.analysis.estimation.weak_form import (
    linear_estimate,
    robust_weak_form,
    weak_form,
    weighted_flights,
)
from vibroimpact.fmus.errors import EstimationError

_WORST_PROJECTION = 1e6
# Standard errors by which noise may put the restitution of a nearly elastic stop above 1.
_BEYOND_NOISE = 3.0


@dataclass(frozen=True, slots=True)
class ModalEstimates:
    """Estimates for a body of several modes from its impacting motion.

    Attributes
    ----------
    damping_ratio, natural_frequency, force : tuple of MethodEstimate
        Of each mode: the ratio, rad/s, and N kg^(-1/2).
    restitution : MethodEstimate
        From the speeds of the contact point.
    restitution_from_energy : MethodEstimate
        From the residual energy and the contact mass; equal to `restitution` where all modes are included.
    contact_mass : float
        1 / (phi . phi) of the modes in use, kg.
    impacts : int
        Number of impacts with a usable flight on both sides.
    """

    damping_ratio: tuple[MethodEstimate, ...]
    natural_frequency: tuple[MethodEstimate, ...]
    force: tuple[MethodEstimate, ...]
    restitution: MethodEstimate
    restitution_from_energy: MethodEstimate
    contact_mass: float
    impacts: int


def modal_coordinates(displacements: Floats, shapes: Floats) -> Floats:
    """Return the modal displacements from sensor displacements, by least squares.

    Parameters
    ----------
    displacements : ndarray, shape (sensor, sample)
        m.
    shapes : ndarray, shape (sensor, mode)
        Displacement of each sensor's point for unit modal displacements, kg^(-1/2).

    Returns
    -------
    ndarray, shape (mode, sample)
        kg^(1/2) m.

    Raises
    ------
    EstimationError
        Fewer sensors than modes, or sensors that cannot separate the modes.

    Examples
    --------
    >>> modal_coordinates(np.array([[1.0], [3.0]]), np.array([[1.0, 1.0], [1.0, -1.0]])).round(12).tolist()
    [[2.0], [-1.0]]
    """
    sensors, modes = shapes.shape
    condition = math.inf if sensors < modes else float(np.linalg.cond(shapes))
    if not condition < _WORST_PROJECTION:
        raise EstimationError(
            f"modal coordinates: expected at least as many sensors as modes, at points that tell the modes apart, got "
            f"{sensors} sensors, {modes} modes, condition {condition:.3g}. Leave out modes or add sensors."
        )
    return np.asarray(np.linalg.lstsq(shapes, displacements, rcond=None)[0], dtype=np.float64)


def restitution_from_energy(residual: float, kinetic: float) -> float:
    """Return r = sqrt(1 - RE / KE) (thesis eq. 6.38).

    Raises
    ------
    EstimationError
        Not 0 <= RE <= KE: the data or the contact mass contradict themselves; nothing is clipped.

    Examples
    --------
    >>> round(restitution_from_energy(0.64, 1.0), 12)
    0.6
    """
    if not 0.0 <= residual <= kinetic:
        raise EstimationError(
            f"restitution: expected 0 <= residual energy <= kinetic energy of the contact mass, got {residual:.4g} and "
            f"{kinetic:.4g} J. Contact mass, shapes or damping are not what the motion shows."
        )
    return math.sqrt(1.0 - residual / kinetic)


def estimate_modes(
    time: Floats,
    coordinates: Floats,
    contact_shape: Floats,
    forcing: Forcing,
    *,
    fastest: float,
    stop_position: float | None = None,
    side: str | None = None,
    draws: int = 20,
    confidence: float = 0.95,
    seed: int = 0,
) -> ModalEstimates:
    """Estimate every mode and the restitution from modal coordinates of impacting motion.

    Parameters
    ----------
    time : ndarray, shape (sample,)
        s.
    coordinates : ndarray, shape (mode, sample)
        See `modal_coordinates`.
    contact_shape : ndarray, shape (mode,)
        Displacement of the contact point for unit modal displacements, kg^(-1/2).
    forcing : Forcing
        Angular frequency and phase; amplitudes are estimated for each mode.
    fastest : float
        Approximate natural angular frequency of the highest mode, rad/s.
    stop_position, side
        As in `Known`.
    draws, confidence, seed
        Number of noise draws, confidence of the intervals, and seed of the draws.

    Raises
    ------
    EstimationError
        No impacts; flights that a mode does not follow; or energies that contradict themselves by more than the
        noise. Within the noise, a nearly elastic stop may show a restitution above 1.
    """
    from scipy.stats import t as student

    contact = contact_shape @ coordinates
    good = np.isfinite(contact)
    cut = segment(time, contact, good, fastest=fastest, side=side, stop_position=stop_position)
    flights = [flight for flight in cut.flights if flight.usable]
    signals = [
        Signal(time, row, good, cut.signal.interval, 1.0, noise_level(row, good)) for row in coordinates
    ]
    free = ["damping_ratio", "natural_frequency", "static_deflection"]
    free += ["phase"] if forcing.phase is None else []
    start = Parameters(1.0, 0.0, fastest, forcing.angular_frequency, 1.0, forcing.phase or 0.0, 0.0)
    flights = _followed(signals, flights, start, free)
    modes, fitted = _all_modes(signals, flights, start, free)
    found = _numbers(modes, fitted, contact_shape, flights)
    drawn = [
        _numbers(*_all_modes(draw, flights, start, free), contact_shape, flights)
        for draw in _draws(signals, fitted, draws, seed)
    ]
    errors = np.std(drawn, axis=0, ddof=1)
    if not found[-1] - _BEYOND_NOISE * errors[-1] <= 1.0:
        restitution_from_energy(*_energies(fitted, contact_shape, flights))  # raises
    reach = errors * float(student.ppf(0.5 + confidence / 2.0, draws - 1))
    rows = np.column_stack([found, errors, reach]).tolist()
    estimates = [MethodEstimate.within(*row) for row in rows]
    count = len(modes)
    return ModalEstimates(
        tuple(estimates[:count]),
        tuple(estimates[count : 2 * count]),
        tuple(estimates[2 * count : 3 * count]),
        estimates[-2],
        estimates[-1],
        1.0 / float(contact_shape @ contact_shape),
        len(pairs_of(flights)),
    )


def _draws(
    signals: Sequence[Signal], fitted: Sequence[Sequence[FittedFlight]], draws: int, seed: int
) -> Iterator[list[Signal]]:
    """Yield the fitted motion with new draws of the noise."""
    motion = np.array([signal.values for signal in signals])
    for row, fits in zip(motion, fitted, strict=True):
        for one in fits:
            row[one.flight.index] -= one.residual
    noise = np.array([signal.noise for signal in signals])
    generator = np.random.default_rng(seed)
    for _ in range(draws):
        drawn = motion + noise[:, None] * generator.standard_normal(motion.shape)
        yield [replace(signal, values=row) for signal, row in zip(signals, drawn, strict=True)]


def _followed(
    signals: Sequence[Signal], flights: list[Flight], start: Parameters, free: Sequence[str]
) -> list[Flight]:
    """Return the flights that every mode follows; other flights contain a missed impact."""
    if not flights:
        raise EstimationError("modes: expected flights of at least 10 samples between impacts, got none.")
    kept = set(range(len(flights)))
    for signal in signals:
        tested = weighted_flights(signal, flights, start.natural_frequency)
        kept &= set(robust_weak_form(tested, start, free, signal.noise)[1])
    if not kept:
        raise EstimationError(
            "modes: expected flights that every mode follows, got none. Modes are lacking, or impacts were not seen."
        )
    return [flights[k] for k in sorted(kept)]


def _all_modes(
    signals: Sequence[Signal], flights: Sequence[Flight], start: Parameters, free: Sequence[str]
) -> tuple[list[Parameters], list[list[FittedFlight]]]:
    """Return the weak form's parameters of each mode, and its flights on the exact flow."""
    modes, fitted = [], []
    for signal in signals:
        tested = weighted_flights(signal, flights, start.natural_frequency)
        found, _ = weak_form(tested, linear_estimate(tested, start, free), free)
        found = replace(found, damping_ratio=max(found.damping_ratio, 0.0))
        modes.append(found)
        fitted.append([fit_flight(signal, flight, found) for flight in flights])
    return modes, fitted


def _numbers(
    modes: Sequence[Parameters],
    fitted: Sequence[Sequence[FittedFlight]],
    contact_shape: Floats,
    flights: Sequence[Flight],
) -> Floats:
    """Return damping ratios, natural frequencies, forces, and restitution from speeds and from energies."""
    before, after = _speeds(fitted, flights)
    speed, rebound = before @ contact_shape, after @ contact_shape
    by_speed = -float(rebound @ speed) / float(speed @ speed)
    residual, kinetic = _energies(fitted, contact_shape, flights)
    by_energy = math.sqrt(1.0 - residual / kinetic) if residual <= kinetic else math.nan
    return np.array(
        [mode.damping_ratio for mode in modes]
        + [mode.natural_frequency for mode in modes]
        + [mode.natural_frequency**2 * mode.static_deflection for mode in modes]
        + [by_speed, by_energy]
    )


def _speeds(fitted: Sequence[Sequence[FittedFlight]], flights: Sequence[Flight]) -> tuple[Floats, Floats]:
    """Return the modal velocities before and after each impact, shape (impact, mode)."""
    pairs = pairs_of(flights)
    before = np.array([[mode[one].end_state[1] for mode in fitted] for one, _ in pairs])
    after = np.array([[mode[other].state[1] for mode in fitted] for _, other in pairs])
    return before, after


def _energies(
    fitted: Sequence[Sequence[FittedFlight]], contact_shape: Floats, flights: Sequence[Flight]
) -> tuple[float, float]:
    """Return the residual energy of all impacts and the kinetic energy of the contact mass before them, J."""
    before, after = _speeds(fitted, flights)
    speed = before @ contact_shape
    residual = 0.5 * float(np.sum(before**2) - np.sum(after**2))
    return residual, 0.5 * float(speed @ speed) / float(contact_shape @ contact_shape)
