"""The home of a campaign: a folder, or an address of an object store. One campaign holds it, and all workers see it.

A file or an object in it, and no name, proves that a worker sees the same home.
"""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from vibroimpact.analysis.dataset.places import given_place
from vibroimpact.analysis.files.folder_lock import locked_folder, make_folder
from vibroimpact.analysis.files.object_lock import locked_address
from vibroimpact.analysis.files.object_paths import AnyPath, ObjectPath, located
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import WITH_OUTPUT, message

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.workers.pool import WorkerPool

_NO_NAME = re.compile(r"[a-z][a-z0-9+]+:")
"""Form of an address without a name, as a path has it; no folder of a campaign."""


@contextmanager
def held_home(
    folder: str | os.PathLike[str], note: Callable[[str], object]
) -> Iterator[tuple[AnyPath, Callable[[], None]]]:
    """Hold the home of a campaign; yield it, and a function that raises CampaignError once another campaign holds it.

    Raises
    ------
    UsageError
        Another campaign holds the home, or it cannot be written.
    """
    home = located(given_place(folder))
    if _NO_NAME.fullmatch(str(home)):
        raise UsageError(
            f"{home}//: expected a name after the kind of address, such as s3://bucket/map, got none."
        )
    home = home.absolute()
    if isinstance(home, ObjectPath):
        with locked_address(home, note) as refuse_lost:
            yield home, refuse_lost
        return
    make_folder(home)
    with locked_folder(home):
        yield home, lambda: None


def make_folder_in_home(folder: AnyPath) -> None:
    """Make a folder of a campaign; at an address there is nothing to make."""
    if not isinstance(folder, ObjectPath):
        make_folder(folder)


def answer_question(folder: str, name: str) -> str:
    """Read a question file in a folder, on a worker; write an answer file next to it and return its name.

    The name is empty if the worker does not see the question or cannot write.
    """
    answer = f".answer-{name}-{secrets.token_hex(8)}"
    try:
        home = located(folder)
        if (home / f".question-{name}").read_text(encoding="ascii") != name:
            return ""
        (home / answer).write_text(name, encoding="ascii")
    except OSError:
        return ""
    return answer


def refuse_blind_workers(pool: WorkerPool, home: AnyPath) -> None:
    """Raise UsageError unless all workers read and write the same home as this process."""
    name = secrets.token_hex(16)
    question = home / f".question-{name}"
    question.write_text(name, encoding="ascii")
    try:
        answers = pool.call_everywhere(answer_question, str(home), name)
    finally:
        question.unlink()
    blind = [address for address, answer in answers.items() if not (answer and (home / answer).exists())]
    for answer in filter(None, answers.values()):
        (home / answer).unlink(missing_ok=True)
    if blind:
        raise UsageError(
            message(
                f"{home}: expected a folder that every worker reads and writes, got {len(blind)} that do not: "
                f"{', '.join(sorted(blind)[:5])}. Choose a folder on a shared file system, or an object store",
                WITH_OUTPUT,
                ".",
            )
        )
