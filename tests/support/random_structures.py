"""Random bodies of many modes with random stops, and comparable runs of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from support.structure import DONE, IMPACT_LIMIT, Modes, Stop, Structure

Array = NDArray[np.float64]

RIGID, COMPLIANT = ("restitution",), ("kelvin_voigt", "hertz", "hunt_crossley")
ALL_LAWS = RIGID + COMPLIANT
POWER = ("hertz", "hunt_crossley")
MOST_IMPACTS = 3000
"""Largest number of impacts of one run: an elastic body pressed to its stop may bounce for ever. The rest is cut."""


def depth_at(stop: Stop, q: Array) -> float:
    """Return the penetration of a stop at these modal displacements, m."""
    sign = 1.0 if stop.side == "upper" else -1.0
    return max(0.0, sign * (float(np.asarray(stop.shape) @ q) - stop.position))


@dataclass(frozen=True)
class Scene:
    """A body, its stops and its start, as numbers that can be mirrored, rescaled and reordered."""

    modes: Modes
    stops: tuple[Stop, ...]
    q: Array
    p: Array
    duration: float

    def body(self, *, energies: bool = False, extrema: bool = False) -> Structure:
        """Return the body at time 0."""
        return Structure(self.modes, self.stops, self.q, self.p, energies=energies, extrema=extrema)

    def nudged(self, size: float) -> Scene:
        """Return the scene with start velocities changed by `size` times `speed`, with a sign alternating by mode."""
        signs = np.where(np.arange(len(self.p)) % 2 == 0, 1.0, -1.0)
        return replace(self, p=self.p + size * self.speed * signs)

    @property
    def speed(self) -> float:
        """Size of the modal velocities of this body, m/s kg^(1/2)."""
        natural = np.asarray(self.modes.natural)
        pushed = np.abs(np.asarray(self.modes.force)).max() / max(1.0, natural.min())
        thrown = np.sqrt(2.0 * self.stored)
        return float(max(np.abs(self.p).max(), (natural * np.abs(self.q)).max(), pushed, thrown, 1e-3))

    @property
    def stored(self) -> float:
        """Energy stored in the stops at the start, J."""
        energy = 0.0
        for stop in self.stops:
            exponent = {"hertz": 1.5, "hunt_crossley": stop.exponent}.get(stop.law, 1.0)
            energy += stop.stiffness * depth_at(stop, self.q) ** (exponent + 1.0) / (exponent + 1.0)
        return energy

    def disturbed(self, reached: Array, *, first: int) -> Scene:
        """Return the scene with every other stop, from `first` on, moved out by `SHIFT` times the displacements there.

        Stops with a power law are also stiffer by `NUDGE_POWER`.
        """
        stops = list(self.stops)
        for k in range(first, len(stops), 2):
            stop, out = stops[k], SHIFT if stops[k].side == "upper" else -SHIFT
            displacement = abs(stop.position) + float(np.abs(np.asarray(stop.shape)) @ reached)
            stiffer = 1.0 + NUDGE_POWER if stop.law in POWER else 1.0
            stops[k] = replace(
                stop, position=stop.position + out * displacement, stiffness=stiffer * stop.stiffness
            )
        return replace(self, stops=tuple(stops))


def no_less(value: float) -> float:
    """Return a number without values between 0 and 1e-6: squares of smaller numbers underflow, outside of the tests."""
    return value if abs(value) >= 1e-6 else 0.0


@st.composite
def bodies(draw: st.DrawFn, *, forced: bool | None = None, most: int = 8) -> Modes:
    """Draw modes of any frequencies and damping, forced or not (None: either)."""
    n = draw(st.integers(1, most))
    natural = sorted(draw(st.lists(st.floats(0.3, 15.0), min_size=n, max_size=n)))
    ratios = st.one_of(st.floats(0.0, 0.3).map(no_less), st.sampled_from([0.0, 0.02, 1.0, 3.0]))
    zeta = draw(st.lists(ratios, min_size=n, max_size=n))
    coupling = None
    if (
        draw(st.integers(0, 3)) == 0
    ):  # damping that couples the modes: any symmetric matrix that never adds energy
        entries = st.lists(st.floats(-0.6, 0.6).map(no_less), min_size=n * n, max_size=n * n)
        root = np.array(draw(entries)).reshape(n, n)
        coupling = root @ root.T
    if not (draw(st.booleans()) if forced is None else forced):
        return Modes(natural, zeta, coupling=coupling)
    force = draw(st.lists(st.floats(-2.0, 2.0).map(no_less), min_size=n, max_size=n))
    return Modes(natural, zeta, force, draw(st.floats(0.3, 5.0)), draw(st.floats(-3.0, 3.0)), coupling)


@st.composite
def laws(draw: st.DrawFn, allowed: Sequence[str] = ALL_LAWS) -> dict[str, float | str]:
    """Draw the parameters of a stop's law."""
    law = draw(st.sampled_from(list(allowed)))
    if law == "restitution":
        r = draw(st.one_of(st.floats(0.0, 0.95), st.sampled_from([0.0, 1.0])))
        return {"law": law, "restitution": r, "yield_velocity": draw(st.sampled_from([0.0, 0.0, 0.1]))}
    chosen: dict[str, float | str] = {"law": law, "stiffness": 10.0 ** draw(st.floats(0.0, 4.0))}
    if law == "kelvin_voigt":
        chosen["damping"] = draw(st.sampled_from([0.0, 0.1, 1.0, 10.0, 300.0]))
    if law == "hunt_crossley":
        chosen |= {"damping": draw(st.sampled_from([0.0, 0.1, 1.0])), "exponent": draw(st.floats(1.0, 2.5))}
    return chosen


