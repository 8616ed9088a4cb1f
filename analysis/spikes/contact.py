"""From pulses to mechanics: the share of the time in contact, impact velocities, calibration of a load cell.

Thesis sections 5.2.4 and 5.3, equations (5.1) to (5.6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import EstimationError, UsageError

Floats = NDArray[np.float64]

#: Contact-time measure below which the rigid-impact model is adequate (thesis section 5.2.4).
SHORT_CONTACT = 0.025


@dataclass(frozen=True, slots=True)
class ContactTime:
    """The contact-time measure: share of the time in contact, with its standard error."""

    measure: float
    standard_error: float


@dataclass(frozen=True, slots=True)
class Calibration:
    """Sensitivity of a load cell, V/N, with its standard error and the relative scatter of single impulses."""

    sensitivity: float
    standard_error: float
    scatter: float


def contact_time_measure(start: Floats, duration: Floats) -> ContactTime:
    """Return the share of the time in which the spikes are above the threshold (thesis eq. 5.3).

    mu_H = (1/t_n) sum S_j over the spikes from the first firing to the last one. The last spike is excluded, since it
    is not completed within t_n. mu_H is a ratio of two means; its standard error is that of S_j - mu_H I_j over the
    mean interval.

    Parameters
    ----------
    start : ndarray of float, shape (spike,)
        Firing times, s.
    duration : ndarray of float, shape (spike,)
        Time above the threshold, s.

    Raises
    ------
    EstimationError
        Fewer than two spikes.

    Examples
    --------
    >>> found = contact_time_measure(np.array([0.0, 0.05, 0.1, 0.15]), np.array([1.2, 1.0, 1.4, 1.1]) * 1e-3)
    >>> round(found.measure, 6)
    0.024
    """
    if len(start) < 2:
        raise EstimationError(f"contact time: expected at least 2 spikes, got {len(start)}.")
    intervals, contacts = np.diff(start), duration[:-1]
    measure = float(contacts.sum()) / float(intervals.sum())
    count = len(intervals)
    error = np.nan
    if count > 1:
        residual = contacts - measure * intervals
        error = float(np.sqrt(np.sum(residual**2) / (count - 1) / count) / np.mean(intervals))
    return ContactTime(measure, error)


def impact_velocity(impulse: Floats, restitution: float, mass: float | None) -> Floats:
    """Return the velocity before impact from the impulse (thesis eq. 5.6): V = J / (m (1 + r)).

    Parameters
    ----------
    impulse : ndarray of float, shape (spike,)
        N s; m/s for an acceleration, if `mass` is None.
    restitution : float
        0 to 1.
    mass : float or None
        Effective mass of the contact in the present model, kg.

    Raises
    ------
    UsageError
        Restitution or mass out of its range.

    Examples
    --------
    >>> impact_velocity(np.array([4e-4]), 0.6, 0.02).round(6)
    array([0.0125])
    """
    if not 0.0 <= restitution <= 1.0:
        raise UsageError(f"restitution: expected 0 <= r <= 1, got {restitution!r}.")
    if mass is not None and not mass > 0.0:
        raise UsageError(f"mass: expected more than 0 kg, got {mass!r}.")
    velocity: Floats = np.abs(impulse) / ((mass or 1.0) * (1.0 + restitution))
    return velocity


def calibrate(measured: Floats, known: Floats) -> Calibration:
    """Return the sensitivity of a load cell, fitted to known impulses.

    Least squares through the origin: measured (V s) = sensitivity (V/N) times known (N s).

    Parameters
    ----------
    measured : ndarray of float, shape (spike,)
        V s, from `measure_pulses` for a channel in volts.
    known : ndarray of float, shape (spike,)
        N s, from a pendulum or a dropped mass.

    Raises
    ------
    UsageError
        The number of known impulses differs from the number of spikes.
    EstimationError
        All known impulses are 0.

    Examples
    --------
    >>> round(calibrate(np.array([0.218, 0.436]), np.array([10.0, 20.0])).sensitivity, 6)
    0.0218
    """
    if len(measured) != len(known):
        raise UsageError(
            f"known impulses: expected one for each of the {len(measured)} spikes found, got {len(known)}."
        )
    power = float(np.sum(known**2))
    if power == 0.0:
        raise EstimationError("calibration: expected known impulses other than 0, got none.")
    sensitivity = float(np.sum(measured * known)) / power
    residual = measured - sensitivity * known
    if len(known) < 2:
        return Calibration(sensitivity, np.nan, np.nan)
    variance = float(np.sum(residual**2)) / (len(known) - 1)
    scatter = float(np.sqrt(variance * len(known) / power) / abs(sensitivity)) if sensitivity else np.nan
    return Calibration(sensitivity, float(np.sqrt(variance / power)), scatter)
