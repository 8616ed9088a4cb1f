"""The study `effects`: the effects of a scene, the cost of each, and the effects that are not simulated."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.outputs import refuse_outputs
from vibroimpact.analysis.dataset.schema import UnitSystem, unit_in
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.messages import duration
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.fmus.units import written_unit
from vibroimpact.orchestrator.operations.effects import Effects
from vibroimpact.orchestrator.run.summary import engine
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.study.effects import (
    Share,
    dataset_of_shares,
    dearest_first,
    effects_of,
    not_called,
    shares_of,
)
from vibroimpact.orchestrator.study.motion import (
    QUANTITIES,
    Motion,
    change_in_words,
    changes_of_motion,
    motions_in_words,
    sampling_of_change,
)
from vibroimpact.orchestrator.study.preparing import with_modes


@dataclass(eq=False)
class CostOfEffects(Study[Share]):
    """The cost and the changes of the effects of a scene; a row is an effect.

    Parameters
    ----------
    scene : Scene
        Has a known number of modes. The study leaves out its sweep.
    """

    name = "effects"
    nothing = "an effect"

    scene: Scene

    @classmethod
    def prepare(cls, options: Effects, stack: ExitStack) -> Self:
        """Open the scene, and print its way of running."""
        opened = opened_scene(options.scene, options.changes or ())
        refuse_outputs(opened.files, options.output, options.figure)
        study = cls(with_modes(opened))
        say(engine(study.scene.unswept()))
        return study

    def rows(self) -> Generator[Share, None, None]:
        """Run the scene with and without effect after effect."""
        alone = self.scene.unswept()
        yield from shares_of(alone, effects_of(alone))

    @property
    def shares(self) -> list[Share]:
        """The effects, the most expensive first."""
        return sorted(self.found, key=dearest_first)

    def made(self) -> xr.Dataset:
        """Return the dataset of the effects, with their cost and their changes."""
        return dataset_of_shares(self.scene.unswept(), self.shares, self.scene.found)

    def print_results(self) -> None:
        """Print the effects, and the effects that are not simulated."""
        rows = table(
            f"What effects cost: {self.scene.title or self.scene.source}",
            *("<effect", "<asked for by", ">of the time", ">spread", "<without it"),
        )
        for share in self.shares:
            rows.add_row(share.effect.name, share.effect.asked_by, *_time_cells(share), share.changes)
        wide_terminal().print(rows)
        _print_motions(self.shares, self.scene.units)
        if self.found:
            full = float(np.nanmedian([share.full for share in self.found]))
            say(f"A run takes {duration(full)}; shares overlap.")
        say(f"Absent from the scene, and not simulated: {', '.join(not_called(self.scene)) or 'nothing'}.")


def _print_motions(shares: Sequence[Share], system: UnitSystem) -> None:
    """Print means over the motions whose impacts cannot be compared one by one."""
    compared = [(share, share.motions) for share in shares if share.motions is not None]
    if compared:
        names = [
            f"{name.replace('_', ' ')} ({written_unit(unit_in(system, unit))})"
            for name, unit in QUANTITIES.items()
        ]
        rows = table(
            "Where impacts are lost or a motion is chaotic: means over the recording",
            *("<without", ">impacts", *(f">{name}" for name in names), "<motion"),
        )
        scene = compared[0][1][0]
        rows.add_row("-", *_as_a_whole(scene))
        for share, (full, without) in compared:
            rows.add_row(share.effect.asked_by, *_as_a_whole(without, full))
        wide_terminal().print(rows)
    for share in shares:
        if share.statistics is not None:
            say(f"Without {share.effect.name}: {motions_in_words(None, share.statistics)}.")


def _as_a_whole(motion: Motion, full: Motion | None = None) -> tuple[str, ...]:
    """Return the cells of a motion, with its changes from the motion with all effects."""
    changes = {} if full is None else changes_of_motion(full, motion)
    chance = {} if full is None else sampling_of_change(full, motion)
    cells = []
    for name, value in motion.of.items():
        cell = "-" if np.isnan(value) else f"{value:.4g}"
        if not np.isnan(changes.get(name, np.nan)):
            words = change_in_words(changes[name], chance[name])
            cell += ", " + words.replace(" (", "\n(")  # long lines would leave no width to the names
        cells.append(cell)
    return str(motion.impacts), *cells, motion.orbit or "-"


def _time_cells(share: Share) -> tuple[str, str]:
    if np.isnan(share.seconds).all():
        return "-", "-"
    parts = 100.0 * share.seconds / share.full
    return f"{100.0 * share.share:.0f} %", f"{parts.min():.0f} to {parts.max():.0f} %"