@st.composite
def scenes(
    draw: st.DrawFn,
    allowed: Sequence[str] = ALL_LAWS,
    *,
    forced: bool | None = None,
    most_modes: int = 8,
    most_stops: int = 3,
    elastic: bool = True,
) -> Scene:
    """Draw bodies with one to `most_stops` stops in random places, started on their free sides (or on a stop).

    `elastic` False excludes the restitution of exactly 1.
    """
    modes = draw(bodies(forced=forced, most=most_modes))
    n = len(np.asarray(modes.natural))
    numbers = st.floats(-1.0, 1.0).map(no_less)
    vector = st.lists(numbers, min_size=n, max_size=n).map(np.array)
    q, p = draw(vector), 2.0 * draw(vector)
    stops = []
    for number in range(draw(st.integers(1, most_stops))):
        shape, side = draw(vector), draw(st.sampled_from(["upper", "lower"]))
        shape[draw(st.integers(0, n - 1))] += draw(
            st.sampled_from([-1.5, 1.5])
        )  # no stop at a point without motion
        # only the first stop may be touched at the start. With two, a joint impact and two successive ones differ
        # without a continuous transition, and rounding would decide between them
        gap = draw(st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 0.1])))
        gap = gap if number == 0 else max(gap, 0.05)
        # slightly on the free side: the sum in C may round to the other side
        position = float(shape @ q) + (gap + 1e-14) * (1.0 if side == "upper" else -1.0)
        law = draw(laws(allowed))
        if not elastic and law.get("restitution") == 1.0:
            law["restitution"] = 0.8
        stops.append(Stop(shape, position, side=side, **law))  # type: ignore[arg-type]
    return Scene(modes, tuple(stops), q, p, draw(st.floats(0.5, 6.0)))


@dataclass
class Run:
    """Result of a run: states at the given times, up to its end."""

    times: list[float] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)
    counts: list[tuple[int, ...]] = field(default_factory=list)
    ended: int = DONE


def follow(scene: Scene, times: Iterable[float], *, stepped: Sequence[float] = ()) -> Run:
    """Run a scene and store its states at these times; `stepped`: further times at which a step ends."""
    instants, run = sorted(set(times)), Run()
    with scene.body() as body:
        for time in sorted({*instants, *stepped}):
            if time <= body.time:
                continue
            run.ended = body.advance(time - body.time, most_impacts=max(1, MOST_IMPACTS - len(body.impacts)))
            if run.ended == IMPACT_LIMIT:
                return run
            if time in instants:
                rows = body.impacts
                run.times.append(time)
                run.states.append(np.concatenate([body.displacement, body.velocity]))
                run.counts.append(tuple(int(np.sum(rows[:, 5] == k + 1)) for k in range(len(scene.stops))))
    return run


NUDGE = 1e-13
"""Relative change of a start velocity: some hundred times the possible effect of rounding in a run."""
NUDGE_POWER = 1e-10
"""The same for power laws, solved to the default tolerance: the end of a step changes the segments of a contact."""


SHIFT = 1e-15
"""Shift of a stop over the displacements that add up there: the possible effect of rounding on each contact."""


def apart(scene: Scene, one: Run, other: Run, times: Sequence[float]) -> list[tuple[float, float, float]]:
    """Compare two runs that should agree up to rounding; return (time, difference, largest allowed).

    Impacts amplify rounding, without bound where orbits diverge or graze. The scene itself gives the amplification: it
    runs again from starts nudged by `NUDGE` (`NUDGE_POWER`). The two runs may differ by thirty times the change due to
    the nudges, since neither nudge may hit the direction that grows most.

    A plastic impact forgets the start, and the motion of a body thrown by its stop hardly depends on it. So runs that
    differ by more are also compared with runs at disturbed stops. These separate errors from grazes and from stops
    that are almost at one place.
    """
    nudge = NUDGE_POWER if any(stop.law in POWER for stop in scene.stops) else NUDGE
    twins = [follow(scene.nudged(size), times) for size in (nudge, -nudge)]
    found = _compared(scene, one, other, twins, nudge)
    if all(difference <= allowed for _, difference, allowed in found):
        return found
    n = len(scene.q)
    reached = np.max([np.abs(scene.q), *(np.abs(state[:n]) for state in one.states)], axis=0)
    twins += [follow(scene.disturbed(reached, first=first), times) for first in (0, 1)]
    return _compared(scene, one, other, twins, nudge)


def _compared(
    scene: Scene, one: Run, other: Run, twins: Sequence[Run], nudge: float
) -> list[tuple[float, float, float]]:
    natural = np.asarray(scene.modes.natural)
    weights = np.concatenate([natural, np.ones_like(natural)])  # scales displacements to velocities
    found = []
    for i in range(min(len(run.states) for run in (one, other, *twins))):
        size = max(scene.speed, *(float(np.abs(weights * run.states[i]).max()) for run in (one, other)))
        moved = max(float(np.abs(weights * (twin.states[i] - one.states[i])).max()) for twin in twins)
        difference = float(np.abs(weights * (other.states[i] - one.states[i])).max())
        found.append((one.times[i], difference, 30.0 * (moved + nudge * size)))
    return found
