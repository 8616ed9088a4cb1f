"""Records drawn over the range of possible experiments: three levels of knowledge, and a twelfth of them spoiled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from interval_coverage._motion import Body, Impact, simulate

SPOILS = ("second mode", "second stop", "dry friction", "speed-dependent restitution")
"""Effects in one record of twelve, outside of the estimators' model."""
SPOILED_EVERY = 12
KNOWN = ("frequency", "stop", "damping")
"""Levels of knowledge, each including those before it: the forcing frequency, the stop, damping and offset."""
REGIONS = ("whole spread", "50 samples a period", "5 % noise", "forcing below .8 of resonance")
"""Parts of the range, drawn equally often: three of them hard."""
PER_PERIOD = (50, 100, 200, 500, 1000, 2000)
_NOISE, _RATIO = (1e-3, 5e-2), (0.7, 4.0)
_HARD_NOISE, _HARD_RATIO = 5e-2, (0.5, 0.8)
_FEWEST_IMPACTS = 9
_SETTLED = 30.0
# Fewest impacts on a second stop, and least relative variation of a restitution with speed, that count as visible.
_FEWEST_SHOWN = 4
_LEAST_SCATTER = 0.02


@dataclass(frozen=True)
class Record:
    """A record with its truth.

    Attributes
    ----------
    time, values : ndarray, shape (sample,)
    truth : dict
        True values, by the names of `vibroimpact.analysis.estimation.QUANTITIES`.
    region, known, spoil : str
        One of `REGIONS`, one of `KNOWN`, and one of `SPOILS` or empty.
    noise : float
        Noise as a part of the peak.
    per_period, impacts : int
    flight_samples : float
        Median number of samples between impacts.
    """

    time: np.ndarray
    values: np.ndarray
    truth: dict[str, float]
    region: str
    known: str
    spoil: str
    noise: float
    per_period: int
    impacts: int
    flight_samples: float


def record(case: int, seed: int, draw: int = 0) -> Record:
    """Return one record, fixed by case and seed; all draws of its noise share one motion."""
    rng = np.random.default_rng([seed, case])
    block, place = divmod(case, SPOILED_EVERY)
    spoil = SPOILS[block % len(SPOILS)] if place == SPOILED_EVERY - 1 else ""
    # each block has all pairs of region and known; the pair of its spoiled record changes from block to block
    region = REGIONS[(place // len(KNOWN) + block // len(SPOILS)) % len(REGIONS)]
    known = KNOWN[(case + block) % len(KNOWN)]
    while True:
        noise = np.random.default_rng([seed, case, draw]) if draw else rng
        found = _drawn(rng, region, known, spoil, noise)
        if found is not None:
            return found


def _drawn(
    rng: np.random.Generator, region: str, known: str, spoil: str, noises: np.random.Generator
) -> Record | None:
    """Return a record; None for a motion that hardly hits the stop."""
    natural, deflection = _log(rng, 10.0, 1000.0), _log(rng, 0.1, 10.0)
    ratio = _log(rng, *(_HARD_RATIO if region == REGIONS[3] else _RATIO))
    damping = _log(rng, 0.02, 0.15)
    position, restitution = rng.uniform(-0.2, 1.0) * deflection, rng.uniform(0.6, 0.9)
    frequency = ratio * natural
    per_period = int(rng.choice(PER_PERIOD[:1] if region == REGIONS[1] else PER_PERIOD))
    body = _body(natural, damping, deflection, frequency, position, restitution, spoil, rng)
    time = np.arange(round(rng.uniform(15.0, 44.0) * per_period)) * 2.0 * math.pi / frequency / per_period
    begin = 2.0 * math.pi / frequency * (_SETTLED + rng.uniform())
    rest = np.zeros((2, len(body.natural)))
    rest[0, 0] = position - rng.uniform(0.5, 2.0) * deflection
    motion, impacts = simulate(body, rest, np.append(0.0, begin + time))
    instants = np.array([impact.instant for impact in impacts if impact.instant > begin])
    if len(instants) < _FEWEST_IMPACTS or not _shows(spoil, body, impacts, begin):
        return None
    sign, offset = rng.choice([-1.0, 1.0]), rng.uniform(-2.0, 2.0) * deflection
    noise = _HARD_NOISE if region == REGIONS[2] else _log(rng, *_NOISE)
    peak = float(np.max(np.abs(motion[1:])))
    values = sign * motion[1:] + offset + noise * peak * noises.standard_normal(len(time))
    turned = body.phase + frequency * begin + (0.0 if sign > 0.0 else math.pi)
    truth = {
        "restitution": restitution,
        "damping_ratio": damping,
        "natural_frequency": natural,
        "static_deflection": deflection,
        "phase": turned % (2.0 * math.pi),
        "stop_position": sign * position + offset,
        "offset": offset,
    }
    samples = float(np.median(np.diff(instants)) / time[1])
    return Record(
        time,
        values,
        truth | {"angular_frequency": frequency},
        region,
        known,
        spoil,
        noise,
        per_period,
        len(instants),
        samples,
    )


def _shows(spoil: str, body: Body, impacts: Sequence[Impact], begin: float) -> bool:
    """Whether the spoiling effect is visible: a second stop may be missed, and speeds may be all alike."""
    seen = [impact for impact in impacts if impact.instant > begin]
    if spoil == "second stop":
        return sum(impact.side < 0.0 for impact in seen) >= _FEWEST_SHOWN
    if spoil == "speed-dependent restitution":
        return float(np.std([body.restitution(impact.speed) for impact in seen])) > _LEAST_SCATTER
    return True


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def _body(
    natural: float,
    damping: float,
    deflection: float,
    frequency: float,
    position: float,
    restitution: float,
    spoil: str,
    rng: np.random.Generator,
) -> Body:
    """Return the body with its spoiling effect, of a size that an experimenter may overlook."""
    modes, ratios, shape = [natural], [damping], [1.0]
    stops, friction = [(position, 1.0)], 0.0
    power, typical = 0.0, natural * deflection
    if spoil == "second mode":
        modes, ratios, shape = (
            [natural, rng.uniform(2.5, 6.5) * natural],
            [damping, damping],
            [1.0, rng.uniform(0.2, 0.6)],
        )
    elif spoil == "second stop":
        stops.append((position - rng.uniform(0.3, 1.0) * deflection, -1.0))
    elif spoil == "dry friction":
        friction = rng.uniform(0.02, 0.08) * deflection
    elif spoil:
        power = rng.uniform(0.1, 0.25)

    def law(speed: float) -> float:
        return float(min(1.0, restitution * (max(speed, 1e-9 * typical) / typical) ** -power))

    return Body(
        np.array(modes),
        np.array(ratios),
        np.array(shape),
        deflection,
        frequency,
        rng.uniform(0.0, 2.0 * math.pi),
        tuple(stops),
        law,
        friction,
    )
