"""The clock of several forces: the first sine, or the common period of all sines (docs/scene/forcing.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from vibroimpact.orchestrator.scene.forcing_models import Force, Forcing, Signal, SignalForcing
from vibroimpact.orchestrator.scene.models import Stop, StopTable
from vibroimpact.orchestrator.scene.sweep import SweepAxis

MOST_PERIODS = 64
"""Largest number of periods of the first sine in a common period of all sines."""
ROUNDING = 4.0 * 2.0**-52
"""Relative error of a ratio of two frequencies up to which it is a ratio of whole numbers: their rounding."""
NEAR = 1e-9
"""Relative error of a ratio up to which it is remarked as nearly a ratio of whole numbers."""


@dataclass(frozen=True, slots=True)
class Clock:
    """The period that strobes, periods of a record and P(p,q) count.

    Attributes
    ----------
    angular_frequency : float
        rad/s.
    phase : float
        Phase at time 0, rad. The phase of the first sine is 0 wherever it is 0.
    periods : int
        Periods of the first sine in a period of the clock.
    is_common : bool
        Whether all forces repeat with the period of the clock; otherwise motions have no period.
    near : tuple of (int, int, int)
        Number (from 1) of each sine whose ratio p / q to the first sine nearly holds, p, and q.
    """

    angular_frequency: float
    phase: float
    periods: int = 1
    is_common: bool = True
    near: tuple[tuple[int, int, int], ...] = ()

    @property
    def period(self) -> float:
        """2 pi / angular_frequency, s."""
        return 2.0 * math.pi / self.angular_frequency


def sines_of(forces: Sequence[Force | None]) -> list[Forcing]:
    """Return the sines among some forces, in their order."""
    return [force for force in forces if isinstance(force, Forcing)]


def signals_of(forces: Sequence[Force | None]) -> list[Signal]:
    """Return the forces that are neither sines nor constants, in their order."""
    return [force for force in forces if isinstance(force, SignalForcing)]


def sines_of_stops(stops: Sequence[Stop | None]) -> list[Forcing]:
    """Return the motions of stops that are sines, as forces without an amplitude."""
    moving = [stop for stop in stops if isinstance(stop, StopTable) and stop.motion_angular_frequency > 0.0]
    return [
        Forcing(amplitude=0.0, angular_frequency=stop.motion_angular_frequency, phase=stop.motion_phase)
        for stop in moving
    ]


def is_frequency(key: str) -> bool:
    """Return whether a key of a scene is the frequency of a force or of a moving stop.

    >>> is_frequency("forcing[2].angular_frequency"), is_frequency("forcing.amplitude")
    (True, False)
    """
    return key.startswith(("forcing", "stop[")) and key.endswith("frequency")


def sweeps_frequencies(axes: Sequence[SweepAxis]) -> bool:
    """Return whether a sweep varies the frequency of a force, or of the motion of a stop.

    >>> sweeps_frequencies([SweepAxis("forcing[2].frequency", (1.0, 2.0))])
    True
    """
    return any(is_frequency(axis.key) for axis in axes)


def clock_of(
    forces: Sequence[Force | None], stops: Sequence[Stop | None] = (), *, sweeps_frequencies: bool = False
) -> Clock | None:
    """Return the clock of some forces; None without a sine, and for a single force of frequency 0.

    Sines of moving stops count behind those of forces. A stop that drifts repeats with no period.

    A sweep over a frequency has the first sine as its clock, as points have other common periods or none. So have
    sines beside another signal, which repeats with no period.

    Examples
    --------
    >>> one, two = (Forcing(amplitude=1.0, angular_frequency=w) for w in (1.0, 1.5))
    >>> clock_of([one, two])
    Clock(angular_frequency=0.5, phase=0.0, periods=2, is_common=True, near=())
    >>> clock_of([one, Forcing(amplitude=1.0, angular_frequency=2.0**0.5)]).is_common
    False
    """
    sines = [*sines_of(forces), *sines_of_stops(stops)]
    if not sines:
        return None
    first = sines[0]
    if signals_of(forces) or any(isinstance(stop, StopTable) and stop.drifts for stop in stops):
        return Clock(first.angular_frequency, first.phase, is_common=False)
    if len(sines) == 1:
        frequency = first.angular_frequency
        # swept frequencies may be an array, whose numbers are all 0 or all > 0
        is_constant = isinstance(frequency, float | int) and frequency == 0.0
        return None if is_constant else Clock(frequency, first.phase)
    if sweeps_frequencies:
        return Clock(first.angular_frequency, first.phase, is_common=False)
    ratios = [_ratio(sine.angular_frequency, first.angular_frequency) for sine in sines[1:]]
    exact = [ratio for ratio, error in ratios if error <= ROUNDING]
    near = tuple(
        (number, ratio.numerator, ratio.denominator)
        for number, (ratio, error) in zip(_numbers(forces)[1:], ratios, strict=False)
        if ROUNDING < error <= NEAR
    )
    periods = lcm(*(ratio.denominator for ratio in exact))
    if len(exact) < len(ratios) or periods > MOST_PERIODS:
        return Clock(first.angular_frequency, first.phase, is_common=False, near=near)
    return Clock(first.angular_frequency / periods, first.phase / periods, periods)


def _numbers(forces: Sequence[Force | None]) -> list[int]:
    """Return the numbers of the sines among forces, from 1."""
    return [number for number, force in enumerate(forces, start=1) if isinstance(force, Forcing)]


def _ratio(frequency: float, first: float) -> tuple[Fraction, float]:
    """Return the nearest ratio p / q of two frequencies with a small q, and its relative error."""
    exact = Fraction(frequency) / Fraction(first)
    nearest = exact.limit_denominator(MOST_PERIODS)
    return nearest, float(abs(nearest - exact) / exact)
