"""Bodies in model exchange that meet stops: parts of coupled scenes, and their impacts in 40 digits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mpmath

from support import fmu_factory
from support.coupled_parts import values
from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, StopContactSpec

GRAVITY = 9.81
KINDS = (
    *("spring", "ball", "stairs", "stepped", "ends_at_event", "ends_at_step", "short_rates", "short_states"),
    *(
        "nan_rates",
        "short_indicators",
        "rescaled",
        "endless",
        "rates_fail",
        "rates_end",
        "stuck",
        "rates_fatal",
    ),
    *("falling", "pendulum", "weak", "last_fall", "clocked", "cam"),
)
"""The kinds of `fmus/exchanged.h`."""
ALONG, TIP = ("x", "v"), ("tip", "tip_rate")
"""Displacement and velocity of a contact point: of the state x, and of the tip of a pendulum."""
Impact = tuple[float, float]
"""Time (s) and closing speed (m/s)."""


def exchanged(
    folder: Path, fmi: str, kind: str, tolerance: float = 1e-10, *, states: bool = True, **start: float
) -> ComponentSpec:
    """Return the body `m` of a kind; without `states` its FMU cannot save its state."""
    fmu = fmu_factory.exchanged(folder, fmi)
    if not states:
        word = "state" if fmi == "2.0" else "State"
        without = folder / f"stateless{fmi[0]}.fmu"
        fmu = fmu_factory.redescribed(fmu, without, (f' canGetAndSetFMU{word}="true"', ""))
    return ComponentSpec("m", fmu, {"kind": float(KINDS.index(kind)), **start}, tolerance)


def rigid_stop(
    restitution: float, position: float = 0.0, side: str = "lower", name: str = "s", **more: Value
) -> ComponentSpec:
    given = {"restitution": restitution, "position": position, "side": side, **more}
    return ComponentSpec(name, fmu_path("ImpactStop", "3.0"), given)


def contact(
    force: str | None = "u", point: tuple[str, str] = ALONG, stop: str = "s", mass: float | None = None
) -> StopContactSpec:
    return StopContactSpec("m", *point, force, stop, mass)


@dataclass
class ContactRun:
    """A run whose velocities are noted before and after each event; `look` reads them."""

    importer: Importer
    look: Callable[[], list[float]]
    before: list[list[float]] = field(default_factory=list)
    after: list[list[float]] = field(default_factory=list)
    times: list[float] = field(default_factory=list)

    def at(self, time: float) -> ContactRun:
        self.importer.advance(time)
        return self

    @property
    def impacts(self) -> list[Impact]:
        """Return the impacts at the first stop."""
        return [(impact.time, impact.closing) for impact in self.importer.contacts.held[0].impacts.all]

    def motion(self, *names: str) -> list[float]:
        return values(self.importer, "m", *(names or ALONG))


def run_of(
    parts: list[ComponentSpec],
    contacts: list[StopContactSpec],
    *seen: tuple[str, str],
    macro_step: float = 0.1,
    **options: Any,
) -> ContactRun:
    """Return bodies among stops, initialized; `seen` are the noted variables."""
    importer = Importer(parts, contacts=contacts, macro_step=macro_step, **options)
    run = ContactRun(importer, lambda: [values(importer, *one)[0] for one in seen])
    latest: list[list[float]] = [[]]

    def note(time: float, end: float) -> None:
        latest[0] = run.look()

    def event(happened: Any) -> None:
        run.times.append(happened.time)
        run.before.append(latest[0])
        run.after.append(run.look())

    importer.watchers.append(StepWatcher(lambda time: None, note))
    importer.on_event = event
    importer.begin()
    return run


def ball_impacts(count: int, restitution: float, height: float = 1.0) -> list[Impact]:
    """Return the bounces of a ball dropped on the ground, by the closed form in 40 digits."""
    with mpmath.workdps(40):
        g, r = mpmath.mpf(GRAVITY), mpmath.mpf(restitution)
        speed = mpmath.sqrt(2 * g * mpmath.mpf(height))
        found = [(speed / g, speed)]
        while len(found) < count:
            time, speed = found[-1]
            found.append((time + 2 * r * speed / g, r * speed))
        return [(float(time), float(speed)) for time, speed in found]


def pendulum_impacts(count: int, restitution: float, start: float, position: float) -> list[Impact]:
    """Return the impacts of a pendulum of 1 m that starts at rest, at the angle `start` < 0, by elliptic integrals.

    Its tip meets an upper stop at `position`, m. The closing speed is that of the tip along its displacement, in 40
    digits.
    """
    with mpmath.workdps(40):
        g, r, stop = mpmath.mpf(GRAVITY), mpmath.mpf(restitution), mpmath.asin(mpmath.mpf(position))

        def swing(energy: Any) -> tuple[Any, Any]:
            """Return the time from the bottom to the stop, and to the turn."""
            squared = (energy + g) / (2 * g)
            angle = mpmath.asin(mpmath.sin(stop / 2) / mpmath.sqrt(squared))
            return mpmath.ellipf(angle, squared) / mpmath.sqrt(g), mpmath.ellipk(squared) / mpmath.sqrt(g)

        energy = -g * mpmath.cos(mpmath.mpf(start))
        rate, time = mpmath.sqrt(2 * (energy + g * mpmath.cos(stop))), sum(swing(energy))
        found = [(time, rate)]
        while len(found) < count:
            rate = r * rate
            time += 2 * sum(swing(rate**2 / 2 - g * mpmath.cos(stop)))
            found.append((time, rate))
        return [(float(time), float(rate * mpmath.cos(stop))) for time, rate in found]


def largest_errors(found: list[Impact], exact: list[Impact]) -> tuple[float, float]:
    """Return the largest errors of the instants, s, and of the speeds, m/s."""
    assert len(found) == len(exact)
    times = max(abs(a[0] - b[0]) for a, b in zip(found, exact, strict=True))
    speeds = max(abs(a[1] - b[1]) for a, b in zip(found, exact, strict=True))
    return times, speeds
