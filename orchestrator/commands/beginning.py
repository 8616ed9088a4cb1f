"""Which orbit a command begins with: as options say it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.orbits.seeds import Seed, seed_of_run
from vibroimpact.orchestrator.scene import Scene


class Begun(NamedTuple):
    """Scene and orbit to begin with; numbers that were not given are None."""

    scene: Scene
    impacts: int | None
    periods: int | None
    seed: Seed | None


@dataclass(frozen=True, slots=True)
class Beginning:
    """Options that say which orbit is meant."""

    impacts: int | None = None
    periods: int | None = None
    seed: str | None = None
    dataset: Path | None = None
    run: int | None = None

    @property
    def is_seed(self) -> bool:
        """Whether it is one orbit, near to impacts that are given."""
        return self.seed is not None or self.dataset is not None

    @property
    def files(self) -> list[Path]:
        """That are read."""
        return [] if self.dataset is None else [self.dataset]

    def refuse(self) -> None:
        """Refuse options that say two things, or half of one.

        Raises
        ------
        UsageError
        """
        if self.dataset is None and self.run is not None:
            raise UsageError("--run: expected --from-dataset as well, got --run alone.")
        given = [
            name
            for name, value in (
                ("--impacts", self.impacts),
                ("--periods", self.periods),
                ("--seed", self.seed),
            )
            if value is not None
        ]
        if self.dataset is not None and given:
            raise UsageError(f"--from-dataset: expected it without {', '.join(given)}, which the run says.")

    def begun(self, scene: Scene, changes: Sequence[str], varied: Sequence[str] = ()) -> Begun:
        """Return the scene at the values of the run of the dataset, if there is one, and the seed.

        Parameters
        ----------
        scene : Scene
            Its sweep is left out.
        changes : sequence of str
            Which it was given, each KEY=VALUE.
        varied : sequence of str
            Keys that the command varies: values that the scene leaves to its sweep are not needed.

        Raises
        ------
        UsageError
            The seed is none, or a change is another than the run has.
        DatasetError
            The run has no orbit.
        """
        if self.dataset is None:
            return Begun(scene.unswept(varied), self.impacts, self.periods, self._impacts_of_seed())
        with open_dataset(self.dataset) as runs:
            try:
                found = seed_of_run(runs, self.run)
            except (DatasetError, UsageError) as problem:
                raise type(problem)(f"{self.dataset}: {problem}") from problem
        if twice := sorted(found.values.keys() & {each.partition("=")[0].strip() for each in changes}):
            raise UsageError(
                f"--set {twice[0]}: expected another key than those the dataset sweeps, got one."
            )
        alone = scene.unswept([*varied, *found.values])
        return Begun(alone.with_values(found.values), len(found.impacts), found.periods, found.impacts)

    def _impacts_of_seed(self) -> Seed | None:
        if self.seed is None:
            return None
        found = []
        for each in self.seed.split(","):
            phase, _, stop = each.partition(":")
            try:
                found.append((float(phase), int(stop or "1")))
            except ValueError:
                raise UsageError(
                    f"--seed: expected phases in rad, each with :STOP where it is not 1, got {self.seed!r}. "
                    'For example "0.5:1,3.6:2".'
                ) from None
        return found
