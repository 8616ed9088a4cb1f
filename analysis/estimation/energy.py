"""Energy balance of half orbits: restitution, damping and forcing amplitude (thesis eqs. 4.2 to 4.20), any motion.

A flight is halved at its deepest point, where y' = 0 and y = y_m. Quantities are per unit mass, with y counted from
the offset. With g0 = wn^2 y_st, F = int cos(Omega t + psi) y' dt and D = int y'^2 dt over the half:

    before an impact   V^2     = wn^2 (y_m^2 - y_s^2) + 2 g0 F - 4 zeta wn D      (thesis eq. 4.14).
    after an impact    (r V)^2 = wn^2 (y_m^2 - y_s^2) - 2 g0 F + 4 zeta wn D.

So r^2 = sum (r V)^2 / sum V^2 over the impacts; for P(1,1) this is thesis eq. 4.13. No velocity at an end is needed
where damping and forcing are known. F is y cos at the ends plus Omega int y sin, without a derivative. Only D needs
y'; the noise of y' adds to D, and this part is subtracted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.estimation.flight_fit import pairs_of
from vibroimpact.analysis.estimation.physics import Floats, Parameters
from vibroimpact.analysis.estimation.segments import Flight
from vibroimpact.analysis.estimation.signals import Signal
from vibroimpact.analysis.estimation.smoothing import Smoother, smoother
from vibroimpact.fmus.errors import EstimationError

Drawn = Mapping[str, Floats]

# Number of Newton steps to the deepest point of a flight.
_NEWTON_STEPS = 4
# Condition number above which the unknowns are not separable.
_DEPENDENT = 1e3
# Floor of the squared speeds in the weights, relative to the largest.
_SLOW = 0.04


@dataclass(frozen=True, slots=True)
class HalfMaps:
    """Weights of a flight's samples for the quantities of one half."""

    sign: float
    """1 before an impact (from the deepest point to the end), -1 after one."""
    edge: float
    """Time of the impact, s."""
    edge_value: Floats
    edge_slope: Floats
    """Value and slope of the spline at the impact; shape (sample,), like `deepest`."""
    deepest: Floats
    """Value of the spline at the deepest point."""
    waves: Floats
    """Omega int y sin and Omega int y cos, shape (2, sample): int cos y' and -int sin y' without their end terms."""
    speeds: Floats
    """Slopes times the root of the weights of their squares, shape (node, sample): D is their sum of squares."""
    turning: float
    """Time of the deepest point, s."""


@dataclass(frozen=True, slots=True)
class HalfEnergies:
    """Energies of half orbits, for one set of samples or for many draws; shape (draw, half) each.

    The works are int cos(Omega t) y' dt and int -sin(Omega t) y' dt. Before an impact they run from the deepest point
    to the impact. After it they run from the impact to the deepest point, with the other sign. So positive work adds
    to the speed at the impact.
    """

    elastic: Floats
    """y_m^2 - y_s^2."""
    work_cos: Floats
    work_sin: Floats
    drag: Floats
    """int y'^2 dt with the sign of its effect on the speed at the impact: negative after an impact."""
    speed_squared: Floats
    """Square of the measured slope at the impact."""

    def energy(self, p: Parameters, drawn: Drawn | None = None) -> Floats:
        """Return V^2 before impacts and (r V)^2 after them, from the half orbits; `drawn` values have shape (draw,)."""
        value = _values(p, drawn)
        square = value["natural_frequency"] ** 2
        work = value["static_deflection"] * self.work(value["phase"])
        found: Floats = square * (self.elastic + 2.0 * work)
        return found - 4.0 * value["damping_ratio"] * value["natural_frequency"] * self.drag

    def work(self, phase: Floats) -> Floats:
        """Return the work of a force with this phase, over its amplitude per unit mass."""
        found: Floats = np.cos(phase) * self.work_cos + np.sin(phase) * self.work_sin
        return found


def _values(p: Parameters, drawn: Drawn | None) -> dict[str, Floats]:
    """Return the parameters in shape (draw, 1) or (1, 1), for products with arrays of shape (draw, half)."""
    names = ("natural_frequency", "damping_ratio", "static_deflection", "phase")
    given = drawn or {}
    return {name: np.asarray(given.get(name, getattr(p, name)), dtype=float).reshape(-1, 1) for name in names}


