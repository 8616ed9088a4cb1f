"""A stream of events includes the last event, whenever it comes."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from vibroimpact.service.routes import events as module
from vibroimpact.service.store import Event, Kind, NewJob, State, Store


class Connected:
    """A request whose client stays."""

    async def is_disconnected(self) -> bool:
        return False


async def state_lines(store: Store, name: str) -> list[str]:
    request: Any = Connected()
    return [lines async for lines in module._stream(store, name, 0, request)]


@pytest.mark.parametrize("look", [1, 2, 3])
def test_an_end_that_comes_while_one_looks_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, look: int
) -> None:
    store = Store(tmp_path)
    job, _ = store.submit(NewJob(Kind.run, "short", "a scene"))
    read, looks = store.events, []

    def ends_meanwhile(name: str, *, after: int = 0) -> list[Event]:
        found = read(name, after=after)
        looks.append(after)
        if len(looks) == look:
            store.change(name, state=State.done)
        return found

    monkeypatch.setattr(store, "events", ends_meanwhile)
    monkeypatch.setattr(module, "LOOKS", 0.01)
    lines = asyncio.run(state_lines(store, job.id))
    store.close()
    assert [line.count('"state": "done"') for line in lines] == [0, 1]
