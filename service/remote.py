"""What a client holds of a service: jobs and recordings, each asked for again when something is wanted of it."""

from __future__ import annotations

import json
import os
import secrets
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from vibroimpact.analysis.files.atomic import refuse_special
from vibroimpact.fmus.errors import UsageError, VibroimpactError

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    import httpx
    import xarray as xr

    from vibroimpact.analysis.recording import Recording

ENDED = ("done", "failed", "cancelled")
MOST_RECONNECTS = 20
"""Attempts in a row to follow a service that does not answer."""


class ServiceError(VibroimpactError):
    """The service refused a request, or a campaign on it has failed.

    Attributes
    ----------
    status : int
        Of the answer, as HTTP has them; 0 where there was none.
    problems : list of dict
        Of a scene: `message`, `line`, `column`.
    """

    def __init__(self, message: str, status: int = 0, problems: list[dict[str, Any]] | None = None) -> None:
        self.status, self.problems = status, problems or []
        self.exit_code = 2 if 400 <= status < 500 else 1
        super().__init__(message)


class Connection(Protocol):
    """What asks a service: a `Service`."""

    def ask(self, method: str, path: str, **request: Any) -> httpx.Response:
        """Return the answer to a request."""

    def told(self, method: str, path: str, **request: Any) -> dict[str, Any]:
        """Return what the service tells: a JSON object."""

    def stream(self, path: str, **request: Any) -> AbstractContextManager[httpx.Response]:
        """Open an answer that comes in parts."""


class RemoteJob:
    """A campaign on a service.

    Attributes
    ----------
    id : str
    status : dict
        As the service told it last: `state`, `done`, `total`, `message`, ...
    """

    def __init__(self, service: Connection, status: dict[str, Any]) -> None:
        self._service, self.status = service, status
        self.id: str = status["id"]

    def refresh(self) -> RemoteJob:
        """Ask the service where the campaign is."""
        self.status = self._service.told("GET", f"/campaigns/{self.id}")
        return self

    def events(self, after: int = 0) -> Iterator[dict[str, Any]]:
        """Yield all that happens to it until it has ended, each with its `id`, over lost connections too."""
        failures = 0
        while True:
            try:
                for event in self._events(after):
                    after, failures = event["id"], 0
                    yield event
                if self.refresh().status["state"] in ENDED:
                    return
            except ServiceError as error:
                failures += 1
                if error.status or failures > MOST_RECONNECTS:
                    raise
                time.sleep(min(0.1 * 2**failures, 5.0))

    def _events(self, after: int) -> Iterator[dict[str, Any]]:
        header = {"Last-Event-ID": str(after)}
        with self._service.stream(f"/campaigns/{self.id}/events", headers=header) as answer:
            event: dict[str, Any] = {}
            for line in answer.iter_lines():
                name, _, value = line.partition(": ")
                if not line and event:
                    yield event
                    event = {}
                elif name == "id":
                    event["id"] = int(value)
                elif name == "event":
                    event["kind"] = value
                elif name == "data":
                    event |= json.loads(value)

    def wait(self) -> RemoteJob:
        """Return when it is done.

        Raises
        ------
        ServiceError
            It has failed, or was cancelled.
        """
        for _ in self.events():
            pass
        if self.status["state"] != "done":
            raise ServiceError(f"{self.id}: {self.status['state']}: {self.status['message']}")
        return self

    def cancel(self) -> RemoteJob:
        """Cancel it; what it has computed stays."""
        self.status = self._service.told("POST", f"/campaigns/{self.id}/cancel")
        return self

    def resume(self) -> RemoteJob:
        """Let it go on."""
        self.status = self._service.told("POST", f"/campaigns/{self.id}/resume")
        return self

    def fetch(self, path: str | os.PathLike[str]) -> Path:
        """Write its dataset to a file, whole or not at all."""
        return _fetched(self._service, f"/campaigns/{self.id}/dataset", Path(path))

    def dataset(self) -> xr.Dataset:
        """Return its dataset, in memory: of runs, or of what was estimated or replayed."""
        import tempfile

        from vibroimpact.analysis.dataset import open_dataset
        from vibroimpact.analysis.dataset.reading import open_measured

        opened = open_dataset if self.status["kind"] in ("campaign", "run") else open_measured
        with tempfile.TemporaryDirectory() as folder, opened(self.fetch(Path(folder, "dataset.nc"))) as found:
            return found.load()

    def fitted_scene(self) -> str:
        """Return the text of its scene with the numbers that a fit has found."""
        return self._service.ask("GET", f"/campaigns/{self.id}/scene", params={"fitted": True}).text


class RemoteRecording:
    """A recording on a service.

    Attributes
    ----------
    id, name : str
        Scenes name it by either.
    status : dict
        As the service told it: `bytes`, `channels`, `created` too.
    """

    def __init__(self, service: Connection, status: dict[str, Any]) -> None:
        self._service, self.status = service, status
        self.id: str = status["id"]
        self.name: str = status["name"]

    def fetch(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a file, whole or not at all."""
        return _fetched(self._service, f"/recordings/{self.id}/file", Path(path))

    def recording(self) -> Recording:
        """Return it, in memory."""
        import tempfile

        from vibroimpact.analysis.recording import open_recording

        with tempfile.TemporaryDirectory() as folder:
            return open_recording(self.fetch(Path(folder, self.name)))

    def delete(self) -> None:
        """Let the service forget it; jobs that were submitted with it keep what they read."""
        self._service.ask("DELETE", f"/recordings/{self.id}")


def _fetched(service: Connection, path: str, target: Path) -> Path:
    try:
        refuse_special(target)
    except OSError as error:
        raise _no_place(target, error) from None
    part = target.with_name(f".{os.getpid()}-{secrets.token_hex(4)}.part")
    try:
        with service.stream(path) as answer, part.open("wb") as file:
            for block in answer.iter_bytes():
                file.write(block)
        part.replace(target)
    except OSError as error:
        raise _no_place(target, error) from None
    finally:
        part.unlink(missing_ok=True)
    return target


def _no_place(target: Path, error: OSError) -> UsageError:
    return UsageError(f"{target}: expected a place for a file, got {error.strerror}.")
