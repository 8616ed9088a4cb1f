"""The report on the spikes of a channel, as one dataset."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.results import Row, Rows, described
from vibroimpact.analysis.recording import Channel, channel_of
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.analysis.spikes.contact import Calibration, calibrate, contact_time_measure, impact_velocity
from vibroimpact.analysis.spikes.identify import Identification, SpikeSettings, identify
from vibroimpact.analysis.spikes.pulses import FOOT, Pulses, measure_pulses
from vibroimpact.analysis.spikes.waveforms import WAVEFORMS
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, joined, message

Floats = NDArray[np.float64]

_IMPULSE_UNITS = {"m s-2": "m s-1", "1": "s", "m": "m s", "m s-1": "m"}


@dataclass(frozen=True, slots=True)
class Mechanics:
    """Numbers that turn a signal into forces and velocities; None means unknown.

    Attributes
    ----------
    mass : float or None
        Effective mass of the contact, kg.
    restitution : float or None
    sensitivity : float or None
        Sensitivity of the load cell, V/N; that of its scene, for a simulated one.
    known_impulses : ndarray of float or None
        N s, one for each spike: the sensitivity is fitted to them.
    foot : float
        Share of the peak down to which a pulse is integrated.
    waveform : str
        Waveform for the impulse below that level, or "auto".
    """

    mass: float | None = None
    restitution: float | None = None
    sensitivity: float | None = None
    known_impulses: Floats | None = None
    foot: float = FOOT
    waveform: str = "auto"


@dataclass(frozen=True, slots=True)
class SpikeReport:
    """Spikes of one channel: their identification, their pulses, and the dataset of both."""

    found: Identification
    pulses: Pulses
    dataset: xr.Dataset
    calibration: Calibration | None = None


def spike_report(
    channel: Channel | xr.DataArray, settings: SpikeSettings | None = None, mechanics: Mechanics | None = None
) -> SpikeReport:
    """Find the spikes of a channel and measure them.

    Spikes that are cut off by an end of the record are counted and left out.

    Parameters
    ----------
    channel : Channel or xarray.DataArray
        Force, voltage of a load cell, acceleration; any unit.
    settings : SpikeSettings, optional
    mechanics : Mechanics, optional

    Raises
    ------
    EstimationError
        See `identify`.
    UsageError
        A setting that does not fit the channel.
    """
    channel, known = channel_of(channel), mechanics or Mechanics()
    calibration = None
    if (
        known.sensitivity is None
        and known.known_impulses is None
        and channel.attrs.get("role") == "simulated"
        and channel.unit == "V"
    ):
        known = replace(known, sensitivity=channel.attrs.get("sensitivity"))
    if known.known_impulses is not None:
        _expect_volts(channel, "known impulses")
        pulses = measure_pulses(identify(channel, settings), known.foot, known.waveform)
        calibration = calibrate(np.abs(pulses.impulse[pulses.complete]), known.known_impulses)
        channel = in_newtons(channel, calibration.sensitivity)
    elif known.sensitivity is not None:
        _expect_volts(channel, "sensitivity")
        channel = in_newtons(channel, known.sensitivity)
    found = identify(channel, settings)
    pulses = measure_pulses(found, known.foot, known.waveform)
    return SpikeReport(found, pulses, _dataset(channel, found, pulses, known, calibration), calibration)


def unobserved(report: SpikeReport) -> tuple[tuple[float, float], ...]:
    """Return the spans (s) without samples that could hide a spike: longer than half a pulse."""
    found = report.found
    edges = np.diff(np.concatenate(([False], found.bad, [False])).astype(np.int8))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    lengths = report.dataset["spike_length"].values
    least = 0.5 * float(np.median(lengths)) if lengths.size else 0.0
    spans = zip(found.time[first], found.time[last], strict=True)
    return tuple((float(a), float(b)) for a, b in spans if b - a > least)


def _expect_volts(channel: Channel, what: str) -> None:
    unit = measured_unit(channel.unit).si
    if unit not in ("V", "1"):
        raise UsageError(f"{what}: expected a channel in volts, got {channel.name} in {unit}. Leave it out.")


def in_newtons(channel: Channel, sensitivity: float) -> Channel:
    """Return the channel of a load cell as force: volts over sensitivity (V/N).

    Raises
    ------
    UsageError
        The sensitivity is not above 0.
    """
    if not sensitivity > 0.0:
        raise UsageError(f"sensitivity: expected more than 0 V/N, got {sensitivity!r}.")
    return replace(channel, values=channel.si() / sensitivity, unit="N")


def impulse_unit(unit: str) -> str:
    """Return the SI unit of the integral over time of a signal.

    >>> impulse_unit("N"), impulse_unit("m s-2")
    ('N s', 'm s-1')
    """
    return _IMPULSE_UNITS.get(unit, f"{unit} s")


def _dataset(
    channel: Channel, found: Identification, pulses: Pulses, known: Mechanics, calibration: Calibration | None
) -> xr.Dataset:
    kept = pulses.complete
    columns = _columns(found, pulses, known)
    variables = described(
        {
            **{name: ("spike", values[kept], unit, words) for name, (values, unit, words) in columns.items()},
            **_fits(found, pulses),
            **_scalars(found, pulses, calibration),
        }
    )
    curves = described({"waveform": ("waveform", np.array(list(WAVEFORMS)), "1", "fitted curve")})
    return xr.Dataset(variables, curves, _attributes(channel, found, pulses, known))


def _columns(
    found: Identification, pulses: Pulses, known: Mechanics
) -> dict[str, tuple[NDArray[Any], str, str]]:
    """Return values, unit and words of each variable of a spike."""
    unit, whole = found.unit, impulse_unit(found.unit)
    short = "most that the largest sample can fall short of the peak"
    columns: dict[str, tuple[NDArray[Any], str, str]] = {
        "spike_time": (pulses.start, "s", "first upward crossing of the threshold"),
        "spike_end": (pulses.end, "s", "end of the spike and its ringing"),
        "spike_peak_time": (pulses.peak_time, "s", "instant of the peak"),
        "spike_duration": (pulses.duration, "s", "time above the threshold, without ringing"),
        "spike_length": (pulses.length, "s", "length of the pulse from foot to foot"),
        "spike_peak": (pulses.peak, unit, "peak, band-limited between the samples"),
        "spike_peak_error": (pulses.peak_error, unit, "error of the peak by noise and resampling"),
        "spike_peak_sampled": (pulses.sampled_peak, unit, "largest sample"),
        "spike_peak_deficit": (pulses.deficit, unit, short),
        "spike_impulse": (pulses.impulse, whole, "impulse down to the baseline"),
        "spike_impulse_error": (pulses.impulse_error, whole, "error of the impulse by noise and waveform"),
        "spike_impulse_above": (pulses.impulse_above, whole, "impulse while above the threshold"),
        "spike_excursions": (pulses.excursions, "1", "excursions past the threshold, ringing included"),
        "spike_clipped": (pulses.clipped.astype(np.int8), "1", "whether samples are clipped or missing"),
    }
    velocity = _velocity(found.unit, pulses, known)
    if velocity is not None:
        values, errors = velocity
        columns["spike_velocity"] = (values, "m s-1", "velocity before impact")
        columns["spike_velocity_error"] = (errors, "m s-1", "error of the velocity by that of the impulse")
    return columns


def _velocity(unit: str, pulses: Pulses, known: Mechanics) -> tuple[Floats, Floats] | None:
    """Return velocities before impact and their errors, if mass and restitution are known."""
    if known.restitution is None:
        if known.mass is not None:
            raise UsageError(
                message(
                    "mass: expected a restitution with it, got none. Give ", Argument("restitution"), " too."
                )
            )
        return None
    if unit == "m s-2":
        mass = None
    elif unit == "N":
        mass = known.mass
        if mass is None:
            raise UsageError(
                message("restitution: expected a mass with it, got none. Give ", Argument("mass"), " too.")
            )
    else:
        raise UsageError(
            message(
                f"restitution: expected a force or an acceleration, got a channel in {unit}. Give ",
                *(Argument("sensitivity"), " for a load cell in volts."),
            )
        )
    return (
        impact_velocity(pulses.impulse, known.restitution, mass),
        impact_velocity(pulses.impulse_error, known.restitution, mass),
    )


def _fits(found: Identification, pulses: Pulses) -> Rows:
    """Return the parameters of the fitted curves, by curve and spike."""
    kept = pulses.complete
    fields = {
        "peak": (found.unit, "peak of the fitted curve"),
        "length": ("s", "length of the fitted curve; its standard deviation for a bell"),
        "middle": ("s", "middle of the fitted curve"),
        "goodness": ("1", "part of the variance within the pulse that the curve explains"),
    }
    rows: dict[str, Row] = {}
    for field, (unit, words) in fields.items():
        values = np.array([getattr(pulses.fits[each], field)[kept] for each in WAVEFORMS])
        rows[f"spike_fit_{field}"] = (("waveform", "spike"), values, unit, words)
    return rows


def _scalars(found: Identification, pulses: Pulses, calibration: Calibration | None) -> Rows:
    """Return the variables of the whole record."""
    unit = "1" if found.method == "cycle_median" else found.unit
    kept = pulses.complete
    cut_off, window = float(np.count_nonzero(~kept)), found.baseline_window * found.interval
    rows: dict[str, Row] = {
        "threshold": ((), found.threshold, unit, "threshold"),
        "lower_threshold": ((), found.lower_threshold, unit, "threshold at which a spike is over"),
        "noise": ((), found.noise, found.unit, "standard deviation of the noise, robust"),
        "noise_tail_shape": ((), found.tail.shape, "1", "shape of the tail of the noise, generalised Pareto"),
        "false_alarms": ((), found.settings.false_alarms, "1", "noise peaks expected above the threshold"),
        "baseline_window": ((), window, "s", "window of the baseline"),
        "spikes_cut_off": ((), cut_off, "1", "spikes cut off by an end of the record"),
        "excursions_too_short": ((), float(found.short), "1", "excursions of too few samples"),
        "settled": ((), found.settled, "s", "end of the start of a periodic motion"),
    }
    if found.cycle.found:
        period = found.cycle.period * found.interval
        rows["excitation_period"] = ((), period, "s", "period of the excitation")
    if np.count_nonzero(kept) >= 2:
        for name, contacts, words in (
            ("contact_time_measure", pulses.duration, "part of the time above the threshold"),
            ("contact_time_measure_feet", pulses.length, "part of the time between the feet of pulses"),
        ):
            share = contact_time_measure(pulses.start[kept], contacts[kept])
            rows[name] = ((), share.measure, "1", words)
            rows[f"{name}_error"] = ((), share.standard_error, "1", "its standard error")
    if calibration is not None:
        fitted = "sensitivity of the load cell, fitted"
        rows["sensitivity"] = ((), calibration.sensitivity, "V N-1", fitted)
        rows["sensitivity_error"] = ((), calibration.standard_error, "V N-1", "its standard error")
    return rows


def _attributes(
    channel: Channel, found: Identification, pulses: Pulses, known: Mechanics
) -> dict[str, str | float | int]:
    """Return the attributes: verdict and remarks in words, and every setting."""
    settings = found.settings
    attributes: dict[str, str | float | int | None] = {
        "results_kind": "spikes",
        "channel": channel.name,
        "method": found.method,
        "method_reason": found.reason,
        "polarity": settings.polarity,
        "minimum_samples": settings.minimum_samples,
        "merge": settings.merge if settings.merge is not None else "automatic",
        "waveform": pulses.waveform,
        "foot": known.foot,
        "mass": known.mass,
        "restitution": known.restitution,
        "sensitivity": known.sensitivity,
        "interval_uncertainty": channel.axis.interval_uncertainty,
        "verdict": found.verdict,
        "remarks": joined("\n", found.remarks),
    }
    return {name: value for name, value in attributes.items() if value is not None}
