"""The command `vibroimpact replay`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.dataset.outputs import refuse_folder, refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.replay.table import print_comparison
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.printing import table, value_and_error
from vibroimpact.fmus.terminal import Terminal
from vibroimpact.orchestrator.campaign.manifest import holds_scene
from vibroimpact.orchestrator.operations.replay import Replay
from vibroimpact.orchestrator.replay import ReplayFit
from vibroimpact.orchestrator.replay.output import fitted_scene_text
from vibroimpact.orchestrator.replay.replaying import WholeReplay, replay_scene, with_recordings
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene


def replay_recordings(options: Replay) -> None:
    """Replay recordings into a dataset, with scores and fits, or into the folder of a campaign."""
    loaded, output = load_scene(options.scene), options.output
    recordings = options.recordings or ()
    if output is None:
        raise UsageError(
            "--output: expected a dataset (.nc) or the folder of a campaign, got nothing. Add -o."
        )
    if output.suffix != ".nc":
        if output.name.lower().endswith(".nc"):
            raise UsageError(
                f"{output}: expected a dataset NAME.nc or the folder of a campaign, got neither. Choose another name."
            )
        refuse_folder(output)
        _refuse_with_campaign(options)
        _campaign(with_recordings(loaded, recordings), output, options.workers, options.scheduler)
        return
    read = [options.scene, *loaded.files, *recordings, *(options.score or ())]
    refuse_outputs(read, output, options.figure)
    named = with_recordings(loaded, recordings)
    refuse_overwriting(output, options.force, lambda there: holds_scene(there, named))
    if options.save_scene is not None:
        refuse_outputs(read, options.save_scene, ending=".toml")
        _refuse_saving(options.save_scene, options.fit, options.force)
    if options.workers is not None or options.scheduler is not None:
        raise UsageError("--workers, --scheduler: expected the folder of a campaign as output, got a file.")
    if options.figure is not None and loaded.replay is not None and not loaded.replay.compare:
        raise UsageError(
            f"--figure: expected a scene that compares something, got {options.scene} without. Add compare."
        )
    _to_dataset(loaded, options, output)


def _refuse_with_campaign(options: Replay) -> None:
    others = (options.fit, options.score or None, options.save_scene, options.figure, options.execution)
    if any(other is not None for other in others):
        raise UsageError(
            "--output: expected a dataset (.nc) beside --fit, --score, --save-scene, --figure or --execution, "
            "got a folder. Campaigns replay; they do not fit."
        )


def _refuse_saving(path: Path, fit: str | None, force: bool) -> None:
    if fit is None:
        raise UsageError(
            "--save-scene: expected --fit beside it, got nothing to save. Name numbers to be found."
        )
    if path.exists() and not force:
        raise UsageError(
            f"{path}: expected a new file, got one that is there. Choose another name, or overwrite it with --force."
        )


def _campaign(scene: Scene, folder: Path, workers: int | None, scheduler: str | None) -> None:
    # Dask takes a tenth of a second to load, and a replay into a dataset does not need it
    from vibroimpact.orchestrator.campaign.workers.processors import refuse_two_kinds_of_workers
    from vibroimpact.orchestrator.commands.campaign import compute

    refuse_two_kinds_of_workers(workers, scheduler)
    compute(scene, folder, workers, scheduler)


def _to_dataset(scene: Scene, options: Replay, output: Path) -> None:
    began = time.perf_counter()
    with _fitting(options.fit) as progress:
        whole = replay_scene(
            scene,
            options.recordings or (),
            fit=options.fit,
            score=options.score or (),
            execution=options.execution,
            progress=progress,
        )
    console = Terminal()
    print_replays(console, whole)
    _write(whole.dataset, output, options.figure)
    if options.save_scene is not None and whole.fit is not None:
        fitted = [replay.name for replay in whole.replays if replay.use == "fitted"]
        _save_scene(scene, whole.fit, fitted, options.save_scene)
        console.print(f"Scene with the numbers found written to {options.save_scene}.", soft_wrap=True)
    console.print(f"{output} in {time.perf_counter() - began:.1f} s", soft_wrap=True)


@contextmanager
def _fitting(fit: str | None) -> Iterator[Callable[[int, float], None]]:
    """Show a line with the progress of a fit."""
    if fit is None:
        yield lambda count, error: None
        return
    with Terminal(stderr=True).status("fitting") as status:
        yield lambda count, error: status.update(f"fitting: {count} simulations, error {100 * error:.3g} %")


def print_replays(console: Terminal, whole: WholeReplay) -> None:
    """Print the results of replays: the verdict, the fitted numbers, the scores of each recording."""
    if whole.verdict is not None:
        console.print(whole.verdict.words, soft_wrap=True, style="bold")
        for reason in whole.verdict.beside:
            console.print(f"  also: {reason}", soft_wrap=True)
    if (fit := whole.fit) is not None:
        rows = table("Fit", "<number", ">found", ">standard error", ">began with")
        for key, value, error, start in zip(fit.keys, fit.values, fit.standard_error, fit.start, strict=True):
            rows.add_row(key, *value_and_error(value, error), f"{start:.6g}")
        console.print(rows)
        for line in fit.remarks:
            console.print(f"  {line}", soft_wrap=True)
    for replay in whole.replays:
        console.print(f"{replay.name} ({replay.use})", style="bold")
        for line in (*replay.replayer.remarks, *replay.motion.warnings):
            console.print(f"  {line}", soft_wrap=True)
        if replay.comparisons:
            print_comparison(console, replay.comparisons)


def _save_scene(scene: Scene, fit: ReplayFit, recordings: Sequence[str], path: Path) -> None:
    text = fitted_scene_text(scene, fit, recordings, path.parent)
    parse_scene(text, str(path))  # a fitted number may break a rule between two keys
    with writing(path):
        write_atomically(path, text.encode())


def _write(dataset: xr.Dataset, output: Path, figure: Path | None) -> None:
    try:
        write_results(dataset, output)
        if figure is not None:
            # matplotlib takes half a second to import, and a replay without a figure does not need it
            from vibroimpact.analysis import figures
            from vibroimpact.analysis.figures.measured.replay import draw_replay

            figures.save(draw_replay(dataset), figure)
    except OSError as error:
        raise UsageError(
            f"{error.filename or output}: expected a place where a file can be written, got "
            f"{error.strerror or error}. Choose another."
        ) from error
