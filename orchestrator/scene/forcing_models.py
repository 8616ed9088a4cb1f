"""The tables `[[forcing]]` of a scene as frozen pydantic models: the place of a force, and its signal.

A new signal is one more model here, in `Force`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, get_args

from pydantic import Field

from vibroimpact.orchestrator.scene.fields import Rule, listed
from vibroimpact.orchestrator.scene.models import (
    Finite,
    FiniteNumbers,
    Fraction,
    ModeNumber,
    NotNegative,
    SceneTable,
    location_rule,
)
from vibroimpact.orchestrator.scene.point_fields import POINT_RULE, Point

MOST_SINES = 16
MOST_CONSTANTS = 8
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
            doc='several bodies: the point where a `"force"` acts, such as `"frame"` or `"beam.tip"`',
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
        Rule(doc='`"sine"`: amplitude cos(angular_frequency t + phase); `"constant"`: amplitude'),
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

    signal: Annotated[Literal["constant"], Rule()]


Force = Forcing | ConstantForcing

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
    return not forces or (len(forces) == 1 and isinstance(forces[0], Forcing | None))


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
