"""Make the recording of an aborted measurement, from its journal."""

from __future__ import annotations

import os
from pathlib import Path

from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting
from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.hardware.operations.rig_recover import Recover
from vibroimpact.hardware.programs.keeping import recording_in, write_and_show
from vibroimpact.hardware.rig.journal import read_journal
from vibroimpact.hardware.rig.measurement import FEWEST_SAMPLES


def recover(journal: str | os.PathLike[str]) -> Recording:
    """Return the recording of all whole records of a journal.

    Parameters
    ----------
    journal : path

    Raises
    ------
    UsageError
        There is no journal, or a program is still writing it.
    DatasetError
        It is no journal, or has fewer than two samples.
    RigError
        No pulse was recorded.
    """
    content = read_journal(Path(journal))
    count = sum(block.volts.shape[1] for block in content.blocks)
    if count < FEWEST_SAMPLES:
        raise DatasetError(
            f"{os.fspath(journal)}: expected a journal of {FEWEST_SAMPLES} samples or more, got {count}; "
            f"{content.lost_bytes} of its bytes are damaged or cut off."
        )
    if content.lost_bytes:
        content.notes.append({"remark": f"{content.lost_bytes} bytes of the journal are damaged or cut off"})
    return recording_in(content, str(journal))


def recover_into(options: Recover) -> None:
    """Write the recording of a journal; the journal stays."""
    journal = options.journal
    if not journal.name or journal.is_dir():
        raise UsageError(f"{journal}: expected a journal, got a folder.")
    target = options.output or journal.with_suffix(".nc")
    refuse_outputs([journal], target, None)
    refuse_overwriting(target, options.force, lambda there: False)
    write_and_show(recover(journal), target)
    say(f"{journal} is still there; remove it when the recording has what you need.")
