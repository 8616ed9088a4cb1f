"""The folder of a campaign: a path that all workers see, checked by a file in it, not by the folder's name."""

from __future__ import annotations

import os
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from vibroimpact.analysis.dataset.places import given_place
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import WITH_OUTPUT, message

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.pool import WorkerPool


def folder_of_campaign(folder: str | os.PathLike[str]) -> Path:
    """Return the folder of a campaign; UsageError for the address of an object store, which cannot hold one."""
    place = given_place(folder)
    if isinstance(place, str):
        raise UsageError(
            f"{place}: expected a folder of this machine for a campaign, got an address. Give a folder; "
            f"`vibroimpact convert FOLDER {place}` copies its dataset to the address."
        )
    return place


def answer_question(folder: str, name: str) -> str:
    """Read a question file in a folder, on a worker; write an answer file next to it and return its name.

    The name is empty if the worker does not see the question or cannot write.
    """
    answer = f".answer-{name}-{secrets.token_hex(8)}"
    try:
        if Path(folder, f".question-{name}").read_text(encoding="ascii") != name:
            return ""
        Path(folder, answer).write_text(name, encoding="ascii")
    except OSError:
        return ""
    return answer


def refuse_blind_workers(pool: WorkerPool, folder: Path) -> None:
    """Raise UsageError unless all workers read and write the same folder as this process."""
    name = secrets.token_hex(16)
    question = folder / f".question-{name}"
    question.write_text(name, encoding="ascii")
    try:
        answers = pool.call_everywhere(answer_question, str(folder), name)
    finally:
        question.unlink()
    blind = [address for address, answer in answers.items() if not (answer and (folder / answer).exists())]
    for answer in filter(None, answers.values()):
        (folder / answer).unlink(missing_ok=True)
    if blind:
        raise UsageError(
            message(
                f"{folder}: expected a folder that every worker reads and writes, got {len(blind)} that do not: "
                f"{', '.join(sorted(blind)[:5])}. Choose a folder on a shared file system",
                WITH_OUTPUT,
                ".",
            )
        )
