"""What is said beside the estimates: conditioning, facts of the record, and remarks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from vibroimpact.analysis.estimation.draws import Resampled
from vibroimpact.analysis.estimation.energy import sensitivities
from vibroimpact.analysis.estimation.estimates import MethodEstimate
from vibroimpact.analysis.estimation.physics import Known
from vibroimpact.analysis.estimation.prepared import Prepared
from vibroimpact.analysis.estimation.trajectory import MOST_IMPACTS


def conditioning_of(record: Prepared, resampled: Resampled | None) -> dict[str, float]:
    """Return the sensitivities of the energy balance at the estimates."""
    if resampled is None:
        return {}
    drag = np.abs(resampled.exact[0].drag[0])
    reading = record.fit.reading
    flight, half = float(np.mean(drag[0::2] + drag[1::2])), float(np.mean(drag[1::2]))
    if not (reading.restitution > 0.0 and half > 0.0):
        return {}
    natural = record.parameters.natural_frequency
    return sensitivities(reading.restitution, reading.impact_velocity, flight, half, natural)


def facts_of(record: Prepared, resampled: Resampled | None) -> dict[str, float | str]:
    """Return what the record is like."""
    cut = record.segmentation
    peak = float(np.max(np.abs(cut.signal.values[cut.signal.good] - record.parameters.offset)))
    facts: dict[str, float | str] = {
        "impacts": float(len(cut.impacts)),
        "flights_used": float(len(record.flights)),
        "flights_left_out": float(len(cut.flights) - len(record.flights)),
        "noise": record.fit.noise,
        "noise_over_peak": record.fit.noise / peak,
        "noise_correlation": record.correlation,
        "window": cut.window,
        "side": "upper" if cut.signal.sign > 0.0 else "lower",
        "restitution_scatter": _scatter(record),
    }
    if resampled is not None:
        facts["smoothing_window"] = resampled.window
    if record.trajectory is not None:
        facts["trajectory_pieces"] = float(len(record.trajectory.pieces))
        facts["trajectory_noise"] = record.trajectory.noise
    return facts


def _scatter(record: Prepared) -> float:
    """Return the standard deviation of the restitution of single impacts; NaN of less than two."""
    ratios = [
        -other.state[1] / one.end_state[1]
        for one, other in zip(record.fit.fitted, record.fit.fitted[1:], strict=False)
        if other.flight.first == one.flight.first + 1
    ]
    return float(np.std(ratios, ddof=1)) if len(ratios) > 1 else math.nan


def remarks_of(
    record: Prepared, held: Known, values: Mapping[str, Mapping[str, MethodEstimate]]
) -> tuple[str, ...]:
    """Return what a reader must know."""
    return (*_of_flights(record), *_of_methods(record, held, values))


def _of_flights(record: Prepared) -> Iterator[str]:
    """Yield what became of the flights."""
    if record.fit.reading.periodic:
        yield "No impact has a usable flight on both sides: P(1,1) was assumed."
    if record.left_out:
        yield (
            f"{record.left_out} flights do not follow the model and were left out: an impact in them was not seen, "
            "or it is not one oscillator there."
        )
    if record.inflation > 1.0:
        yield (
            f"Neighbouring rests are correlated ({record.correlation:.2f}): coloured noise or motion that the model "
            f"lacks. Standard errors are {record.inflation:.2f} times those of white noise."
        )
    if record.trajectory is not None and len(record.flights) > MOST_IMPACTS:
        yield f"The trajectories are those of about {MOST_IMPACTS} impacts, the first."


def _of_methods(
    record: Prepared, held: Known, values: Mapping[str, Mapping[str, MethodEstimate]]
) -> Iterator[str]:
    """Yield what the methods rest on."""
    energy = any(name.startswith("energy") for name in values)
    if energy and record.names:
        yield (
            f"The energy balance took {', '.join(record.names)} from the weak form where it does not estimate them; "
            "their doubt is in its intervals."
        )
    if energy and held.damping_ratio is None:
        yield (
            "No damping ratio was given: the energy balance with known damping gives the energy-loss factor, "
            "which counts all damping as loss at the impact."
        )
    if "period_one" in values:
        yield (
            "period_one assumes undamped free motion between impacts: a start value without an interval, "
            "off by several percent for driven, damped motion."
        )
