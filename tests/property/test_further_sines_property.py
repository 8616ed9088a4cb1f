"""Several sines on a Structure: any of them may be the clock's, phases stay exact, energies balance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.component_fmu import HERTZ, KELVIN_VOIGT, LOWER, UPPER, ComponentFmu, stop
from support.modal_fmu import structure_fmu

RIGID = 1
SEEDS = st.integers(0, 2**32 - 1)
MOTION = ("displacement", "velocity", "acceleration", "contact[1].count")
WORK = ("energy.forcing_work", "energy.damping_loss", "energy.contact_loss")


class Sine(NamedTuple):
    """A force: amplitude, angular frequency and phase of a cosine."""

    amplitude: float
    angular_frequency: float
    phase: float


class Body(NamedTuple):
    """Modes with the shape of their forced point, and of their contacts."""

    frequencies: np.ndarray
    ratios: np.ndarray
    forced: np.ndarray
    contacts: np.ndarray


def body_of(random: np.random.Generator, contacts: int) -> Body:
    modes = int(random.integers(1, 5))
    undamped = random.random() < 0.2
    ratios = np.zeros(modes) if undamped else random.uniform(0.0, 0.1, modes)
    shapes = 1.0 + random.normal(size=(contacts, modes))
    return Body(
        np.sort(random.uniform(0.3, 6.0, modes)), ratios, 1.0 + 0.3 * random.normal(size=modes), shapes
    )


def sines_of(random: np.random.Generator, body: Body, count: int) -> list[Sine]:
    """Return sines at any frequencies, now and then at that of a mode."""
    frequencies = [
        body.frequencies[0] if random.random() < 0.15 else random.uniform(0.2, 4.0) for _ in range(count)
    ]
    return [Sine(random.uniform(0.1, 1.0), float(w), random.uniform(0.0, 2.0 * math.pi)) for w in frequencies]


def fmu_of(
    body: Body,
    sines: Sequence[Sine],
    clock: Sine | None,
    parameters: Mapping[str, float] = {},
    **options: Any,
) -> ComponentFmu:
    """Return a Structure with the forces of `clock` and of further sines, all at the forced point."""
    given: dict[str, float] = dict(parameters)
    for place, sine in [*enumerate(sines, start=1), *([(0, clock)] if clock else [])]:
        block = f"sine[{place}]" if place else "forcing"
        given |= {f"{block}.{name}": value for name, value in sine._asdict().items()}
    arrays = {
        "mode.angular_frequency": body.frequencies,
        "mode.damping_ratio": body.ratios,
        "mode.forcing": body.forced,
        "mode.observed_shape": body.forced,
        "mode.contact_shape": body.contacts,
        "mode.sine": np.tile(body.forced, (max(1, len(sines)), 1)),
    }
    return structure_fmu(arrays, given, **options)


def stops_of(random: np.random.Generator, count: int) -> dict[str, float]:
    law = int(random.choice([RIGID, RIGID, KELVIN_VOIGT, HERTZ]))
    found: dict[str, float] = {}
    for number, side in enumerate((UPPER, LOWER)[:count], start=1):
        position = random.uniform(0.05, 0.5) * (1.0 if side == UPPER else -1.0)
        answer = (
            {"restitution": random.uniform(0.0, 0.9)} if law == RIGID else {"law": law, "stiffness": 50.0}
        )
        found |= stop(position, k=number, side=side, **answer)
    return found


def end_of(fmu: ComponentFmu, end: float, names: Sequence[str]) -> np.ndarray:
    with fmu:
        fmu.step(end)
        return np.array([fmu.get(name) for name in names])


@given(SEEDS)
@settings(max_examples=25)
def test_any_sine_may_be_the_clock(seed: int) -> None:
    random = np.random.default_rng(seed)
    contacts = int(random.integers(1, 3))
    body, parameters = body_of(random, contacts), stops_of(random, contacts)
    sines, end = sines_of(random, body, int(random.integers(2, 5))), random.uniform(4.0, 8.0)
    first, *rest = sines
    *others, last = sines
    ends = [
        end_of(fmu_of(body, further, clock, parameters), end, MOTION)
        for further, clock in ((rest, first), (others, last), (sines, None))
    ]
    assert ends[1] == pytest.approx(ends[0], abs=1e-10)
    assert ends[2] == pytest.approx(ends[0], abs=1e-10)


def superposed(body: Body, sines: Sequence[Sine], time: float) -> tuple[float, float]:
    """Return displacement and velocity of the forced point from rest, to 40 digits."""
    with mp.workdps(40):
        total = [mp.mpf(0), mp.mpf(0)]
        for natural, ratio, shape in zip(*map(np.ndarray.tolist, body[:3]), strict=True):
            w, decay = mp.mpf(natural), mp.mpf(ratio) * mp.mpf(natural)
            rate = mp.sqrt(w**2 - decay**2)
            start, now = [mp.mpf(0), mp.mpf(0)], [mp.mpf(0), mp.mpf(0)]
            for sine in sines:
                turn = mp.mpc(0, sine.angular_frequency)
                response = sine.amplitude * mp.mpf(shape) / (w**2 + turn**2 + 2 * decay * turn)
                for at, sums in ((mp.mpf(0), start), (mp.mpf(time), now)):
                    wave = response * mp.exp(turn * at + mp.mpc(0, sine.phase))
                    sums[0] += wave.real
                    sums[1] += (turn * wave).real
            fade, c, s = mp.exp(-decay * time), mp.cos(rate * time), mp.sin(rate * time)
            x, v = -start[0], -start[1]
            now[0] += fade * (x * c + (v + decay * x) / rate * s)
            now[1] += fade * (v * c - (decay * v + w**2 * x) / rate * s)
            total = [total[i] + mp.mpf(shape) * now[i] for i in (0, 1)]
        return float(total[0]), float(total[1])


@given(SEEDS, st.sampled_from([1.0, 100.0, 1e6]))
@settings(max_examples=20)
def test_motions_add_up_and_the_millionth_period_is_as_exact_as_the_first(seed: int, periods: float) -> None:
    random = np.random.default_rng(seed)
    body = body_of(random, 0)
    clock, *sines = sines_of(random, body._replace(frequencies=np.array([5.0])), 4)
    time = 2.0 * math.pi * periods / clock.angular_frequency
    parameters = {"record.extrema": False}
    reached = end_of(fmu_of(body, sines, clock, parameters), time, MOTION[:2])
    expected = superposed(body, [clock, *sines], time)
    size = 1.0 + sum(sine.amplitude for sine in (clock, *sines)) / body.frequencies[0] ** 2
    assert reached == pytest.approx(expected, abs=1e-11 * size)


@given(SEEDS)
@settings(max_examples=20)
def test_the_work_of_all_sines_is_kept_or_lost(seed: int) -> None:
    random = np.random.default_rng(seed)
    body = body_of(random, 1)
    clock, *sines = sines_of(random, body, 3)
    parameters = {**stop(0.2, restitution=0.6), "record.energies": True}
    names = (*WORK, "energy.kinetic", "energy.potential")
    work, damping, contact, kinetic, potential = end_of(fmu_of(body, sines, clock, parameters), 20.0, names)
    assert work - damping - contact == pytest.approx(kinetic + potential, rel=1e-9, abs=1e-11)


@given(SEEDS, st.floats(-0.3, 0.3))
@settings(max_examples=15)
def test_a_sine_of_frequency_zero_is_a_constant_load(seed: int, load: float) -> None:
    # one mode: a constant load moves the place of rest, as a stop nearer by as much
    random = np.random.default_rng(seed)
    w, clock = random.uniform(0.5, 3.0), Sine(0.6, random.uniform(0.3, 2.0), 0.2)
    body = Body(np.array([w]), np.array([0.05]), np.array([1.0]), np.array([[1.0]]))
    offset = load / w**2
    loaded = fmu_of(body, [Sine(load, 0.0, 0.0)], clock, stop(0.4, restitution=0.7))
    moved = structure_fmu(
        {
            "mode.angular_frequency": [w],
            "mode.damping_ratio": [0.05],
            "mode.displacement_start": [-offset],
        },
        {f"forcing.{k}": v for k, v in clock._asdict().items()} | stop(0.4 - offset, restitution=0.7),
    )
    names = ("displacement", "velocity", "contact[1].count")
    with_load, without = end_of(loaded, 15.0, names), end_of(moved, 15.0, names)
    assert with_load == pytest.approx(np.add(without, [offset, 0.0, 0.0]), abs=1e-9)
