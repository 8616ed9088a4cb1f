"""The client of the service: submit scenes, follow them, fetch their datasets."""

from __future__ import annotations

import contextlib
import json
import os
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from vibroimpact.fmus.errors import UsageError, VibroimpactError

if TYPE_CHECKING:
    import httpx
    import xarray as xr

URL_VARIABLE, TOKEN_VARIABLE = "VIBROIMPACT_SERVICE", "VIBROIMPACT_TOKEN"
DEFAULT_URL = "http://127.0.0.1:8737"
SECONDS = 30.0
"""For one answer."""
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


class Service:
    """A running service.

    Parameters
    ----------
    url : str, optional
        By default `$VIBROIMPACT_SERVICE`, else `http://127.0.0.1:8737`.
    token : str, optional
        By default `$VIBROIMPACT_TOKEN`.
    folder : path, optional
        Of the service, if it is on this machine: the token is read there.

    Raises
    ------
    UsageError
        There is no token.

    Examples
    --------
    >>> with Service(folder="service") as service:                                    # doctest: +SKIP
    ...     found = service.submit("examples/bifurcation.toml").wait().dataset()
    """

    def __init__(
        self,
        url: str | None = None,
        token: str | None = None,
        *,
        folder: str | os.PathLike[str] | None = None,
    ) -> None:
        import httpx  # of the extra `service`; commands that need no client load it not

        base = url or os.environ.get(URL_VARIABLE) or DEFAULT_URL
        secret = token or _token_in(folder) or os.environ.get(TOKEN_VARIABLE)
        if not secret:
            raise UsageError(
                f"token: expected the token of the service at {base}, got none. Set {TOKEN_VARIABLE}, or say "
                "the folder of the service, which has it in the file `token`."
            )
        headers = {"Authorization": f"Bearer {secret}"}
        try:
            self._http = httpx.Client(base_url=f"{base.rstrip('/')}/api/v1", headers=headers, timeout=SECONDS)
        except (httpx.InvalidURL, ValueError) as error:
            raise UsageError(
                f"url: expected an address such as {DEFAULT_URL}, got {base!r}: {error}."
            ) from None
        self._base = base

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def submit(self, scene: str | os.PathLike[str], *, workers: int | None = None) -> RemoteJob:
        """Submit a scene file.

        Raises
        ------
        ServiceError
            With the problems of the scene.
        UsageError
            The file cannot be read.
        """
        try:
            text = Path(scene).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"{scene}: expected a scene file, got {error}.") from None
        # one key for all attempts: an answer that is lost on the way starts nothing twice
        key = {"Idempotency-Key": uuid.uuid4().hex}
        answer = self.ask("POST", "/campaigns", json={"scene": text, "workers": workers}, headers=key)
        return RemoteJob(self, answer.json())

    def job(self, name: str) -> RemoteJob:
        """Return a campaign by its id."""
        return RemoteJob(self, self.ask("GET", f"/campaigns/{name}").json())

    def jobs(self) -> Iterator[RemoteJob]:
        """Yield all campaigns, the newest first."""
        cursor: str | None = None
        while True:
            parameters = {} if cursor is None else {"cursor": cursor}
            page = self.ask("GET", "/campaigns", params=parameters).json()
            yield from (RemoteJob(self, one) for one in page["items"])
            cursor = page["next"]
            if cursor is None:
                return

    def ask(self, method: str, path: str, **request: Any) -> httpx.Response:
        """Return the answer to a request.

        Raises
        ------
        ServiceError
            It was refused, or nobody answered.
        """
        import httpx

        try:
            answer = self._http.request(method, path, **request)
        except httpx.HTTPError as error:
            raise self._silent(error) from None
        return _accepted(answer)

    @contextlib.contextmanager
    def stream(self, path: str, **request: Any) -> Iterator[httpx.Response]:
        """Open an answer that comes in parts."""
        import httpx

        try:
            with self._http.stream("GET", path, **request) as answer:
                if answer.is_error:
                    answer.read()
                yield _accepted(answer)
        except httpx.HTTPError as error:
            raise self._silent(error) from None

    def _silent(self, error: Exception) -> ServiceError:
        return ServiceError(f"{self._base}: expected a service that answers, got {error}. Is it running?")


class RemoteJob:
    """A campaign on a service.

    Attributes
    ----------
    id : str
    status : dict
        As the service told it last: `state`, `done`, `total`, `message`, ...
    """

    def __init__(self, service: Service, status: dict[str, Any]) -> None:
        self._service, self.status = service, status
        self.id: str = status["id"]

    def refresh(self) -> RemoteJob:
        """Ask the service where the campaign is."""
        self.status = self._service.ask("GET", f"/campaigns/{self.id}").json()
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
        self.status = self._service.ask("POST", f"/campaigns/{self.id}/cancel").json()
        return self

    def resume(self) -> RemoteJob:
        """Let it go on."""
        self.status = self._service.ask("POST", f"/campaigns/{self.id}/resume").json()
        return self

    def fetch(self, path: str | os.PathLike[str]) -> Path:
        """Write its dataset to a file, whole or not at all."""
        target = Path(path)
        part = target.with_name(f".{target.name}.{os.getpid()}.part")
        try:
            with self._service.stream(f"/campaigns/{self.id}/dataset") as answer, part.open("wb") as file:
                for block in answer.iter_bytes():
                    file.write(block)
            part.replace(target)
        except OSError as error:
            raise UsageError(f"{target}: expected a place for a dataset, got {error.strerror}.") from None
        finally:
            part.unlink(missing_ok=True)
        return target

    def dataset(self) -> xr.Dataset:
        """Return its dataset, in memory."""
        import tempfile

        from vibroimpact.analysis.dataset import open_dataset

        with (
            tempfile.TemporaryDirectory() as folder,
            open_dataset(self.fetch(Path(folder, "dataset.nc"))) as found,
        ):
            return found.load()


def _token_in(folder: str | os.PathLike[str] | None) -> str:
    if folder is None:
        return ""
    path = Path(folder, "token")
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise UsageError(f"{path}: expected the token of a service, got {error.strerror}.") from None


def _accepted(answer: httpx.Response) -> httpx.Response:
    if not answer.is_error:
        return answer
    try:
        told = answer.json()
        detail, problems = str(told["detail"]), told.get("problems")
    except (ValueError, KeyError, TypeError):
        detail, problems = f"{answer.status_code} {answer.reason_phrase}", None
    raise ServiceError(detail, answer.status_code, problems)
