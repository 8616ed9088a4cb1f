"""The study `control`: an unstable orbit, kept by its forcing amplitude over angular frequencies.

Thesis 3.5.2. The components are coupled as in any scene: the body, the stop that answers its impacts, and a
controller. The controller answers each impact with the force of the next flight. No map is iterated here.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.outputs import refuse_folder
from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.packaging.python_fmus import require_pythonfmu
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.operations.control import Control
from vibroimpact.orchestrator.orbits.control_parts import SEEN, coupled, coupled_scene
from vibroimpact.orchestrator.orbits.control_plan import (
    LONGEST_STAY,
    ControlPlan,
    ControlSettings,
    control_plan,
    settings_of,
)
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.ssp import opened_scene

HISTORY = "periodic orbits kept by vibroimpact"
TABLE = ResultTable(
    "control",
    ("impact_time", "impact", "s", "time of the impact"),
    ("impact_phase", "impact", "rad", "forcing phase of the impact"),
    ("impact_velocity", "impact", "m s-1", "impact velocity"),
    ("forcing_amplitude", "impact", "N", "forcing amplitude of the flight before"),
    ("correction", "impact", "1", "correction of the forcing amplitude, relative"),
    ("angular_frequency", "impact", "rad s-1", "angular frequency of the flight before"),
    ("impact_orbit", "impact", "1", "number of the orbit that was kept then, from 0"),
    ("orbit_angular_frequency", "orbit", "rad s-1", "angular frequency of the orbit"),
    ("orbit_velocity", "orbit", "m s-1", "impact velocity of the orbit"),
    ("orbit_multiplier", "orbit", "1", "size of the largest multiplier"),
    ("orbit_impacts", "orbit", "1", "impacts at this orbit"),
)
AT_THE_END = 20
"""Impacts at the last angular frequency of a plan."""
CHUNK = 16
"""Forcing periods between two checks of the controller."""
_SHOWN = 8
"""Orbits in the printed table."""


@dataclass(eq=False)
class Controlled(Study[int]):
    """An orbit kept from one angular frequency to another; a row is the number of impacts so far.

    Parameters
    ----------
    plan : ControlPlan

    Attributes
    ----------
    impacts : list of tuple
        Time (s), phase (rad) and speed (m/s) of each impact. Then forcing amplitude (N), angular frequency (rad/s) and
        row of the plan for the flight that led to it.
    end : str
        Reason for the end.
    """

    name = "control"
    nothing = "an impact"
    begins = "Looking for the orbits"
    history = HISTORY
    interruption = "Interrupted: the above is what was kept so far."

    plan: ControlPlan
    impacts: list[tuple[float, ...]] = field(default_factory=list)
    end: str = "interrupted"

    @classmethod
    def prepare(cls, options: Control, stack: ExitStack) -> Self:
        """Open the scene, find the orbits, and write the controller to the folder `keep` if it is given."""
        settings, keep = _settings(options), options.keep
        require_pythonfmu()
        if keep is not None:
            refuse_folder(keep)
            if keep.exists():
                raise UsageError(f"{keep}: expected a new folder, got one that is there.")
        scene = opened_scene(options.scene, options.changes or ())
        with Terminal(stderr=True).status(cls.begins):
            study = cls(control_plan(scene, options.start, options.stop, settings))
        if keep is not None:
            _keep(study.plan, keep)
        return study

    def rows(self) -> Generator[int, None, None]:
        """Couple body, stop and controller, and run them through the plan.

        ComponentError: pythonfmu is not installed, or a component fails.
        """
        with tempfile.TemporaryDirectory() as folder:
            controller = self.plan.controller(Path(folder, "controller.fmu"))
            components, connections = coupled(self.plan, controller)
            importer = Importer(components, connections, macro_step=self.plan.orbits[0].body.period)
            try:
                for impacts in _run(importer, self):
                    self.status(f"Angular frequency {self.reached:.6g}, {counted(impacts, 'impact')}")
                    if impacts:
                        yield impacts
            finally:
                importer.free()

    def made(self) -> xr.Dataset:
        """Return impacts and orbits."""
        return _dataset(self)

    @property
    def reached(self) -> float:
        """Angular frequency of the last flight, rad/s."""
        at = self.impacts[-1][4] if self.impacts else self.plan.orbits[0].body.angular_frequency
        return float(at)

    @property
    def kept_to(self) -> float | None:
        """Angular frequency of the last orbit that was kept over two impacts or more, rad/s; None if there is none."""
        rows = [int(impact[5]) for impact in self.impacts]
        visits = Counter(rows)
        lost = self.end.startswith("lost")
        kept = [row for row in sorted(visits) if visits[row] >= 2 and not (lost and row == rows[-1])]
        return self.plan.orbits[kept[-1]].body.angular_frequency if kept else None

    def print_results(self) -> None:
        """Print some of the orbits, and the range over which they were kept."""
        _print(self)


def _run(importer: Importer, found: Controlled) -> Iterator[int]:
    plan = found.plan
    body, controller = importer.components["body"], importer.components["controller"]
    port = f"contact[{int(plan.orbits[0].contacts[0]) + 1}]"
    seen = body.group("Float64", [f"{port}.{name}" for name in SEEN[1:]])
    force = body.group("Float64", ["forcing.amplitude", "forcing.angular_frequency"])
    count = body.group("Int64", [f"{port}.{SEEN[0]}"])
    row = controller.group("Int64", ["row"])
    kept = controller.group("Boolean", ["kept"])
    stay = [0, -1]  # impacts at this row

    def note(_: object) -> None:
        # the controller has not seen this impact yet: force and row belong to the flight that led here
        if int(count.get()[0]) == len(found.impacts):
            return  # initialization ends in event mode, too
        seen.get()
        force.get()
        row.get()
        at = int(row.values[0])
        stay[:] = [stay[0] + 1 if at == stay[1] else 1, at]
        found.impacts.append((*map(float, seen.values), *map(float, force.values), float(at)))

    importer.on_event = note
    importer.begin(0.0)
    last = len(plan.orbits) - 1
    while True:
        before = len(found.impacts)
        longest = plan.orbits[stay[1] if stay[1] >= 0 else 0].body.period
        importer.advance(importer.time + CHUNK * plan.settings.periods * longest)
        kept.get()
        yield len(found.impacts)
        if not kept.values[0]:
            found.end = "lost: an impact came a quarter of a period off"
        elif len(found.impacts) == before:
            found.end = "lost: no impacts any more"
        elif stay[1] == last and stay[0] >= AT_THE_END:
            found.end = "kept to the end of the plan"
        elif stay[0] > LONGEST_STAY:
            found.end = f"not settled: {LONGEST_STAY} impacts at one angular frequency"
        else:
            continue
        return


def _dataset(found: Controlled) -> xr.Dataset:
    plan = found.plan
    table = np.array(found.impacts, dtype=np.float64).reshape(-1, 6)
    at = table[:, 5].astype(np.int64)
    visits = np.bincount(at, minlength=len(plan.orbits)) if at.size else np.zeros(len(plan.orbits), np.int64)
    values = {
        "impact_time": table[:, 0],
        "impact_phase": table[:, 1],
        "impact_velocity": table[:, 2],
        "forcing_amplitude": table[:, 3],
        "correction": table[:, 3] / plan.amplitude - 1.0,
        "angular_frequency": table[:, 4],
        "impact_orbit": at,
        "orbit_angular_frequency": [orbit.body.angular_frequency for orbit in plan.orbits],
        "orbit_velocity": [float(orbit.velocities[0]) for orbit in plan.orbits],
        "orbit_multiplier": [abs(orbit.multipliers[0]) for orbit in plan.orbits],
        "orbit_impacts": visits,
    }
    settings = {
        f"control_{f.name}": getattr(plan.settings, f.name) for f in dataclasses.fields(plan.settings)
    }
    ends = {} if plan.ends_at is None else {"branch_ends_at": plan.ends_at}
    attributes = (
        scene_attributes(plan.scene, HISTORY)
        | settings
        | ends
        | ({} if found.kept_to is None else {"kept_to": found.kept_to})
        | {
            "reached": found.reached,
            "end": found.end,
            "units_system": plan.scene.units,
            "amplitude": plan.amplitude,
        }
    )
    return TABLE.dataset(values, attributes, units=plan.scene.units)


def _settings(options: Control) -> ControlSettings:
    return settings_of(
        law=options.law,
        step=options.step,
        tolerance=options.tolerance,
        limit=options.limit,
        noise=options.noise,
        seed=options.seed,
        periods=options.periods,
        stay=options.stay,
    )


def _keep(plan: ControlPlan, folder: Path) -> None:
    folder.mkdir(parents=True)
    controller = plan.controller(folder / "controller.fmu")
    (folder / "scene.toml").write_text(coupled_scene(plan, controller.name), encoding="utf-8")
    say(f"Controller and scene written to {folder}.")


def _print(found: Controlled) -> None:
    plan, data = found.plan, found.dataset
    shown = table(
        f"P(1,{plan.settings.periods}) kept by {plan.settings.law}: {plan.scene.title or plan.scene.source}",
        *(">angular frequency", ">impact velocity", ">largest multiplier", ">impacts", ">largest correction"),
    )
    at, correction = data["impact_orbit"].values, np.abs(data["correction"].values)
    for place in np.unique(np.linspace(0, int(at.max()), _SHOWN).round().astype(int)):
        orbit, own = plan.orbits[place], at == place
        shown.add_row(
            f"{orbit.body.angular_frequency:.8g}",
            f"{float(orbit.velocities[0]):.8g}",
            f"{abs(orbit.multipliers[0]):.5g}",
            f"{int(own.sum())}",
            f"{100.0 * float(correction[own].max()):.2g} %" if own.any() else "",
        )
    wide_terminal().print(shown)
    unstable = int((data["orbit_multiplier"].values[: int(at.max()) + 1] >= 1.0).sum())
    say(
        f"{counted(len(found.impacts), 'impact')}, {counted(int(at.max()) + 1, 'orbit')}, {unstable} of them unstable; "
        f"largest correction {100.0 * float(correction.max()):.3g} %."
    )
    kept = "nowhere" if found.kept_to is None else f"to {found.kept_to:.8g}"
    say(f"Kept {kept}: {found.end}.")
    if plan.ends_at is not None:
        away = "" if found.kept_to is None else f", {abs(found.kept_to - plan.ends_at):.2g} away"
        say(f"There is no such orbit beyond {plan.ends_at:.10g}{away}.")
