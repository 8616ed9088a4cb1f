"""The FMU that keeps an unstable orbit by small changes of a forcing amplitude; pythonfmu runs it.

It must run wherever the FMU runs: it imports only the standard library and pythonfmu, nothing of vibroimpact.
"""

import json
import math
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# found in the FMU's resources, whether or not it is installed; its types are not published
from pythonfmu import (  # type: ignore[import-untyped, import-not-found, unused-ignore]  # has no types, and is not everywhere
    Boolean,
    Fmi2Causality,
    Fmi2Slave,
    Integer,
    Real,
)
from pythonfmu.enums import (  # type: ignore[import-untyped, import-not-found, unused-ignore]  # has no types, and is not everywhere
    Fmi2Initial,
    Fmi2Variability,
)

PLAN_FILE = "plan.json"
TURN = 2.0 * math.pi
#: Deviation of a flight's duration, or of an impact's phase, from the orbit's, beyond which the orbit is lost; periods.
LARGEST_DEVIATION = 0.25
#: Difference of two speeds below which they count as equal, in standard deviations of the noise.
NOISE_DEVIATIONS = 4.0


@dataclass(frozen=True)
class Decision:
    """An impact, and the decision taken at it.

    Attributes
    ----------
    time, phase, velocity : float
        Time, phase and measured speed of the impact: s, rad, m/s.
    row : int
        Row of the plan, from 0.
    flights : int
        Flights since this row began.
    correction : float
        Correction of the forcing amplitude, N.
    offset : tuple of float
        Difference of the located orbit from the plan's: s, m/s.
    kept : bool
        Whether the orbit is still kept.
    """

    time: float
    phase: float
    velocity: float
    row: int
    flights: int
    correction: float
    offset: tuple[float, float]
    kept: bool


