"""Measure a sweep: one output drives, inputs follow it sample by sample, each step is kept once it is sure.

A step is sure once the output has gone on well past its end. An output that ran empty, or was stopped, thus never
leaves a step with another drive than planned.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from pathlib import Path

from vibroimpact.analysis.dataset.outputs import writing
from vibroimpact.analysis.files.folder_lock import locked_folder, make_folder
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.programs.sweep.analysis import (
    Converter,
    MeasuredStep,
    Scale,
    StepCollector,
    StepSamples,
    analysed,
)
from vibroimpact.hardware.programs.sweep.branch import refuse_other_branch
from vibroimpact.hardware.programs.sweep.calibrating import (
    calibration_text,
    calibrations_of,
    displacement_scale,
)
from vibroimpact.hardware.programs.sweep.dataset import DATASET, SweepRows, store, stored
from vibroimpact.hardware.programs.sweep.live import LiveFigure
from vibroimpact.hardware.programs.sweep.plan import planned
from vibroimpact.hardware.programs.sweep.settings import SweepSettings
from vibroimpact.hardware.rig.acquisition import Acquisition, Facts
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.opening import opened_rig
from vibroimpact.hardware.rig.output import Output, start_trigger
from vibroimpact.hardware.rig.stopping import stopped_by_signals
from vibroimpact.orchestrator.run.progress import Progress

_SETTLED_SECONDS = 1.0
"""Time, besides that of a fall from the highest voltage, after which a step is sure, s."""
_RATE_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class SweepReport:
    """Summary of a sweep command."""

    dataset: Path
    steps: int
    """Steps in the dataset."""
    before: int
    """Steps from before."""
    planned: int
    """Steps of the whole sweep."""
    stopped: bool
    """Whether it was stopped before its end."""


def measure(
    settings: SweepSettings, folder: Path, rig: str | None = None, progress: Progress | None = None
) -> SweepReport:
    """Measure a sweep into a folder, which is made if absent, or continue it.

    The rig is that of `--rig`, else of the file of the sweep, else the board of this machine. UsageError: the folder
    has other contents, there is no such rig, or it lacks a terminal; nothing was driven. RigError: the rig failed, or
    the motion is on another branch than before; finished steps are in the folder.
    """
    limits = Limits(settings.output.highest, settings.output.slew)
    calibrations = calibrations_of(settings)
    folder = folder.absolute()
    make_folder(folder)
    with locked_folder(folder, "sweep"):
        rows = stored(settings, calibration_text(calibrations), folder)
        before = len(rows.steps)
        stopped = False
        if not rows.complete:
            sweep = _Sweep(rows, folder, limits, displacement_scale(settings, calibrations), progress)
            stopped = sweep.run(rig or settings.rig)
        return SweepReport(folder / DATASET, len(rows.steps), before, len(settings.steps), stopped)


class _Sweep:
    """A running sweep."""

    def __init__(
        self, rows: SweepRows, folder: Path, limits: Limits, scale: Scale, progress: Progress | None
    ) -> None:
        self._rows, self._folder, self._scale = rows, folder, scale
        self._settings, self._limits = rows.settings, limits
        self._plan = planned(rows.settings, len(rows.steps))
        self._progress = progress or Progress()
        self._waiting: deque[tuple[int, MeasuredStep]] = deque()
        self._stopped_at: int | None = None
        self._live = LiveFigure(folder)
        self._converters: list[Converter] = []

    def run(self, choice: str | None) -> bool:
        """Measure to the end, or until a stop; return whether it was stopped."""
        settings, plan = self._settings, self._plan
        rate = settings.output.rate
        with opened_rig(choice) as rig:
            inputs = Acquisition(
                rig,
                settings.measured,
                rate,
                count=plan.samples,
                trigger=start_trigger(settings.output.terminal),
            )
            output = Output(rig, settings.output.terminal, rate, plan, self._limits, arm=inputs.start)

            def stop() -> None:
                # steps that have ended by now were driven as planned
                self._stopped_at = output.generated if self._stopped_at is None else self._stopped_at
                output.stop()
                inputs.stop()

            with inputs, output, stopped_by_signals(stop):
                self._take_note(inputs.facts, rig.name)
                output.start()
                if self._stopped_at is None:  # else output and inputs may not have started
                    self._note_start(inputs.facts)
                    self._progress.begin(len(settings.steps), len(self._rows.steps))
                    try:
                        self._follow(inputs, output)
                    finally:
                        self._live.close()
                output.wait()
            self._keep(plan.samples if self._stopped_at is None else self._stopped_at)
        if self._is_a_diagram:
            self._live.finish()
        return self._stopped_at is not None

    def _take_note(self, facts: Facts, rig: str) -> None:
        """Note the rig; refuse another rig than at the start, and a rate that it does not have."""
        rate = self._settings.output.rate
        if abs(facts.rate - rate) > _RATE_ROUNDING * rate:
            raise UsageError(
                f"{self._settings.source}: output.rate: expected a rate that the inputs of {facts.device} have, got "
                f"{rate!r}. Use {facts.rate!r}."
            )
        made_by = {"rig": rig, "device": f"{facts.device}, {facts.product}"}
        for name, value in made_by.items():
            was = self._rows.made_by.get(name, value)
            if was != value:
                raise UsageError(
                    f"{self._folder}: expected the {name} that began this sweep, {was}, got {value}. "
                    "Choose another folder, or go on with what it was begun with."
                )
        self._rows.made_by |= made_by
        self._converters = [Converter(*step) for step in facts.steps]

    def _note_start(self, facts: Facts) -> None:
        earlier = self._rows.made_by.get("measured_at", "")
        self._rows.made_by["measured_at"] = "\n".join(filter(None, (earlier, facts.started_at)))
        self._rows.session_starts.append(len(self._rows.steps))

    def _follow(self, inputs: Acquisition, output: Output) -> None:
        """Take the samples of the inputs, and keep the sure steps."""
        collector = StepCollector(self._plan, len(self._settings.inputs))
        fall = self._limits.fall(self._limits.amplitude, self._settings.output.rate)
        margin = fall.samples + round(_SETTLED_SECONDS * self._settings.output.rate)
        for block in inputs.blocks():
            for step in collector.take(block.first, block.volts):
                self._analyse(step)
            if self._stopped_at is None:
                self._keep(output.generated - margin)
            if output.poll(0.0):
                output.wait()  # raises the reason of an early end

    def _analyse(self, step: StepSamples) -> None:
        found = analysed(step, self._settings, self._scale, self._converters)
        if step.segment.kind == "repeat":
            refuse_other_branch(self._rows.steps[-1], found, self._settings, self._folder)
        else:
            self._waiting.append((step.segment.stop, found))

    def _keep(self, settled: int) -> None:
        """Store the steps that have ended before a sample."""
        while self._waiting and self._waiting[0][0] <= settled:
            _, step = self._waiting.popleft()
            self._rows.steps.append(step)
            with writing(self._folder / DATASET):
                store(self._rows, self._folder)
            self._progress.advance(1)
            if step.flags:
                direction, frequency = self._settings.steps[step.place]
                self._progress.note(f"{direction.name} {frequency:g} Hz: {step.message}")
            if self._is_a_diagram:
                self._live.follow()

    @property
    def _is_a_diagram(self) -> bool:
        """Whether more than one frequency is measured."""
        done = self._settings.steps[: len(self._rows.steps)]
        return len({frequency for _, frequency in done}) > 1
