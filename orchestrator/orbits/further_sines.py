"""Sines without a common period with the clock: their phases are variables of the states of a strobe section."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import ImpactingBody
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.bodies import YIELDING, impacting_body
from vibroimpact.orchestrator.run.limits import Seen, refuse_orbits, seen
from vibroimpact.orchestrator.run.parameters import body_points, float_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_clock import sines_of, sines_of_stops

Floats = NDArray[np.float64]
TURN = 2.0 * np.pi
WHOLE = 1e-12
"""Relative error of a ratio of frequencies up to which it is a whole number."""


@dataclass(frozen=True, eq=False)
class FurtherSines:
    """The sines of a scene that do not turn a whole number of times in a forcing period.

    Attributes
    ----------
    names, keys : tuple of str
        Variables of the phases in the FMU, and keys of the phases in the scene.
    rates : array, shape (sine,)
        Angular frequencies, rad/s.
    start : array, shape (sine,)
        Phases at time 0, rad.
    loads : array, shape (sine, mode)
        Modal amplitudes of the forces, N kg^(-1/2).
    period, lead : float
        Forcing period; time from time 0 to the first forcing phase 0, s.
    """

    names: tuple[str, ...]
    keys: tuple[str, ...]
    rates: Floats
    start: Floats
    loads: Floats
    period: float
    lead: float

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """Return the further sines of a scene; none where all sines have a common period."""
        if scene.clock is None or scene.clock.is_common:
            none = np.empty(0)
            return cls((), (), none, none, none[:, None], 0.0, 0.0)
        floats, clock = float_parameters(scene, None), scene.clock
        numbers = [number for number, force in enumerate(scene.forces, start=1) if force in sines_of([force])]
        modes = sum(name.startswith("mode.forcing[") for name in floats)
        rows = []
        for place, number in enumerate(numbers[1:], start=1):
            amplitude, rate, phase = (
                floats[f"sine[{place}].{name}"] for name in ("amplitude", "angular_frequency", "phase")
            )
            turns = rate / clock.angular_frequency
            if amplitude != 0.0 and abs(turns - round(turns)) > WHOLE * turns:
                load = [floats.get(f"mode.sine[{place},{mode}]", 0.0) for mode in range(1, modes + 1)]
                key = f"forcing[{number}].phase"
                rows.append((f"sine[{place}].phase", key, rate, phase, amplitude * np.array(load)))
        names, keys, rates, start, loads = zip(*rows, strict=True) if rows else ((), (), (), (), ())
        lead = -clock.phase % TURN / clock.angular_frequency
        table = np.array(loads).reshape(-1, modes)
        return cls(names, keys, np.array(rates), np.array(start), table, clock.period, lead)

    @property
    def turns(self) -> Floats:
        """Turns of the sines in a forcing period, shape (sine,)."""
        return self.rates * self.period / TURN

    def __len__(self) -> int:
        return len(self.names)

    def after(self, phases: Floats, periods: int, *, first: bool) -> Floats:
        """Return the phases some forcing periods later, from phases of shape (state, sine); see `Flow.follow`."""
        turned = self.rates * self.period % TURN * periods + (self.rates * self.lead if first else 0.0)
        return np.asarray(np.mod(phases + turned, TURN))

    def phases_of_scene(self, phases: Floats, turned: float) -> dict[str, float]:
        """Return the keys of the scene with which the sines have given phases; they are turned back by a time, s."""
        values = phases + self.rates * turned
        return dict(zip(self.keys, values.tolist(), strict=True))


def strobed_body(scene: Scene) -> ImpactingBody:
    """Return the body of a scene under the sines that turn a whole number of times in a forcing period.

    `impacting_body` refuses scenes with other sines. Their states at forcing phase 0 also have phases of these sines.

    Raises
    ------
    UsageError
        The scene has no orbits for another reason than its frequencies, or a stop moves with another frequency.
    """
    if scene.clock is None or scene.clock.is_common:
        return impacting_body(scene, yielding=True)
    found: list[Seen] = [each for each in seen(scene) if each.row not in {"quasi-periodic", *YIELDING}]
    refuse_orbits(scene, found)
    if sines_of_stops(scene.stops):
        raise UsageError(
            f"{scene.source}: stop: expected stops that stand still under sines without a common period, "
            "got one that moves."
        )
    floats = float_parameters(scene, None)
    silent = {name.replace("phase", "amplitude"): 0.0 for name in FurtherSines.of(scene).names}
    return body_points(scene, floats | silent).mass_normalised()