class OrbitController(Fmi2Slave):  # type: ignore[misc, unused-ignore]  # has no types, and is not everywhere
    """Slave that answers the force of the next flight, as soon as the inputs report an impact."""

    description = "Keeps an unstable periodic orbit by the forcing amplitude while its frequency changes"

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        plan = json.loads(Path(self.resources, PLAN_FILE).read_text(encoding="utf-8"))
        self._rows: list[dict[str, Any]] = plan["rows"]
        self._locates = plan["law"] == "newton"
        self._periods: int = plan["periods"]
        self._amplitude: float = plan["amplitude"]
        self._stay: int = plan["stay"]
        self.tolerance: float = plan["tolerance"]
        self.limit: float = plan["limit"]
        self.noise, self.seed, self.active = 0.0, 1, True
        self._inputs = {"count": 0, "last_time": 0.0, "last_phase": 0.0, "last_velocity": 0.0}
        # by number of impact: a step that is repeated decides again
        self._decisions: dict[int, Decision] = {}
        self._register()

    def _register(self) -> None:
        inputs = {
            "count": (Integer, Fmi2Variability.discrete, "Number of impacts of the body"),
            "last_time": (Real, Fmi2Variability.continuous, "Time of the last impact"),
            "last_phase": (Real, Fmi2Variability.continuous, "Forcing phase of the last impact"),
            "last_velocity": (Real, Fmi2Variability.continuous, "Speed before the last impact"),
        }
        for name, (kind, variability, text) in inputs.items():
            self._register_input(name, kind, variability, text)
        outputs = {
            "forcing_amplitude": (Real, "Amplitude of the force until the next impact", self._force),
            "forcing_angular_frequency": (Real, "Angular frequency until the next impact", self._frequency),
            "correction": (Real, "Correction of the amplitude", lambda: self._decided().correction),
            "row": (Integer, "Present row of the plan, from 0", lambda: self._decided().row),
            "kept": (Boolean, "Whether the orbit is still kept", lambda: self._decided().kept),
        }
        for name, (kind, text, getter) in outputs.items():
            variability = Fmi2Variability.continuous if kind is Real else Fmi2Variability.discrete
            self.register_variable(
                kind(
                    name,
                    causality=Fmi2Causality.output,
                    variability=variability,
                    initial=Fmi2Initial.calculated,
                    description=text,
                    getter=getter,
                )
            )
        parameters = {
            "tolerance": (Real, "Difference of two successive speeds below which the next row begins"),
            "limit": (Real, "Largest correction of the amplitude"),
            "noise": (Real, "Relative standard deviation of the error of measured speeds"),
            "seed": (Integer, "Seed of the noise"),
            "active": (Boolean, "Whether the amplitude is corrected"),
        }
        for name, (kind, text) in parameters.items():
            self.register_variable(
                kind(
                    name,
                    causality=Fmi2Causality.parameter,
                    variability=Fmi2Variability.fixed,
                    description=text,
                )
            )

    def _register_input(self, name: str, kind: type, variability: Fmi2Variability, text: str) -> None:
        def take(value: float) -> None:
            self._inputs[name] = value

        variable = kind(
            name,
            causality=Fmi2Causality.input,
            variability=variability,
            description=text,
            getter=lambda: self._inputs[name],
            setter=take,
        )
        self.register_variable(variable)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Do nothing: all decisions are taken at impacts."""
        return True

    def _force(self) -> float:
        return self._amplitude + self._decided().correction

    def _frequency(self) -> float:
        return float(self._rows[self._decided().row]["angular_frequency"])

    def _decided(self) -> Decision:
        count = int(self._inputs["count"])
        time, phase = self._inputs["last_time"], self._inputs["last_phase"]
        if count <= 0:
            return Decision(math.nan, math.nan, math.nan, 0, 0, 0.0, (0.0, 0.0), True)
        known = self._decisions.get(count)
        if known is None or (known.time, known.phase) != (time, phase):
            known = self._decisions[count] = self._decide(count, time, phase)
            for old in [number for number in self._decisions if number < count - 2]:
                del self._decisions[old]
        return known

    def _measured(self, count: int) -> float:
        error = random.Random(f"{self.seed} {count}").gauss(0.0, 1.0) if self.noise > 0.0 else 0.0
        return self._inputs["last_velocity"] * (1.0 + self.noise * error)

    def _decide(self, count: int, time: float, phase: float) -> Decision:
        before = self._decisions.get(count - 1)
        velocity = self._measured(count)
        row, flights, kept, offset = 0, 0, True, (0.0, 0.0)
        if before is not None:
            row, flights, kept, offset = before.row, before.flights + 1, before.kept, before.offset
            kept = kept and self._is_orbit(before, time, phase)
            if self._locates:
                offset = self._located(before, phase, velocity)
            still = max(self.tolerance, NOISE_DEVIATIONS * self.noise * velocity)
            settled = flights >= self._stay and abs(velocity - before.velocity) < still
            if kept and settled and row + 1 < len(self._rows):
                row, flights = row + 1, 0
        away = self._away(row, phase, velocity)
        orbit = self._rows[row]
        correction = -(
            orbit["gain_time"] * (away[0] - offset[0]) + orbit["gain_velocity"] * (away[1] - offset[1])
        )
        if not (self.active and kept):
            correction = 0.0
        correction = max(-self.limit, min(self.limit, correction))
        return Decision(time, phase, velocity, row, flights, correction, offset, kept)

    def _away(self, row: int, phase: float, velocity: float) -> tuple[float, float]:
        """Return the difference of an impact from the plan's orbit: s, m/s."""
        orbit = self._rows[row]
        turned = math.remainder(phase - orbit["phase"], TURN)
        return turned / orbit["angular_frequency"], velocity - orbit["velocity"]

    def _is_orbit(self, before: Decision, time: float, phase: float) -> bool:
        orbit = self._rows[before.row]
        periods = (time - before.time) * orbit["angular_frequency"] / TURN
        turned = math.remainder(phase - orbit["phase"], TURN) / TURN
        return abs(periods - self._periods) < LARGEST_DEVIATION and abs(turned) < LARGEST_DEVIATION

    def _located(self, before: Decision, phase: float, velocity: float) -> tuple[float, float]:
        """Return the fixed point by one step of Newton's method, from the start and the end of the last flight.

        z = z* + J (z0 - z*) + b (F - F*)  solved for z*, all relative to the plan's orbit.
        """
        orbit = self._rows[before.row]
        (a, b), (c, d) = orbit["jacobian"]
        push = [before.correction * each for each in orbit["response"]]
        start = self._away(before.row, before.phase, before.velocity)
        end = self._away(before.row, phase, velocity)
        right = [
            end[0] - a * start[0] - b * start[1] - push[0],
            end[1] - c * start[0] - d * start[1] - push[1],
        ]
        determinant = (1.0 - a) * (1.0 - d) - b * c
        if determinant == 0.0:
            return before.offset
        return (
            ((1.0 - d) * right[0] + b * right[1]) / determinant,
            (c * right[0] + (1.0 - a) * right[1]) / determinant,
        )
