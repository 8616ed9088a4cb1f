"""The orbit that an operation begins with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.orbits.seeds import Seed, seed_of_run
from vibroimpact.orchestrator.scene import Scene


class OrbitStart(NamedTuple):
    """Scene and orbit to begin with; None for numbers that were not given."""

    scene: Scene
    impacts: int | None
    periods: int | None
    seed: Seed | None


class Beginning(Protocol):
    """Arguments that define the first orbit."""

    @property
    def impacts(self) -> int | None:
        """Number of impacts of the orbit."""

    @property
    def periods(self) -> int | None:
        """Number of its forcing periods."""

    @property
    def seed(self) -> str | None:
        """Phases and stops of impacts near the impacts of one orbit."""

    @property
    def from_dataset(self) -> Path | None:
        """Dataset with a run on the orbit."""

    @property
    def run(self) -> int | None:
        """Index of that run."""


def files_of(options: Beginning) -> list[Path]:
    """Return the files that define the orbit."""
    return [] if options.from_dataset is None else [options.from_dataset]


def refuse_contradictions(options: Beginning) -> None:
    """Raise UsageError for options that contradict each other or are incomplete."""
    if options.from_dataset is None:
        if options.run is not None:
            raise UsageError("--run: expected --from-dataset as well, got --run alone.")
        return
    if given := [
        f"--{name}" for name in ("impacts", "periods", "seed") if getattr(options, name) is not None
    ]:
        raise UsageError(f"--from-dataset: expected it without {', '.join(given)}, which the run says.")


def orbit_start(
    options: Beginning, scene: Scene, changes: Sequence[str], varied: Sequence[str] = ()
) -> OrbitStart:
    """Return the scene without its sweep, at the values of the dataset's run if one is given, and the seed.

    The scene has the changes already, each KEY=VALUE. The command varies the keys in `varied`, so values that the
    scene leaves to its sweep are not needed for them. UsageError: the seed is malformed, or a change contradicts the
    run. DatasetError: the run has no orbit.
    """
    if options.from_dataset is None:
        return OrbitStart(scene.unswept(varied), options.impacts, options.periods, _impacts_of(options.seed))
    with open_dataset(options.from_dataset) as runs:
        try:
            found = seed_of_run(runs, options.run)
        except (DatasetError, UsageError) as problem:
            raise problem.named(options.from_dataset) from problem
    if twice := sorted(found.values.keys() & {each.partition("=")[0].strip() for each in changes}):
        raise UsageError(f"--set {twice[0]}: expected another key than those the dataset sweeps, got one.")
    alone = scene.unswept([*varied, *found.values])
    return OrbitStart(alone.with_values(found.values), len(found.impacts), found.periods, found.impacts)


def _impacts_of(seed: str | None) -> Seed | None:
    if seed is None:
        return None
    found = []
    for each in seed.split(","):
        phase, _, stop = each.partition(":")
        try:
            found.append((float(phase), int(stop or "1")))
        except ValueError:
            raise UsageError(
                f"--seed: expected phases in rad, each with :STOP where it is not 1, got {seed!r}. "
                'For example "0.5:1,3.6:2".'
            ) from None
    return found
