"""Conditioning, facts of the record, remarks and doubts that accompany the estimates, each in one sentence."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from vibroimpact.analysis.estimation.draws import Resampled
from vibroimpact.analysis.estimation.energy import sensitivities
from vibroimpact.analysis.estimation.estimates import ANSWERING, Doubt, MethodEstimate
from vibroimpact.analysis.estimation.flight_fit import pairs_of
from vibroimpact.analysis.estimation.model_tests import (
    dry_friction,
    excess_of_trajectories,
    slope_of_restitution,
    unexplained_flights,
)
from vibroimpact.analysis.estimation.prepared import Prepared
from vibroimpact.analysis.estimation.trajectory import MOST_IMPACTS
from vibroimpact.fmus.messages import Argument, message

# Standard errors above which evidence against the model counts: chance exceeds them once in a thousand times.
_SIGNIFICANT = 3.3
# Number of kinks the other way, and their share of the impacts, above which there is a second stop.
_FEWEST_OPPOSITE, _PART_OPPOSITE = 3, 0.1
# Shares of kinks away from the stop, and of unexplained flights, above which there is a doubt.
_PART_AWAY = 0.15
_PART_UNEXPLAINED = 0.15
# Noise, relative to the motion's range, below which it is the rounding of a simulation.
_ROUNDING = 1e-6
_FEWEST_IMPACTS = 5
_FEWEST_SAMPLES = 12
# Difference of two methods, in their joint standard errors, above which they contradict each other.
_CONTRADICTION = 3.0
# Relative standard error of a natural frequency above which stiffness, force and offset fit equally well along a
# valley. In 300 records, 72 to 82 % of the intervals held the truth between .04 and .07, and 94 % below .03.
_DETERMINED = 0.04
_CLOCKS = message(", or clocks that differ (", Argument("clock_drifts"), ")")

Values = Mapping[str, Mapping[str, MethodEstimate]]


def conditioning_of(record: Prepared, resampled: Resampled | None) -> dict[str, float]:
    """Return the sensitivities of the energy balance at the estimates."""
    if resampled is None:
        return {}
    drag = np.abs(resampled.exact.drag[0])
    reading = record.fit.reading
    flight, half = float(np.mean(drag[0::2] + drag[1::2])), float(np.mean(drag[1::2]))
    if not (reading.restitution > 0.0 and half > 0.0):
        return {}
    natural = record.parameters.natural_frequency
    return sensitivities(reading.restitution, reading.impact_velocity, flight, half, natural)


def facts_of(record: Prepared, resampled: Resampled | None) -> dict[str, float | str]:
    """Return the facts about the record."""
    cut, signal = record.segmentation, record.signal
    peak = float(np.max(np.abs(signal.values[signal.good] - record.parameters.offset)))
    facts: dict[str, float | str] = {
        "impacts": float(len(cut.impacts)),
        "flights_used": float(len(record.flights)),
        "flights_left_out": float(len(cut.flights) - len(record.flights)),
        "noise": record.fit.noise,
        "noise_over_peak": record.fit.noise / peak,
        "noise_correlation": record.correlation,
        "window": cut.window,
        "side": signal.side,
        "restitution_scatter": _scatter(record),
    }
    if resampled is not None:
        facts["smoothing_window"] = resampled.window
    if record.trajectory is not None:
        facts["trajectory_pieces"] = float(len(record.trajectory.pieces))
        facts["trajectory_noise"] = record.trajectory.noise
    return facts


def _scatter(record: Prepared) -> float:
    """Return the standard deviation of the restitution of single impacts; NaN for fewer than two."""
    ratios = [
        -other.state[1] / one.end_state[1]
        for one, other in zip(record.fit.fitted, record.fit.fitted[1:], strict=False)
        if other.flight.first == one.flight.first + 1
    ]
    return float(np.std(ratios, ddof=1)) if len(ratios) > 1 else math.nan


def remarks_of(record: Prepared, values: Values) -> Iterator[str]:
    """Yield the remarks for a reader."""
    if record.fit.reading.periodic:
        yield "No impact has a usable flight on both sides: P(1,1) was assumed."
    if record.left_out:
        yield (
            f"{record.left_out} flights do not follow the model and were left out: an impact in them was not seen, "
            "or it is not one oscillator there."
        )
    if record.inflation > 1.0:
        yield (
            f"Neighbouring residuals are correlated ({record.correlation:.2f}): coloured noise, or motion outside the "
            f"model. Standard errors are {record.inflation:.2f} times those of white noise."
        )
    if record.trajectory is not None and len(record.flights) > MOST_IMPACTS:
        yield f"The trajectories are those of about {MOST_IMPACTS} impacts, the first."
    energy = any(name.startswith("energy") for name in values)
    if energy and record.names:
        yield (
            f"The energy balance took {', '.join(record.names)} from the weak form where it does not estimate them; "
            "their doubt is in its intervals."
        )
    if energy and record.held.damping_ratio is None:
        yield (
            "No damping ratio was given: the energy balance with known damping gives the energy-loss factor, "
            "which counts all damping as loss at the impact."
        )
    if "period_one" in values:
        yield (
            "period_one assumes undamped free motion between impacts: a start value without an interval, "
            "off by several percent for driven, damped motion."
        )


def doubts_of(record: Prepared, values: Values, confidence: float) -> tuple[Doubt, ...]:
    """Return the doubts about the estimates of a record, the most serious first; intervals have this confidence."""
    clocks = "" if record.forcing.clock_drifts else _CLOCKS
    # without noise the residual is rounding, and its standard errors mean nothing
    noisy = record.fit.noise > _ROUNDING * record.signal.range
    return (
        *_of_stops(record),
        *_of_flights(record, clocks),
        *(_of_model(record, clocks) if noisy else ()),
        *_of_constancy(record, clocks),
        *(_of_contradictions(values, confidence) if noisy else ()),
        *_of_precision(record, values),
    )


def _of_stops(record: Prepared) -> Iterator[Doubt]:
    """Yield doubts from kinks that do not belong to one stop."""
    cut = record.segmentation
    if cut.opposite >= max(_FEWEST_OPPOSITE, _PART_OPPOSITE * len(cut.impacts)):
        yield Doubt(f"{cut.opposite} impacts turn the motion the other way: there is a second stop")
    if cut.passed:
        yield Doubt("the motion goes beyond the level of its impacts: they are not those of one stop")
    if cut.stray > _PART_AWAY * (cut.stray + len(cut.impacts)):
        yield Doubt(
            f"{cut.stray} of {cut.stray + len(cut.impacts)} jumps of the velocity are not where the others are: "
            "the stop is not one place, or the channel is not the displacement of the contact"
        )


def _of_flights(record: Prepared, clocks: str) -> Iterator[Doubt]:
    """Yield doubts from the number of flights, and from flights that do not follow the model."""
    missed, used = unexplained_flights(record), len(record.flights)
    pairs = sum(one != other for one, other in pairs_of(record.flights))
    if pairs < _FEWEST_IMPACTS:
        yield Doubt(f"only {pairs} impacts have a usable flight on both sides: record more of them")
    if missed > max(1.0, _PART_UNEXPLAINED * (missed + used)):
        yield Doubt(
            message(
                f"{missed} of {missed + record.left_out - missed + used} flights do not follow one oscillator with "
                "this force: a second mode, another force",
                clocks,
            )
        )
    samples = float(np.median([len(flight.index) for flight in record.flights]))
    if samples < _FEWEST_SAMPLES:
        yield Doubt(f"flights have {samples:.0f} samples: {_FEWEST_SAMPLES} are needed, sample faster")


def _of_model(record: Prepared, clocks: str) -> Iterator[Doubt]:
    """Yield doubts about one linear oscillator with white noise and one restitution."""
    if record.inflation > 1.0:
        yield Doubt(
            f"what the motion leaves is no white noise (correlation {record.correlation:.2f} from sample to sample): "
            "a sensor that filters, or motion that the model lacks"
        )
    slope, error = slope_of_restitution(record)
    if abs(slope) > _SIGNIFICANT * error:
        yield Doubt(
            f"the restitution changes with the speed of impact ({slope:+.2g} +- {error:.1g} at double the typical "
            "speed), or friction does"
        )
    friction, error = dry_friction(record)
    if abs(friction) > _SIGNIFICANT * error:
        yield Doubt(
            f"the flights show dry friction ({abs(friction):.2g} +- {error:.1g} over the stiffness), or other damping "
            "that is not viscous"
        )
    excess = excess_of_trajectories(record)
    if excess > _SIGNIFICANT:
        yield Doubt(
            message(
                f"trajectories through the impacts leave more than the flights between them, by {excess:.0f} standard "
                "errors: the restitution or the stop is not the same at all impacts",
                clocks,
            )
        )
    if excess < -_SIGNIFICANT:
        yield Doubt(
            f"the trajectories follow the flights better than the weak form does, by {-excess:.0f} standard errors",
            tuple(name for name in ANSWERING if name != "trajectory"),
        )


def _of_constancy(record: Prepared, clocks: str) -> Iterator[Doubt]:
    """Yield a doubt if trajectories do not follow motion that single flights follow."""
    if record.trajectory is not None and not record.trajectory.adequate:
        yield Doubt(
            message(
                f"the fitted trajectories leave {record.trajectory.noise:.3g}, the single flights "
                f"{record.fit.noise:.3g}: restitution or forcing is not constant",
                clocks,
            )
        )


def _of_contradictions(values: Values, confidence: float) -> Iterator[Doubt]:
    """Yield a doubt for each method that differs by more than chance explains.

    Once in twenty times, a 95 % interval does not meet a much narrower interval.
    """
    best = next((name for name in ("trajectory", "weak_form") if name in values), None)
    for method in ANSWERING:
        if best is None or method not in values or method == best:
            continue
        disjoint = [
            name
            for name, one in values[method].items()
            if name in values[best] and _contradict(name, one, values[best][name], confidence)
        ]
        if disjoint:
            quantities = " and ".join(name.replace("_", " ") for name in disjoint)
            yield Doubt(
                f"{method} and {best} contradict each other about {quantities}",
                () if method == "weak_form" else (method,),
            )


def _contradict(name: str, one: MethodEstimate, other: MethodEstimate, confidence: float) -> bool:
    """Tell whether two intervals are disjoint, by more than chance explains."""
    from scipy.stats import norm

    turn = 2.0 * math.pi * round((other.value - one.value) / (2.0 * math.pi)) if name == "phase" else 0.0
    gap = one.value + turn - other.value
    between = one.value - one.low, other.high - other.value
    if gap <= 0.0:
        between = one.high - one.value, other.value - other.low
    reach = _CONTRADICTION / float(norm.ppf(0.5 + 0.5 * confidence)) * math.hypot(*between)
    return abs(gap) > max(sum(between), reach)


def _of_precision(record: Prepared, values: Values) -> Iterator[Doubt]:
    """Yield a doubt for each method whose numbers the data hardly determine."""
    for method in ANSWERING:
        found = values.get(method, {})
        natural = found.get("natural_frequency")
        free = "natural_frequency" in record.names
        if method in ("weak_form", "trajectory") and method in values and free and natural is None:
            yield Doubt("the motion does not determine the natural frequency: give it", (method,))
        elif natural is not None and natural.standard_error > _DETERMINED * natural.value:
            yield Doubt(
                f"the motion hardly determines the natural frequency ({natural.value:.3g} +- "
                f"{natural.standard_error:.1g} rad/s), stiffness, force and offset fit alike: give it",
                (method,),
            )
        restitution = found.get("restitution")
        if restitution is not None and restitution.value > 1.0:
            yield Doubt(f"a restitution of {restitution.value:.3g} is not between 0 and 1", (method,))
        if restitution is not None and restitution.value < 0.0:
            yield Doubt("the restitution that fits best is below 0, and given as 0", (method,))
        damping = found.get("damping_ratio")
        if damping is not None and damping.value < 0.0:
            yield Doubt(f"a damping ratio of {damping.value:.2g} is below 0", (method,))