class EnergyBalance:
    """The half orbits of all flights of a record, ready for its samples or for other draws of their noise.

    The angular frequency of the force is in rad/s, the window of the smoothing in s.
    """

    def __init__(
        self, signal: Signal, flights: Sequence[Flight], angular_frequency: float, window: float
    ) -> None:
        self.signal, self.flights = signal, list(flights)
        self.pairs = pairs_of(self.flights)
        self.angular_frequency = angular_frequency
        self.smoothers = [smoother(signal, flight, window) for flight in flights]
        self.halves = [half for one in self.smoothers for half in _halves(one, signal, angular_frequency)]
        self.noise = self._noise()

    def _noise(self) -> float:
        """Return the standard deviation of the samples about their splines."""
        squares = freedom = 0.0
        for one in self.smoothers:
            index = one.flight.index
            samples = self.signal.values[index]
            residual = samples - one.row(self.signal.time[index]) @ samples
            squares += float(residual @ residual)
            freedom += len(index) - one.gain.shape[0]
        return math.sqrt(squares / max(freedom, 1.0))

    def energies(self, samples: Floats, parameters: Parameters, stop_position: float | None) -> HalfEnergies:
        """Return the energies of the halves: for each flight the half after, then the half before an impact.

        Samples cover the whole record, shape (draw, sample). Parameters give the offset and, to first order, the
        acceleration at the ends. Without a stop position the stop is the level where flights meet.
        """
        parts = [
            samples[:, half_flight.index] - parameters.offset for half_flight in self.flights for _ in (0, 1)
        ]

        def mapped(name: str) -> Floats:
            """Return the product of one map with the samples of all halves, shape (draw, half, ...)."""
            return np.stack([y @ getattr(h, name).T for y, h in zip(parts, self.halves, strict=True)], 1)

        value, slope, deepest, waves = map(mapped, ("edge_value", "edge_slope", "deepest", "waves"))
        drag = np.stack(
            [np.sum((y @ h.speeds.T) ** 2, axis=1) for y, h in zip(parts, self.halves, strict=True)], 1
        )
        sign = np.array([half.sign for half in self.halves])
        if stop_position is None:
            stop = self._stop(value, slope, parameters)
        else:
            stop = np.full(len(samples), stop_position - parameters.offset)
        # the flight was cut near the impact: the distance missing to the stop, to first order
        missing = stop[:, None] - value
        edge = self.angular_frequency * np.array([half.edge for half in self.halves])
        turn = self.angular_frequency * np.array([half.turning for half in self.halves])
        # int cos y' = [y cos] + Omega int y sin, from the turning point to the impact or backwards
        bounds_cos = stop[:, None] * np.cos(edge) - deepest * np.cos(turn)
        bounds_sin = -stop[:, None] * np.sin(edge) + deepest * np.sin(turn)
        variance = self.noise**2

        def variances(one: str, other: str) -> Floats:
            """Return the covariance of the noise in two maps of each half."""
            return variance * np.array([float(getattr(h, one) @ getattr(h, other)) for h in self.halves])

        drag_noise = np.array([float(np.sum(half.speeds**2)) for half in self.halves]) * variance
        pull = parameters.acceleration(stop[:, None], slope, edge)
        return HalfEnergies(
            deepest**2 - variances("deepest", "deepest") - stop[:, None] ** 2,
            bounds_cos + sign * waves[:, :, 0],
            bounds_sin + sign * waves[:, :, 1],
            # value and slope at an end share their noise
            sign * (drag - drag_noise + sign * (slope * missing + variances("edge_value", "edge_slope"))),
            slope**2 - variances("edge_slope", "edge_slope") + 2.0 * pull * missing,
        )

    def _stop(self, value: Floats, slope: Floats, p: Parameters) -> Floats:
        """Return the mean level where flights meet, measured from the offset; shape (draw,)."""
        levels = []
        for one, other in self.pairs:
            end, start = 2 * one + 1, 2 * other
            late = 0.0 if one != other else p.short_of_periods(self.flights[one].duration)
            shift = (value[:, end] + late * slope[:, end] - value[:, start]) / (
                slope[:, start] - slope[:, end]
            )
            levels.append(value[:, end] + (late + shift) * slope[:, end])
        return np.asarray(np.mean(levels, axis=0), dtype=np.float64)

    def restitution(self, energy: Floats) -> Floats:
        """Return r from the energies of the halves, over all impacts between flights; shape (draw,).

        A negative residual energy, or one above the kinetic energy at the impacts, raises EstimationError.
        """
        before = np.sum([energy[:, 2 * one + 1] for one, _ in self.pairs], axis=0)
        after = np.sum([energy[:, 2 * other] for _, other in self.pairs], axis=0)
        ratio = after / np.where(before > 0.0, before, np.nan)
        if not (np.isfinite(ratio[0]) and ratio[0] >= 0.0):
            raise EstimationError(
                f"energy balance: expected a residual energy between 0 and the kinetic energy at the impacts, "
                f"got energies (per unit mass) of {before[0] / 2:.4g} before and {after[0] / 2:.4g} after them. "
                "Damping, forcing or mass at the contact are not what the motion shows."
            )
        found: Floats = np.sqrt(np.where(ratio >= 0.0, ratio, np.nan))
        return found

    def speed(self, energy: Floats) -> Floats:
        """Return the root mean square of the speeds of approach from the energies of the halves; shape (draw,)."""
        squares = np.mean([energy[:, 2 * one + 1] for one, _ in self.pairs], axis=0)
        found: Floats = np.sqrt(np.where(squares > 0.0, squares, np.nan))
        return found


