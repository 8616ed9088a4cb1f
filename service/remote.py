"""Jobs and recordings that a client holds of a service; their methods ask the service again."""

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
"""Number of successive attempts to reconnect to a service that does not answer."""


class ServiceError(VibroimpactError):
    """The service refused a request, or a campaign on it has failed.

    Attributes
    ----------
    status : int
        Status code of the HTTP answer; 0 without an answer.
    problems : list of dict
        Problems of a scene: `message`, `line`, `column`.
    """

    def __init__(self, message: str, status: int = 0, problems: list[dict[str, Any]] | None = None) -> None:
        self.status, self.problems = status, problems or []
        self.exit_code = 2 if 400 <= status < 500 else 1
        super().__init__(message)


class Connection(Protocol):
    """Interface to a service: a `Service`."""

    def ask(self, method: str, path: str, **request: Any) -> httpx.Response:
        """Return the answer to a request."""

    def told(self, method: str, path: str, **request: Any) -> dict[str, Any]:
        """Return the service's answer to a request, a JSON object."""

    def stream(self, path: str, **request: Any) -> AbstractContextManager[httpx.Response]:
        """Open an answer that arrives in parts."""


class RemoteJob:
    """A campaign on a service.

    Attributes
    ----------
    id : str
    status : dict
        Last known status: `state`, `done`, `total`, `message`, ...
    """

    def __init__(self, service: Connection, status: dict[str, Any]) -> None:
        self._service, self.status = service, status
        self.id: str = status["id"]

    def refresh(self) -> RemoteJob:
        """Update the status from the service."""
        self.status = self._service.told("GET", f"/campaigns/{self.id}")
        return self

    def events(self, after: int = 0) -> Iterator[dict[str, Any]]:
        """Yield all events of the campaign until it has ended, each with its `id`, across lost connections."""
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
        """Wait until the campaign is done.

        Raises
        ------
        ServiceError
            The campaign has failed, or was cancelled.
        """
        for _ in self.events():
            pass
        if self.status["state"] != "done":
            raise ServiceError(f"{self.id}: {self.status['state']}: {self.status['message']}")
        return self

    def cancel(self) -> RemoteJob:
        """Cancel the campaign; its results so far stay."""
        self.status = self._service.told("POST", f"/campaigns/{self.id}/cancel")
        return self

    def resume(self) -> RemoteJob:
        """Resume the campaign."""
        self.status = self._service.told("POST", f"/campaigns/{self.id}/resume")
        return self

    def fetch(self, path: str | os.PathLike[str]) -> Path:
        """Write the campaign's dataset to a file, whole or not at all."""
        return _fetched(self._service, f"/campaigns/{self.id}/dataset", Path(path))

    def dataset(self) -> xr.Dataset:
        """Return the campaign's dataset, in memory: runs, or the results of an estimate or a replay."""
        import tempfile

        from vibroimpact.analysis.dataset import open_dataset
        from vibroimpact.analysis.dataset.reading import open_measured

        opened = open_dataset if self.status["kind"] in ("campaign", "run") else open_measured
        with tempfile.TemporaryDirectory() as folder, opened(self.fetch(Path(folder, "dataset.nc"))) as found:
            return found.load()

    def fitted_scene(self) -> str:
        """Return the text of the campaign's scene with the fitted numbers."""
        return self._service.ask("GET", f"/campaigns/{self.id}/scene", params={"fitted": True}).text


class RemoteRecording:
    """A recording on a service.

    Attributes
    ----------
    id, name : str
        Both identify the recording in scenes.
    status : dict
        Last known status, with `bytes`, `channels`, `created` too.
    """

    def __init__(self, service: Connection, status: dict[str, Any]) -> None:
        self._service, self.status = service, status
        self.id: str = status["id"]
        self.name: str = status["name"]

    def fetch(self, path: str | os.PathLike[str]) -> Path:
        """Write the recording to a file, whole or not at all."""
        return _fetched(self._service, f"/recordings/{self.id}/file", Path(path))

    def recording(self) -> Recording:
        """Return the recording, in memory."""
        import tempfile

        from vibroimpact.analysis.recording import open_recording

        with tempfile.TemporaryDirectory() as folder:
            return open_recording(self.fetch(Path(folder, self.name)))

    def delete(self) -> None:
        """Delete the recording on the service; jobs that were submitted with it keep its data."""
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
