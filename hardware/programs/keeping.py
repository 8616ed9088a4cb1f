"""Measure to the end, keep the selected samples in a journal or in memory, and make the recording."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from vibroimpact.analysis.dataset.outputs import writing
from vibroimpact.analysis.recording import Recording, write_recording
from vibroimpact.analysis.recording.table import print_recording
from vibroimpact.fmus.errors import DatasetError, RigError
from vibroimpact.fmus.terminal import note, say, wide_terminal
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.programs.pulses import PulseFinder, with_pulses
from vibroimpact.hardware.rig.acquisition import QUEUE_BLOCKS, Acquisition, Block, Gap
from vibroimpact.hardware.rig.journal import (
    LAST_SAMPLE,
    SLOW_DISK,
    SYNC_SECONDS,
    Journal,
    JournalContent,
    read_journal,
)
from vibroimpact.hardware.rig.live import Progress
from vibroimpact.hardware.rig.measurement import measurement_in, recording_of
from vibroimpact.hardware.rig.opening import refusal_of

NO_END = "the program died: what its journal has is here"
LONG_PULSE = 1.0
"""Duration of a pulse, s, above which the threshold is doubted."""
ABOVE_REST = "the level of rest may lie beyond the lower threshold"
_GAP, _COUNT = TypeAdapter(Gap), TypeAdapter(int)


class Store:
    """The store of samples: a journal or memory; memory also takes the samples that a failed journal does not.

    `failure` is the reason for which the journal takes no more (else empty), `kept` the number of samples of each
    input.
    """

    def __init__(self, header: Mapping[str, Any], journal: Journal | None) -> None:
        self._journal = journal
        self._rest = JournalContent(dict(header))
        self.failure, self.kept = "", 0

    @property
    def journal(self) -> Journal | None:
        """The journal, while it works."""
        return None if self.failure else self._journal

    def append(self, block: Block) -> None:
        """Keep samples."""
        self.kept += block.volts.shape[1]
        if self.journal is not None:
            try:
                return self.journal.append(block)
            except OSError as error:
                self.failure = error.strerror or str(error)
        self._rest.blocks.append(block)

    def note(self, **values: Any) -> None:
        """Keep facts on the measurement."""
        if self.journal is not None:
            try:
                return self.journal.note(**values)
            except OSError as error:
                self.failure = error.strerror or str(error)
        self._rest.notes.append(values)

    def content(self) -> JournalContent:
        """Return all kept samples and notes."""
        if self._journal is None:
            return self._rest
        there = read_journal(self._journal.path, ended=False)
        return JournalContent(
            there.header, there.blocks + self._rest.blocks, there.notes + self._rest.notes, there.lost_bytes
        )


def keep_all(
    acquired: Acquisition, store: Store, progress: Progress, finder: PulseFinder | None, most: int | None
) -> Exception | None:
    """Keep the samples of an acquisition, not started yet, until it ends; return its error.

    `finder` selects the samples (None: all); the acquisition ends after `most` samples of each input.
    """
    acquired.start()
    store.note(started_at=acquired.facts.started_at)
    keeper = _Keeper(acquired, store, finder, most)
    failure: Exception | None = None
    try:
        for block in acquired.blocks():
            keeper.take(block)
            progress.saw(block, keeper.status)
    except (daqmx.DaqError, daqmx.RpcError, RigError) as error:
        failure = error
    keeper.end(str(refusal_of(acquired.rig.name, failure)) if failure is not None else "")
    return failure


class _Keeper:
    """Keeps the selected samples as they come, notes the gaps between them, and ends in time."""

    def __init__(
        self, acquired: Acquisition, store: Store, finder: PulseFinder | None, most: int | None
    ) -> None:
        self._acquired, self._store, self._finder, self._most = acquired, store, finder, most
        self._gaps = self._watched = 0
        self._noted = time.monotonic()
        self._early = ""
        self._long = False

    @property
    def status(self) -> str:
        """The number of pulses, in words."""
        if self._finder is None:
            return ""
        count = len(self._finder.starts)
        return "1 pulse" if count == 1 else f"{count} pulses"

    def take(self, block: Block) -> None:
        """Take a block."""
        over = [gap for gap in self._acquired.gaps[self._gaps :] if gap.end <= block.first]
        self._note_gaps(over)
        self._keep([block] if self._finder is None else self._finder.feed(block))
        self._watched = block.end
        if self._finder is not None:
            self._watch(self._finder)
        self._early = self._early or self._reason(block)
        if self._early:
            self._acquired.stop()

    def end(self, failure: str) -> None:
        """Keep the rest, and note the end with its reason."""
        if self._finder is not None:
            self._keep(self._finder.finish())
            self._store.note(watched=self._watched)
        self._note_gaps(self._acquired.gaps[self._gaps :])
        journal = self._store.journal
        if journal is not None and journal.slowest > SLOW_DISK:
            self._store.note(remark=f"the disk took {journal.slowest:.1f} s for one write")
        self._store.note(ended=failure or self._early)

    def _keep(self, pieces: Sequence[Block]) -> None:
        for piece in pieces:
            self._store.append(piece)

    def _note_gaps(self, gaps: Sequence[Gap]) -> None:
        for gap in gaps:
            self._store.note(gap=asdict(gap))
        self._gaps += len(gaps)

    def _watch(self, finder: PulseFinder) -> None:
        """Note the number of examined samples, and doubt a threshold that is exceeded for long."""
        now = time.monotonic()
        if now - self._noted >= SYNC_SECONDS:
            self._noted = now
            self._store.note(watched=self._watched)
        if finder.up_for > LONG_PULSE * self._acquired.facts.rate and not self._long:
            self._long = True
            self._store.note(remark=f"a pulse lasts longer than {LONG_PULSE:g} s: {ABOVE_REST}")
            note(f"A pulse lasts longer than {LONG_PULSE:g} s: {ABOVE_REST}.")
        if finder.done:
            self._acquired.stop()

    def _reason(self, block: Block) -> str:
        """Return the reason for an early end; empty if the measurement continues."""
        journal = self._store.journal
        if self._store.failure:
            return f"the journal cannot be written: {self._store.failure}"
        if journal is not None and journal.is_short_of_room():
            return "the disk has hardly room for the recording"
        # samples in the queue are still to come
        coming = QUEUE_BLOCKS * block.volts.shape[1]
        if self._most is not None and self._store.kept + coming > self._most:
            return "a recording takes no more samples"
        return ""


def recording_in(content: JournalContent, source: str) -> Recording:
    """Return the recording of kept samples; messages name it by `source`.

    DatasetError: the version is another one. RigError: there are too few samples, or no pulses.
    """
    measurement = measurement_in(content.header, source)
    notes = {key: value for each in content.notes for key, value in each.items()}
    try:
        gaps = [_GAP.validate_python(each["gap"]) for each in content.notes if "gap" in each]
        watched = _COUNT.validate_python(notes.get("watched", 0))
    except ValidationError as error:
        raise DatasetError(
            f"{source}: expected notes of gaps and samples as a journal has them, got others: "
            f"{error.errors()[0]['msg']}."
        ) from None
    if not all(0 <= gap.first <= gap.end <= LAST_SAMPLE for gap in gaps) or not 0 <= watched <= LAST_SAMPLE:
        raise DatasetError(
            f"{source}: expected notes of samples 0 to {LAST_SAMPLE}, got others: the journal is damaged."
        )
    remarks = [str(each["remark"]) for each in content.notes if "remark" in each]
    if "ended" not in notes:
        remarks.append(NO_END)
    elif notes["ended"]:
        remarks.append(f"ended early: {notes['ended']}")
    recording = recording_of(measurement, content.blocks, gaps, str(notes.get("started_at", "")), remarks)
    recording.attrs["ended"] = str(notes.get("ended", NO_END))
    if measurement.pulses is None:
        return recording
    return with_pulses(recording, measurement, content.blocks, gaps, max(watched, content.blocks[-1].end))


def write_and_show(recording: Recording, output: Path) -> None:
    """Write a recording, and print its table and its path."""
    with writing(output):
        write_recording(recording, output)
    print_recording(wide_terminal(), recording)
    say(f"Recording written to {output}.")
