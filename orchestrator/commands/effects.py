"""What `vibroimpact effects` does: it says what a scene asks for, what that costs, and what is not simulated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vibroimpact.analysis.commands.found import refuse_places, write_found
from vibroimpact.analysis.dataset.schema import UnitSystem, unit_in
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.fmus.units import written_unit
from vibroimpact.orchestrator.commands.check import duration
from vibroimpact.orchestrator.commands.preparing import with_modes
from vibroimpact.orchestrator.operations.effects import Effects
from vibroimpact.orchestrator.run.summary import engine
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.study.effects import Share, dataset_of_shares, effects_of, not_called, shares_of
from vibroimpact.orchestrator.study.motion import (
    QUANTITIES,
    Motion,
    change_in_words,
    changes_of_motion,
    motions_in_words,
    sampling_of_change,
)


def show_effects(options: Effects) -> None:
    """Measure the effects of a scene, print them, and write what was asked for."""
    path = options.scene
    opened = opened_scene(path, options.changes or ())
    refuse_places(options, [path, *opened.files], results_kind="effects", scene_file=str(path))
    scene = with_modes(opened)
    alone = scene.unswept()
    say(f"{engine(alone)}")
    shares = shares_of(alone, effects_of(alone))
    rows = table(
        f"What effects cost: {scene.title or scene.source}",
        *("<effect", "<asked for by", ">of the time", ">spread", "<without it"),
    )
    for share in shares:
        rows.add_row(share.effect.name, share.effect.asked_by, *_told(share), share.changes)
    wide_terminal().print(rows)
    _print_motions(shares, scene.units)
    if shares:
        say(f"A run takes {duration(float(np.nanmedian([share.full for share in shares])))}; shares overlap.")
    say(f"Not asked for, and not simulated: {', '.join(not_called(scene)) or 'nothing'}.")
    dataset = dataset_of_shares(alone, shares, {**scene.found, "scene_file": str(path)})
    write_found(dataset, "effects", options)


def _print_motions(shares: Sequence[Share], system: UnitSystem) -> None:
    """Print what motions are as a whole where impacts cannot be compared one by one."""
    told = [(share, share.motions) for share in shares if share.motions is not None]
    if told:
        names = [
            f"{name.replace('_', ' ')} ({written_unit(unit_in(system, unit))})"
            for name, unit in QUANTITIES.items()
        ]
        rows = table(
            "Where impacts are lost or a motion is chaotic: means over the recording",
            *("<without", ">impacts", *(f">{name}" for name in names), "<motion"),
        )
        scene = told[0][1][0]
        rows.add_row("-", *_as_a_whole(scene))
        for share, (full, without) in told:
            rows.add_row(share.effect.asked_by, *_as_a_whole(without, full))
        wide_terminal().print(rows)
    for share in shares:
        if share.statistics is not None:
            say(f"Without {share.effect.name}: {motions_in_words(None, share.statistics)}.")


def _as_a_whole(motion: Motion, full: Motion | None = None) -> tuple[str, ...]:
    """Return the cells of a motion, with its changes from the one with all effects."""
    changes = {} if full is None else changes_of_motion(full, motion)
    chance = {} if full is None else sampling_of_change(full, motion)
    cells = []
    for name, value in motion.of.items():
        cell = "-" if np.isnan(value) else f"{value:.4g}"
        if not np.isnan(changes.get(name, np.nan)):
            cell += f", {change_in_words(changes[name], chance[name])}"
        cells.append(cell)
    return str(motion.impacts), *cells, motion.orbit or "-"


def _told(share: Share) -> tuple[str, str]:
    if np.isnan(share.seconds).all():
        return "-", "-"
    parts = 100.0 * share.seconds / share.full
    return f"{100.0 * share.share:.0f} %", f"{parts.min():.0f} to {parts.max():.0f} %"
