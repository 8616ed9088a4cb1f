"""The tables `[[forcing]]` of a scene as frozen pydantic models: the place of a force, and its signal.

A new signal is one more model here, in `Force`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vibroimpact.orchestrator.scene.fields import Rule, listed
from vibroimpact.orchestrator.scene.models import (
    Finite,
    FiniteNumbers,
    Fraction,
    ModeNumber,
    NotNegative,
    Positive,
    SceneTable,
    location_rule,
)
from vibroimpact.orchestrator.scene.point_fields import POINT_RULE, Point

MOST_SINES = 16
MOST_CONSTANTS = 8
MOST_SIGNALS = 8
MOST_ROWS = 8192
"""Largest number of rows of all tables and densities of a scene together."""
NARROWEST_BAND = 1.0 / 256.0
"""Narrowest band of a random force that the filter of the FMU resolves, as a part of its upper end."""
_CONSTANT = 'Use 0 for a constant force, or signal = "constant" beside other forces.'
_AMPLITUDE_UNIT = "N (m/s^2 for base_acceleration, N/m for uniform, V beside `[exciter]`)"
_AMPLITUDE = "a finite number, or an array of them for a chain"


class ForcingTable(SceneTable):
    """Base of `[[forcing]]`: the load of a force with the amplitude 1, and its amplitude."""

    kind: Annotated[
        Literal["force", "base_acceleration", "uniform", "mode"],
        Rule(
            doc='`"force"`; `"base_acceleration"`: the amplitude is the acceleration of the base, displacements are '
            'relative to it; for beams also `"uniform"`: a force per length, and `"mode"`: a load in the shape of a '
            "mode"
        ),
    ] = "force"
    amplitude: Annotated[
        FiniteNumbers,
        Rule(
            _AMPLITUDE,
            unit=_AMPLITUDE_UNIT,
            doc='a chain under `"force"` has one for each mass; a number is enough for a single mass',
        ),
    ]
    location: Annotated[
        Fraction | None,
        location_rule(
            'point of a beam where a `"force"` acts; not a supported end', "the free tip, or the middle"
        ),
    ] = None
    at: Annotated[
        Point | None,
        replace(
            POINT_RULE,
            doc='several bodies: the point where a `"force"` acts, such as `"frame"` or `"beam.tip"`; `"all"`: '
            "each mass, with the same amplitude",
            default="required there",
        ),
    ] = None
    mode: Annotated[
        ModeNumber | None,
        Rule(
            doc="the load has the shape of this mode, and drives no other mode",
            default='required for `"mode"`',
        ),
    ] = None

    @property
    def scalar_amplitude(self) -> float:
        """Amplitude of a load with a single amplitude; forces on the masses of a chain have an array."""
        assert not isinstance(self.amplitude, tuple)
        return self.amplitude


class Forcing(ForcingTable):
    """`[[forcing]]` with a sine: amplitude cos(angular_frequency t + phase)."""

    signal: Annotated[
        Literal["sine"],
        Rule(doc='`"sine"`: amplitude cos(angular_frequency t + phase)'),
    ] = "sine"
    angular_frequency_given: Annotated[
        NotNegative | None,
        Rule(
            unit="rad/s",
            hint=_CONSTANT,
            fmu="forcing.angular_frequency",
            doc="0, for a force alone, is a constant force, amplitude cos(phase), for example a weight",
            default="this or `frequency`",
        ),
    ] = Field(None, alias="angular_frequency")
    frequency: Annotated[
        NotNegative | None,
        Rule(unit="Hz", hint=_CONSTANT, doc="SI scenes only", default="this or `angular_frequency`"),
    ] = None
    phase: Annotated[
        Finite,
        Rule(
            unit="rad",
            fmu="forcing.phase",
            doc="phase of the force at time 0. A recording begins and ends at forcing phase 0. With another phase at "
            "time 0 it begins up to one period later, even if `transient_periods = 0`",
        ),
    ] = 0.0

    @property
    def angular_frequency(self) -> float:
        """Angular frequency, rad/s: as given, or 2 pi frequency; 0 for a constant force."""
        if self.frequency is not None:
            return 2.0 * math.pi * self.frequency
        given = self.angular_frequency_given
        return 0.0 if given is None else given + 0.0  # -0 becomes 0


class ConstantForcing(ForcingTable):
    """`[[forcing]]` with `signal = "constant"`: a force that does not change, such as a weight."""

    signal: Annotated[Literal["constant"], Rule(doc='`"constant"`: amplitude at all times, such as a weight')]


_START = Rule(unit="s", doc="the force is 0 before")
_AFTER = Rule(unit="s", doc="the force is 0 after it")
_SCALE = Rule(_AMPLITUDE, doc="factor of the values; an array of factors for a chain")
_Times = Annotated[tuple[Finite, ...], Field(strict=False, min_length=2, max_length=MOST_ROWS)]


class SignalForcing(ForcingTable, ABC):
    """Base of the signals of time that are no sines: their numbers as parameters of the FMU Structure."""

    @property
    @abstractmethod
    def kind_number(self) -> int:
        """Number of the kind of the signal in the FMU."""

    @abstractmethod
    def numbers(self) -> dict[str, float]:
        """Return the real parameters of the signal by their names in the FMU, besides its amplitude."""

    @property
    def seed_number(self) -> int:
        """Seed of a random signal; 0 for others."""
        return 0

    @property
    def rows(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The places and the values of its table; empty without one."""
        return (), ()

    def values_at(self, times: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the signal of amplitude 1 at instants of a run, shape (instant,); None where only the FMU knows it."""
        return None


class ChirpForcing(SignalForcing):
    """`[[forcing]]` with `signal = "chirp"`: a sine whose frequency changes from one value to another."""

    signal: Annotated[
        Literal["chirp"], Rule(doc='`"chirp"`: amplitude cos of a phase that speeds up or slows down')
    ]
    angular_frequency: Annotated[
        NotNegative, Rule(unit="rad/s", doc="at the start; > 0 for a logarithmic one")
    ]
    end_angular_frequency: Annotated[
        NotNegative, Rule(unit="rad/s", doc="at the end; > 0 for a logarithmic one")
    ]
    start: Annotated[Finite, _START] = 0.0
    duration: Annotated[Positive, _AFTER]
    spacing: Annotated[
        Literal["linear", "logarithmic"],
        Rule(
            doc='`"linear"`: the frequency grows by the same difference each second; `"logarithmic"`: by the same ratio'
        ),
    ] = "linear"
    phase: Annotated[Finite, Rule(unit="rad", doc="phase at the start")] = 0.0

    @property
    def kind_number(self) -> int:
        """Number of the kind of the signal in the FMU."""
        return 1 if self.spacing == "linear" else 2

    def numbers(self) -> dict[str, float]:
        """Return start, duration, frequencies and phase."""
        names = "start", "duration", "angular_frequency", "end_angular_frequency", "phase"
        return {name: getattr(self, name) for name in names}

    def values_at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the cosine of the phase, equations.md 8.9, and 0 outside."""
        since = times - self.start
        low, high = self.angular_frequency, self.end_angular_frequency
        if self.spacing == "linear" or low == high:
            angle = low * since + 0.5 * (high - low) / self.duration * since**2
        else:
            rate = math.log(high / low) / self.duration
            angle = low * np.expm1(rate * since) / rate
        inside = (since >= 0.0) & (since <= self.duration)
        return np.where(inside, np.cos(self.phase + np.where(inside, angle, 0.0)), 0.0)


class PulseForcing(SignalForcing):
    """`[[forcing]]` with `signal = "pulse"`: one pulse."""

    signal: Annotated[Literal["pulse"], Rule(doc='`"pulse"`: one pulse with the amplitude as its top')]
    start: Annotated[Finite, _START] = 0.0
    duration: Annotated[Positive, _AFTER]
    shape: Annotated[
        Literal["half_sine", "triangle", "trapezoid"],
        Rule(doc='`"half_sine"`, `"triangle"` with equal flanks, or `"trapezoid"` with `rise`'),
    ]
    rise: Annotated[
        NotNegative | None,
        Rule(
            unit="s",
            doc="of a trapezoid: its rise and its fall, up to half of the duration; 0: a rectangle",
            default="0",
        ),
    ] = None

    @property
    def kind_number(self) -> int:
        """Number of the kind of the signal in the FMU."""
        return {"half_sine": 3, "triangle": 4, "trapezoid": 5}[self.shape]

    def numbers(self) -> dict[str, float]:
        """Return start, duration and rise."""
        return {"start": self.start, "duration": self.duration, "rise": self.rise or 0.0}

    def values_at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the shape of the pulse, and 0 outside."""
        part = (times - self.start) / self.duration
        inside = (part >= 0.0) & (part <= 1.0)
        if self.shape == "half_sine":
            return np.where(inside, np.sin(math.pi * np.clip(part, 0.0, 1.0)), 0.0)
        rise = 0.5 if self.shape == "triangle" else (self.rise or 0.0) / self.duration
        flank = np.minimum(part, 1.0 - part)
        return np.where(inside, np.minimum(flank / rise, 1.0) if rise > 0.0 else 1.0, 0.0)


class TableForcing(SignalForcing):
    """`[[forcing]]` with `signal = "table"`: samples, with straight lines or a cubic spline between them."""

    signal: Annotated[Literal["table"], Rule(doc='`"table"`: amplitude times the values of a table')]
    amplitude: Annotated[FiniteNumbers, _SCALE] = 1.0
    times: Annotated[
        _Times | None,
        Rule(
            f"an array of 2 to {MOST_ROWS} instants",
            unit="s",
            sweepable=False,
            doc="ascending",
            default="this or `file`",
        ),
    ] = None
    values: Annotated[
        _Times | None,
        Rule(
            f"an array of 2 to {MOST_ROWS} numbers",
            sweepable=False,
            doc="one for each instant",
            default="this or `file`",
        ),
    ] = None
    file: Annotated[
        Annotated[str, Field(min_length=1, max_length=1000)] | None,
        Rule(
            "the name of a file",
            doc="a CSV file of two columns, instants and values, next to the scene",
            default="none",
        ),
    ] = None
    start: Annotated[Finite, Rule(unit="s", doc="instant of the run at which the times are 0")] = 0.0
    interpolation: Annotated[
        Literal["linear", "cubic"],
        Rule(
            doc='`"linear"`: straight lines; `"cubic"`: a natural cubic spline. The force is 0 outside of the table'
        ),
    ] = "linear"

    @property
    def kind_number(self) -> int:
        """Number of the kind of the signal in the FMU."""
        return 6 if self.interpolation == "linear" else 8

    def numbers(self) -> dict[str, float]:
        """Return the start."""
        return {"start": self.start}

    @property
    def rows(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The instants and the values."""
        return self.times or (), self.values or ()

    def values_at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the table between its instants, and 0 outside."""
        places, values = map(np.array, self.rows)
        since = times - self.start
        if self.interpolation == "linear":
            return np.asarray(np.interp(since, places, values, left=0.0, right=0.0))
        from scipy.interpolate import CubicSpline  # the import takes time

        inside = (since >= places[0]) & (since <= places[-1])
        spline = CubicSpline(places, values, bc_type="natural")
        return np.where(inside, spline(np.clip(since, places[0], places[-1])), 0.0)


class RandomForcing(SignalForcing):
    """`[[forcing]]` with `signal = "random"`: a stationary Gaussian force with a one-sided spectral density."""

    signal: Annotated[Literal["random"], Rule(doc='`"random"`: a stationary Gaussian force')]
    amplitude: Annotated[
        FiniteNumbers,
        Rule(
            _AMPLITUDE, unit=_AMPLITUDE_UNIT, doc="standard deviation of the force; beside `density` a factor"
        ),
    ] = 1.0
    band: Annotated[
        Annotated[tuple[NotNegative, ...], Field(strict=False, min_length=2, max_length=2)] | None,
        Rule(
            "an array of the lowest and the highest angular frequency",
            unit="rad/s",
            sweepable=False,
            doc="`[low, high]`, in which the density is the same, or that of `density`",
            default="this, or that of `density`",
        ),
    ] = None
    density: Annotated[
        Annotated[
            tuple[Annotated[tuple[NotNegative, ...], Field(strict=False, min_length=2, max_length=2)], ...],
            Field(strict=False, min_length=2, max_length=MOST_ROWS),
        ]
        | None,
        Rule(
            "an array of pairs [angular_frequency, density] of numbers >= 0",
            item="a pair [angular_frequency, density] of numbers >= 0",
            sweepable=False,
            doc="one-sided over angular frequency, `[[w, S], ...]` in rad/s and N^2 s/rad, linear between, 0 outside",
            default="the same in all of `band`",
        ),
    ] = None
    seed: Annotated[
        int,
        Field(ge=0, le=10**9),
        Rule(sweepable=True, doc="equal seeds give equal signals; a sweep over seeds gives realisations"),
    ] = 0
    start: Annotated[Finite, _START] = 0.0
    duration: Annotated[
        Positive | None, Rule(unit="s", doc="the force is 0 after it", default="it has no end")
    ] = None

    @property
    def kind_number(self) -> int:
        """Number of the kind of the signal in the FMU."""
        return 7

    @property
    def seed_number(self) -> int:
        """The seed."""
        return self.seed

    def numbers(self) -> dict[str, float]:
        """Return start, duration (0 without an end) and band (0 for that of the density)."""
        low, high = self.band or (0.0, 0.0)
        duration = self.duration or 0.0
        return {
            "start": self.start,
            "duration": duration,
            "angular_frequency": low,
            "end_angular_frequency": high,
        }

    @property
    def rows(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The angular frequencies and the densities."""
        places, values = zip(*self.density, strict=True) if self.density else ((), ())
        return places, values


Signal = ChirpForcing | PulseForcing | TableForcing | RandomForcing
Force = Forcing | ConstantForcing | Signal

FORCING_MODELS: dict[str, type[Force]] = {
    get_args(model.model_fields["signal"].annotation)[0]: model for model in get_args(Force)
}
"""Models of `[[forcing]]` by signal."""


def is_one_sine(forces: Sequence[Force | None]) -> bool:
    """Return whether forces are one sine at most, which the FMU of each kind of body has.

    Examples
    --------
    >>> sine = Forcing(amplitude=1.0, angular_frequency=2.0)
    >>> is_one_sine([]), is_one_sine([sine]), is_one_sine([sine, sine])
    (True, True, False)
    """
    return not forces or (len(forces) == 1 and (forces[0] is None or forces[0].signal == "sine"))


def forcing_keys(forces: Sequence[Any]) -> tuple[str, ...]:
    """Return the key of the table of each force: `forcing` for one, `forcing[1]`, `forcing[2]` for several.

    >>> forcing_keys(["one"]), forcing_keys(["one", "other"])
    (('forcing',), ('forcing[1]', 'forcing[2]'))
    """
    if len(forces) == 1:
        return ("forcing",)
    return tuple(f"forcing[{number}]" for number in range(1, len(forces) + 1))


def forces_in_words(forces: Sequence[Force]) -> str:
    """Return the numbers of forces of each signal in words.

    >>> forces_in_words([Forcing(amplitude=1.0), ConstantForcing(signal="constant", amplitude=1.0)])
    '1 sine and 1 constant'
    """
    counts = Counter(force.signal for force in forces)
    return listed([f"{count} {signal}{'' if count == 1 else 's'}" for signal, count in counts.items()], "and")