def _halves(one: Smoother, signal: Signal, angular_frequency: float) -> list[HalfMaps]:
    """Return the maps for the impact at the start of a flight, and for the impact at its end."""
    flight = one.flight
    samples = signal.values[flight.index]
    turning = _turning_time(one, samples)
    deepest = one.row(np.array([turning]))[0]
    found = []
    for sign, low, high in ((-1.0, flight.start, turning), (1.0, turning, flight.end)):
        edge = flight.start if sign < 0.0 else flight.end
        node, weight = one.integration(low, high)
        rows = one.row(node)
        angle = angular_frequency * node
        waves = angular_frequency * np.stack(
            [(weight * np.sin(angle)) @ rows, (weight * np.cos(angle)) @ rows]
        )
        speeds = np.sqrt(weight)[:, None] * one.row(node, 1)
        at = np.array([edge])
        found.append(HalfMaps(sign, edge, one.row(at)[0], one.row(at, 1)[0], deepest, waves, speeds, turning))
    return found


def _turning_time(one: Smoother, samples: Floats) -> float:
    """Return the time at which the spline of a flight is furthest from the stop, s."""
    flight = one.flight
    grid = np.linspace(flight.start, flight.end, 65)[1:-1]
    time = float(grid[np.argmin(one.row(grid) @ samples)])
    for _ in range(_NEWTON_STEPS):
        at = np.array([time])
        slope, bend = float((one.row(at, 1) @ samples)[0]), float((one.row(at, 2) @ samples)[0])
        if bend <= 0.0:
            break
        time = float(np.clip(time - slope / bend, flight.start, flight.end))
    return time


def unknowns_by_speed(
    halves: HalfEnergies,
    p: Parameters,
    unknown: Sequence[str],
    drawn: Drawn | None = None,
    squares: Floats | None = None,
) -> tuple[Floats, float]:
    """Return damping or forcing from the speeds measured at the impacts, by weighted least squares.

    The unknowns are damping_ratio, static_deflection, and phase, in this order; phase needs static_deflection. Values
    that differ between draws have shape (draw,); the result has shape (draw, unknown). The condition is the ratio of
    the largest to the smallest singular value of the columns, each scaled to 1. Nearly dependent columns, as for P(1,1)
    with more than two unknowns, raise EstimationError.

    `squares` of the speeds without noise, shape (half,), give the weights: noisy weights would favour speeds that are
    too low. None: the measured squares.
    """
    value = _values(p, drawn)
    square, drag = value["natural_frequency"] ** 2, -4.0 * value["natural_frequency"] * halves.drag
    work = halves.work(value["phase"])
    columns, target = [], halves.speed_squared - square * halves.elastic
    if "damping_ratio" in unknown:
        columns.append(drag)
    else:
        target = target - value["damping_ratio"] * drag
    if "phase" in unknown:
        columns.extend([2.0 * square * halves.work_cos, 2.0 * square * halves.work_sin])
    elif "static_deflection" in unknown:
        columns.append(2.0 * square * work)
    else:
        target = target - 2.0 * square * value["static_deflection"] * work
    matrix = np.stack(columns, axis=2)
    # the error of a squared slope grows with the slope
    speeds = np.abs(halves.speed_squared[0] if squares is None else squares)
    weight = 1.0 / np.sqrt(np.maximum(speeds, _SLOW * np.max(speeds)))
    matrix, target = matrix * weight[:, None], target * weight
    condition = float(np.linalg.cond(matrix[0] / np.linalg.norm(matrix[0], axis=0)))
    if matrix.shape[1] < matrix.shape[2] or not condition < _DEPENDENT:
        raise EstimationError(
            f"energy balance: expected half orbits that separate {', '.join(unknown)}, got condition {condition:.3g}. "
            "Give one of them, or take motion of several impact velocities."
        )
    solution = np.einsum("dij,dj->di", np.linalg.pinv(matrix), target)
    if "phase" in unknown:
        cosine, sine = solution[:, -2], solution[:, -1]
        amplitude, phase = np.hypot(cosine, sine), np.arctan2(sine, cosine)
        solution = np.column_stack([solution[:, :-2], amplitude, phase])
    return solution, condition


def sensitivities(
    restitution: float, speed: float, drag: float, half_drag: float, natural_frequency: float
) -> dict[str, float]:
    """Return the sensitivities of P(1,1) estimates to errors of the speed V, or of a known damping ratio.

    They follow from V^2 (1 - r^2) / 2 = fe - 2 zeta wn D and thesis eq. 4.14. D (`drag`) is over the whole flight, D*
    (`half_drag`) from its deepest point on; the natural frequency is in rad/s.

    >>> found = sensitivities(0.8, 2.0, 3.0, 1.5, 10.0)
    >>> round(found["restitution_per_relative_velocity"], 12)
    0.45
    """
    r, square, wn = restitution, speed**2, natural_frequency
    drag_seen = drag - (1.0 - r * r) * half_drag
    return {
        "restitution_per_relative_velocity": (1.0 - r * r) / r,
        "restitution_per_damping_ratio_velocity_measured": 2.0 * wn * drag / (r * square),
        "restitution_per_damping_ratio_velocity_from_half_orbit": 2.0 * wn * drag_seen / (r * square),
        "joint_damping_ratio_per_relative_velocity": -square / (2.0 * wn * half_drag),
        "joint_restitution_per_relative_velocity": (1.0 - r * r - drag / half_drag) / r,
    }
