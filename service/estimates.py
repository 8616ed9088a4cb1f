"""Estimates as jobs: what is asked for, and `vibroimpact estimate` or `spikes` run on it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from vibroimpact.analysis.commands.estimate import Estimation, decay_of, impacts_of, response_of
from vibroimpact.analysis.commands.estimate_scene import ImpactOptions
from vibroimpact.analysis.commands.options import EMBEDDING, THEILER
from vibroimpact.analysis.commands.spikes import IntervalOptions, find_spikes
from vibroimpact.analysis.spikes import Mechanics, SpikeSettings

OUTPUT = "estimates.nc"
"""What an estimate is written to, in the folder of its job."""
Name = Annotated[str, Field(min_length=1, max_length=200)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _Signal(BaseModel):
    """What every estimate may say of its data."""

    model_config = ConfigDict(extra="forbid")

    channel: Annotated[Name | None, Field(description="Channel; not needed where there is one.")] = None
    start: Annotated[Number | None, Field(description="Start of the window, s.")] = None
    stop: Annotated[Number | None, Field(description="End of the window, s.")] = None
    run: Annotated[int | None, Field(ge=0, le=2**31, description="run_index, of several runs.")] = None

    def estimation(self, data: Path) -> Estimation:
        """Return it as the command line has it."""
        return Estimation(
            data, self.channel, self.start, self.stop, self.run, data.parent / OUTPUT, None, force=True
        )


class Decay(_Signal):
    """Frequency, damping and damping law of a free decay."""

    kind: Literal["decay"]
    law: Annotated[Name, Field(description="all, none, or a sum such as viscous+coulomb.")] = "all"
    cubic: Annotated[bool, Field(description="Fit a cubic stiffness too.")] = False
    periods: Annotated[
        float | None, Field(ge=2, le=1e6, description="Periods in a window of the backbone.")
    ] = None

    def into(self, data: Path) -> None:
        """Estimate into `OUTPUT` beside the data."""
        decay_of(self.estimation(data), self.law, self.cubic, self.periods)


class Impacts(_Signal):
    """Restitution, damping, frequency and forcing of motion against a stop."""

    kind: Literal["impacts"]
    forcing_frequency: Annotated[Number | None, Field(ge=0, description="Hz; 0: no force oscillates.")] = None
    angular_frequency: Annotated[Number | None, Field(ge=0, description="The same, rad/s.")] = None
    amplitude: Annotated[Positive | None, Field(description="Of the force, N.")] = None
    static_deflection: Annotated[Positive | None, Field(description="Amplitude over stiffness.")] = None
    phase: Annotated[Number | None, Field(description="Of the force at time 0, rad.")] = None
    stop_position: Annotated[Number | None, Field(description="Of the stop, unit of the channel.")] = None
    natural_frequency: Annotated[Positive | None, Field(description="Undamped, Hz.")] = None
    damping_ratio: Annotated[Number | None, Field(description="Where it is known.")] = None
    mass: Annotated[Positive | None, Field(description="kg.")] = None
    offset: Annotated[Number | None, Field(description="What the channel reads at rest.")] = None
    clock_drifts: Annotated[bool, Field(description="Clocks of force and recording differ.")] = False

    def into(self, data: Path) -> None:
        """Estimate into `OUTPUT` beside the data."""
        known = (self.stop_position, self.natural_frequency, self.damping_ratio, self.mass, self.offset)
        forcing = (self.forcing_frequency, self.angular_frequency, self.amplitude, self.static_deflection)
        impacts_of(
            self.estimation(data), ImpactOptions(*forcing, self.phase, *known, clock_drifts=self.clock_drifts)
        )


class Response(_Signal):
    """A resonance, of a drive and a response or of a simulated sweep of the frequency."""

    kind: Literal["response"]
    drive: Annotated[Name | None, Field(description="Channel that drives.")] = None
    form: Literal["auto", "displacement", "velocity", "acceleration", "transmissibility"] = "auto"
    band: Annotated[tuple[Positive, Positive] | None, Field(description="Of the resonance, Hz.")] = None
    segment: Annotated[int | None, Field(ge=16, le=2**26, description="Samples in a segment.")] = None
    window: Literal["bartlett", "hann", "boxcar"] = "bartlett"
    estimator: Literal["h1", "h2"] = "h1"

    def into(self, data: Path) -> None:
        """Estimate into `OUTPUT` beside the data."""
        how = (self.drive, self.form, self.band, self.segment, self.window, self.estimator)
        response_of(self.estimation(data), *how)


class Spikes(BaseModel):
    """Spikes of a channel, or instants of an event train, and the intervals between them."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["spikes"]
    channel: Annotated[Name | None, Field(description="Channel; not needed where there is one.")] = None
    events: Annotated[Name | None, Field(description="An event train, in place of a channel.")] = None
    run: Annotated[int | None, Field(ge=0, le=2**31, description="run_index, of several runs.")] = None
    forcing_period: Annotated[Positive | None, Field(description="s.")] = None

    def into(self, data: Path) -> None:
        """Estimate into `OUTPUT` beside the data."""
        intervals = IntervalOptions(self.forcing_period, None, None, EMBEDDING, THEILER)
        find_spikes(
            *(data, data.parent / OUTPUT, None, self.channel, self.events, self.run),
            *(SpikeSettings(), Mechanics(), intervals),
            force=True,
        )


Estimate = Annotated[Decay | Impacts | Response | Spikes, Field(discriminator="kind")]
_ESTIMATE: TypeAdapter[Decay | Impacts | Response | Spikes] = TypeAdapter(Estimate)


def estimate(folder: Path, options: dict[str, Any]) -> None:
    """Estimate in the folder of a job.

    Parameters
    ----------
    folder : Path
    options : dict
        `data`, the name of a recording or a dataset in it, and `asked`, an `Estimate`.
    """
    _ESTIMATE.validate_python(options["asked"]).into(folder / options["data"])
