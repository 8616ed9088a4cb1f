"""Estimates from one record: the answer of each method, and whether it is free of reasons for doubt."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from interval_coverage._records import Record, record
from vibroimpact.analysis.estimation import Forcing, ImpactEstimates, Known, estimate_impacts
from vibroimpact.analysis.recording import Channel, TimeAxis
from vibroimpact.fmus.errors import EstimationError

METHODS = ("energy_known_damping", "energy_joint", "energy_amplitude", "weak_form", "trajectory")


def estimates_of(one: Record, methods: Sequence[str] = METHODS) -> ImpactEstimates:
    """Return the estimates from a record, given its known parameters."""
    axis = TimeAxis(one.time, float(one.time[1] - one.time[0]))
    channel = Channel("tip", one.values, "m", axis, np.zeros(len(one.time), np.uint8))
    with_stop, with_damping = one.known != "frequency", one.known == "damping"
    known = Known(
        damping_ratio=one.truth["damping_ratio"] if with_damping else None,
        stop_position=one.truth["stop_position"] if with_stop else None,
        offset=one.truth["offset"] if with_damping else None,
    )
    return estimate_impacts(channel, Forcing(one.truth["angular_frequency"]), known, methods=methods)


def journal_line(place: tuple[int, int], seed: int) -> dict[str, Any]:
    """Return the line of the journal for a case and a draw of its noise.

    `sure` holds, for each method without reasons for doubt, [value, standard error, low, high, truth] by quantity.
    """
    case, draw = place
    one, begin = record(case, seed, draw), time.process_time()
    line: dict[str, Any] = {
        "case": case,
        "draw": draw,
        "region": one.region,
        "spoil": one.spoil,
        "known": one.known,
        "noise": one.noise,
        "per_period": one.per_period,
        "impacts": one.impacts,
        "flight_samples": one.flight_samples,
        "sure": {},
        "verdict": "",
    }
    try:
        found = estimates_of(one)
    except EstimationError as problem:
        line["verdict"] = f"refused: {problem}"
    else:
        line["verdict"] = found.verdict
        line["sure"] = {
            method: {
                name: [
                    value.value,
                    value.standard_error,
                    value.low,
                    value.high,
                    _near(name, one, value.value),
                ]
                for name, value in values.items()
                if name in one.truth
            }
            for method, values in found.values.items()
            if not found.reasons(method)
        }
    return line | {"seconds": time.process_time() - begin}


def _near(name: str, one: Record, value: float) -> float:
    """Return the truth; for a phase, the equivalent nearest to the estimate."""
    truth = one.truth[name]
    return truth + 2.0 * np.pi * round((value - truth) / (2.0 * np.pi)) if name == "phase" else truth
