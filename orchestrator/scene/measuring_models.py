"""The tables of the measuring chain, which turns a motion into voltages, and a drive voltage into a force."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.models import (
    Finite,
    Fraction,
    NotNegative,
    Positive,
    SceneTable,
    location_rule,
)

MOST_PPM = 1e5
"""Largest error of a clock, parts per million."""
MOST_SEED = 10**9

RING_INSTANTS = 12
"""Least number of instants in a period of a load cell's ring, with a linear force on the cell between them."""
MOST_INSTANTS = 1000
"""Largest number of instants in a sample at which a force is followed."""

MEASURED_SENSOR = {f"sensor.{name}": name for name in ("displacement", "velocity", "acceleration")}
"""Channels of the sensor, each with the quantity of the observed point that it reads."""
LOAD_CELL, DRIVE = "load_cell", "drive"
CHANNELS = (*MEASURED_SENSOR, LOAD_CELL, DRIVE)
"""All channels of a measuring chain, in V; the first part of a name is the key of its noise: see `Noise.of`."""


def channel_number(channel: str) -> int:
    """Return the number of a channel, which gives each channel its own noise under one seed."""
    return CHANNELS.index(channel)


FALLING_FORCE = "force that falls with distance"
"""Effect that an exciter with a distance asks for."""


class Sensor(SceneTable):
    """`[sensor]`: the observed point of a beam, and its reading: gain * value + offset, up to the range."""

    location: Annotated[
        Fraction | None,
        location_rule(
            "beams only; a point that moves",
            "left out: the tip of a clamped-free beam, else the point of `stop[1]`, or the middle",
        ),
    ] = None
    gain: Annotated[
        Finite,
        Rule(
            hint="A reading is gain * value + offset, in the unit of its channel.",
            doc="V/m for `sensor.displacement`, V s/m for `sensor.velocity`, V s^2/m for `sensor.acceleration`; in a "
            "replay a plain number if the channel measures the same quantity, otherwise the unit of the channel per SI "
            "unit",
        ),
    ] = 1.0
    offset: Annotated[
        Finite,
        Rule(
            hint="It has the unit of the reading.",
            doc="in V; in a replay in the unit of the channel; a replay without `offset` subtracts the level of the "
            "channel before its event",
        ),
    ] = 0.0
    range: Annotated[
        NotNegative | None,
        Rule(
            hint="Use 0 for a sensor without an end.",
            doc="in V: readings are limited to +- range; not in replays",
            default="0: no limit",
        ),
    ] = None


class LoadCell(SceneTable):
    """`[load_cell]`: the voltage of a cell behind a stop, a second-order system driven by the contact force."""

    stop: Annotated[
        int,
        Field(ge=1, le=8),
        Rule(hint="Stops count from 1.", doc="number of the stop whose force the cell measures"),
    ] = 1
    sensitivity: Annotated[Finite, Rule(unit="V/N", doc="volts per newton; negative for an inverted cell")]
    natural_frequency: Annotated[
        NotNegative,
        Rule(
            unit="Hz",
            hint="Use 0 for a cell that follows the force at once.",
            doc="natural frequency of the cell's ring; 0: the cell follows the force without delay",
        ),
    ] = 0.0
    damping_ratio: Annotated[
        NotNegative, Rule(unit="1", hint="A cell does not feed energy.", doc="damping ratio of the ring")
    ] = 0.0
    offset: Annotated[Finite, Rule(unit="V", doc="voltage without a force, at time 0")] = 0.0
    drift: Annotated[Finite, Rule(unit="V/s", doc="rate of change of the offset")] = 0.0
    contact_duration: Annotated[
        Positive | None,
        Rule(
            unit="s",
            hint="An impact on a rigid stop is seen as a half sine of this duration.",
            doc="an impact on a rigid stop gives the cell a half sine with this duration and the impulse of the "
            "impact, from the impact on",
            default="required for a rigid stop; not allowed for a stop that yields",
        ),
    ] = None


class Exciter(SceneTable):
    """`[exciter]`: force = (gain volts + offset) / (1 +- displacement / distance)^2."""

    gain: Annotated[
        Finite, Rule(unit="N/V", doc="newtons per volt; with this table the amplitude of `[forcing]` is in V")
    ]
    offset: Annotated[Finite, Rule(unit="N", doc="constant force without a voltage, at displacement 0")] = 0.0
    distance: Annotated[
        NotNegative,
        Rule(
            unit="m",
            hint="Use 0 for a force that does not depend on the displacement.",
            effect=FALLING_FORCE,
            doc="distance of the exciter from the body at displacement 0: the force falls with the square of the true "
            "distance, and is held from sample to sample of `[daq]`; 0: the force does not depend on the displacement",
        ),
    ] = 0.0
    side: Annotated[
        Literal["lower", "upper"],
        Rule(
            hint="lower: a positive displacement leads away from the exciter.",
            doc='`"lower"`: a positive displacement moves the body away from the exciter; `"upper"`: towards it',
        ),
    ] = "lower"


def _noise(of: str) -> Rule:
    return Rule(unit="V", hint="Use 0 for none.", doc=f"rms of the noise of {of}")


class Noise(SceneTable):
    """`[noise]`: white Gaussian noise that is added to each sample of a channel before its conversion."""

    seed: Annotated[
        int,
        Field(ge=0, le=MOST_SEED),
        Rule(doc="another seed gives other noise; each run of a campaign has its own noise"),
    ] = 0
    sensor: Annotated[
        NotNegative, _noise("`sensor.displacement`, `sensor.velocity`, `sensor.acceleration`")
    ] = 0.0
    load_cell: Annotated[NotNegative, _noise("`load_cell`")] = 0.0
    drive: Annotated[NotNegative, _noise("the measured `drive`")] = 0.0

    def of(self, channel: str) -> float:
        """Return the rms of the noise of a channel, V.

        >>> Noise(sensor=0.1).of("sensor.velocity"), Noise(sensor=0.1).of("drive")
        (0.1, 0.0)
        """
        rms: float = getattr(self, channel.partition(".")[0])
        return rms


class Daq(SceneTable):
    """`[daq]`: the clock that samples the channels, and their conversion to numbers."""

    rate: Annotated[
        Positive, Rule(unit="Hz", doc="nominal samples per second, in place of `record.time_series.rate`")
    ]
    bits: Annotated[
        int, Field(ge=2, le=32), Rule(doc="a sample is one of 2^bits steps from -range to +range")
    ]
    range: Annotated[Positive, Rule(unit="V", doc="samples are limited to +- range")]
    skew: Annotated[
        NotNegative,
        Rule(
            unit="s",
            hint="Use 0 for channels that are sampled at once.",
            doc="time from one channel to the next, in the order of `record.time_series.variables`; all channels "
            "must be sampled within one sampling interval",
        ),
    ] = 0.0
    clock_error: Annotated[
        Finite,
        Field(ge=-MOST_PPM, le=MOST_PPM),
        Rule(
            "parts per million from -1e5 to 1e5",
            unit="ppm",
            doc="the true rate of the clock is rate (1 + clock_error / 10^6): sample k is taken k / (true rate) after "
            "the first sample, but its recorded time is k / rate",
        ),
    ] = 0.0

    @property
    def true_rate(self) -> float:
        """True number of samples in a second, where the clock shows `rate`."""
        return self.rate * (1.0 + 1e-6 * self.clock_error)
