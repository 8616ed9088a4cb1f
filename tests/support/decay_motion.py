"""Free decays by scipy's integrator, stopped at every turning point: the reference of the decay tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Damped:
    """`x'' + omega^2 x (1 + cubic x^2) = -2 viscous x' - coulomb sign(x') - quadratic x' |x'|`."""

    omega: float = 4.0
    viscous: float = 0.0
    coulomb: float = 0.0
    quadratic: float = 0.0
    cubic: float = 0.0

    def slope(self, state: Floats, way: float) -> list[float]:
        """Return velocity and acceleration while the body moves in the direction `way` (+1 or -1)."""
        place, speed = state
        spring = -(self.omega**2) * place * (1.0 + self.cubic * place**2)
        loss = 2.0 * self.viscous * speed + way * (self.coulomb + self.quadratic * speed**2)
        return [speed, spring - loss]

    def motion(self, start: float, time: Floats) -> Floats:
        """Return the displacement after a release from rest at time 0, with an error of 1e-10 of the start."""
        place, clock, moved = start, 0.0, np.empty(len(time))
        while True:
            holding = abs(self.slope(np.array([place, 0.0]), 0.0)[1]) <= self.coulomb
            if holding:
                moved[time >= clock] = place
                return moved
            way = -np.sign(place)

            def turned(_: float, state: Floats) -> float:
                return float(state[1])

            turned.terminal, turned.direction = True, -way  # type: ignore[attr-defined]
            swing = solve_ivp(
                lambda _, state, way=way: self.slope(state, way),
                (clock, clock + 20.0 / self.omega),
                [place, way * 1e-14],
                method="DOP853",
                events=turned,
                rtol=1e-11,
                atol=1e-12 * start,
                dense_output=True,
            )
            inside = (time >= clock) & (time <= swing.t[-1])
            moved[inside] = swing.sol(time[inside])[0]
            clock, place = float(swing.t[-1]), float(swing.y[0, -1])
            if clock >= time[-1]:
                return moved
