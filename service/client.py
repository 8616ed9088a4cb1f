"""The client of the service: submit scenes, follow them, fetch their datasets."""

from __future__ import annotations

import contextlib
import json
import os
import re
import uuid
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self
from urllib.parse import quote

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.service.ownership import URL_FILE
from vibroimpact.service.remote import RemoteJob, RemoteRecording, ServiceError

if TYPE_CHECKING:
    import httpx

__all__ = ["RemoteJob", "RemoteRecording", "Service", "ServiceError"]
URL_VARIABLE, TOKEN_VARIABLE = "VIBROIMPACT_SERVICE", "VIBROIMPACT_TOKEN"
DEFAULT_URL = "http://127.0.0.1:8737"
SECONDS = 30.0
"""Time limit for one answer, s."""
BLOCK = 2**20
"""Number of bytes that are read at a time from an uploaded file."""
_TOKEN = re.compile(r"[!-~]+")
UPLOAD_SECONDS = 600.0
"""Time limit for the answer to an upload, s; it comes when this file, and those before it, are imported."""


class Service:
    """A running service.

    Parameters
    ----------
    url : str, optional
        Address of the service. The default is `$VIBROIMPACT_SERVICE`, else the address in `folder`, else
        `http://127.0.0.1:8737`.
    token : str, optional
        Token of the service. The default is `$VIBROIMPACT_TOKEN`.
    folder : path, optional
        Folder of a service on this machine; token and address are read there.

    Raises
    ------
    UsageError
        No token was found.

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
        import httpx  # of the extra `service`; loaded only by commands that need the client

        base = url or os.environ.get(URL_VARIABLE) or _url_in(folder) or DEFAULT_URL
        secret = token or _token_in(folder) or os.environ.get(TOKEN_VARIABLE)
        if not secret:
            raise UsageError(
                f"token: expected the token of the service at {base}, got none. Set {TOKEN_VARIABLE}, or say "
                "the folder of the service, which has it in the file `token`."
            )
        if not _TOKEN.fullmatch(secret):
            raise UsageError(
                f"token: expected printable characters of ASCII without blanks, got others. {TOKEN_VARIABLE} or the "
                "file `token` in the folder of the service has it."
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
        """Return the client itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def submit(
        self,
        scene: str | os.PathLike[str],
        *,
        workers: int | None = None,
        recordings: Sequence[str | RemoteRecording] = (),
        fit: str | None = None,
        score: Sequence[str | RemoteRecording] = (),
    ) -> RemoteJob:
        """Submit a scene file.

        Parameters
        ----------
        scene : path
        workers : int, optional
        recordings, score : sequence of str or RemoteRecording
            Recordings of the service that a scene with `[replay]` replays, and recordings that are only scored.
        fit : str, optional
            Keys of the scene's numbers to fit, with commas between them.

        Raises
        ------
        ServiceError
            The service refused the scene; `problems` lists its problems.
        UsageError
            The file cannot be read.
        """
        try:
            text = Path(scene).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"{scene}: expected a scene file, got {error}.") from None
        text = _with_given_modes(text, Path(scene))
        body: dict[str, Any] = {"scene": text, "workers": workers}
        if recordings or score or fit is not None:
            body |= {"fit": fit, "recordings": _names(recordings), "score": _names(score)}
        return self._accepted_job("/campaigns", body)

    def estimate(self, kind: str, data: RemoteRecording | RemoteJob, **options: Any) -> RemoteJob:
        """Estimate from a recording of the service, or from the results of one of its jobs.

        Parameters
        ----------
        kind : str
            `decay`, `impacts`, `response` or `spikes`.
        data : RemoteRecording or RemoteJob
        **options
            Options of the command: `channel`, `start`, `stop`, `law`, `drive`, ...

        Examples
        --------
        >>> service.estimate("decay", recording, channel="tip").wait().dataset()      # doctest: +SKIP
        """
        source = "recording" if isinstance(data, RemoteRecording) else "campaign"
        return self._accepted_job("/estimates", {source: data.id, "estimate": {"kind": kind, **options}})

    def _accepted_job(self, path: str, body: dict[str, Any]) -> RemoteJob:
        # one key for all attempts: a lost answer starts nothing twice
        key = {"Idempotency-Key": uuid.uuid4().hex}
        return RemoteJob(self, self.told("POST", path, json=body, headers=key))

    def upload_recording(
        self,
        path: str | os.PathLike[str],
        settings: Mapping[str, Any] | None = None,
        *,
        name: str | None = None,
    ) -> RemoteRecording:
        """Upload a file of a measuring system, which the service imports.

        Parameters
        ----------
        path : path
        settings : mapping, optional
            Settings of the import, as `import_recording` takes them: `name`, `unit`, `rate`, ...
        name : str, optional
            Name for scenes, with `.nc` in place of its extension; by default the name of the file.

        Raises
        ------
        ServiceError
            The file is no recording, or another recording has its name.
        """
        parameters = {"name": name or Path(path).name, "settings": json.dumps(dict(settings or {}))}
        return RemoteRecording(self, self._upload("/recordings", path, parameters))

    def upload_fmu(self, path: str | os.PathLike[str]) -> str:
        """Upload an FMU to a service that accepts uploads; return its name for scenes."""
        return str(self._upload("/fmus", path, {"name": Path(path).name})["name"])

    def _upload(self, path: str, file: str | os.PathLike[str], parameters: dict[str, str]) -> Any:
        if Path(file).exists() and not Path(file).is_file():
            raise UsageError(f"{file}: expected a file to upload, got something else.")
        try:
            with open(file, "rb") as content:
                size = os.fstat(content.fileno()).st_size
                return self.told(
                    *("POST", path),
                    params=parameters,
                    content=_blocks(content, size),
                    headers={"Content-Length": str(size)},
                    timeout=UPLOAD_SECONDS,
                )
        except OSError as error:
            raise UsageError(f"{file}: expected a file to upload, got {error.strerror}.") from None

    def recording(self, name: str) -> RemoteRecording:
        """Return a recording by its id or its name."""
        return RemoteRecording(self, self.told("GET", f"/recordings/{quote(name, safe='')}"))

    def recordings(self) -> Iterator[RemoteRecording]:
        """Yield all recordings, the newest first."""
        return (RemoteRecording(self, one) for one in self._listed("/recordings"))

    def job(self, name: str) -> RemoteJob:
        """Return a campaign by its id."""
        return RemoteJob(self, self.told("GET", f"/campaigns/{quote(name, safe='')}"))

    def jobs(self) -> Iterator[RemoteJob]:
        """Yield all campaigns, the newest first."""
        return (RemoteJob(self, one) for one in self._listed("/campaigns"))

    def _listed(self, path: str) -> Iterator[dict[str, Any]]:
        """Yield the items of all pages of a list."""
        cursor: int | None = None
        while True:
            parameters = {} if cursor is None else {"cursor": cursor}
            page = self.told("GET", path, params=parameters)
            yield from page["items"]
            cursor = page["next"]
            if cursor is None:
                return

    def ask(self, method: str, path: str, **request: Any) -> httpx.Response:
        """Return the answer to a request.

        Raises
        ------
        ServiceError
            The request was refused, or the service did not answer.
        """
        import httpx

        try:
            answer = self._http.request(method, path, **request)
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            raise self._silent(error) from None
        return _accepted(answer)

    def told(self, method: str, path: str, **request: Any) -> dict[str, Any]:
        """Return the service's answer to a request, a JSON object.

        Raises
        ------
        ServiceError
            The request was refused, nobody answered, or the answer is not from this service.
        """
        answer = self.ask(method, path, **request)
        try:
            content = answer.json()
        except ValueError:
            content = None
        if not isinstance(content, dict):
            got = answer.headers.get("Content-Type", "nothing")
            raise ServiceError(
                f"{self._base}: expected a service of vibroimpact, got another's answer ({got})."
            )
        return content

    @contextlib.contextmanager
    def stream(self, path: str, **request: Any) -> Iterator[httpx.Response]:
        """Open an answer that arrives in parts."""
        import httpx

        try:
            with self._http.stream("GET", path, **request) as answer:
                if not answer.is_success:
                    answer.read()
                yield _accepted(answer)
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            raise self._silent(error) from None

    def _silent(self, error: Exception) -> ServiceError:
        return ServiceError(f"{self._base}: expected a service that answers, got {error}. Is it running?")


def _names(recordings: Sequence[str | RemoteRecording]) -> list[str]:
    return [one if isinstance(one, str) else one.name for one in recordings]


def _token_in(folder: str | os.PathLike[str] | None) -> str:
    if folder is None:
        return ""
    path = Path(folder, "token")
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise UsageError(f"{path}: expected the token of a service, got {error.strerror}.") from None
    except UnicodeDecodeError:
        raise UsageError(f"{path}: expected the token of a service, got no text.") from None


def _url_in(folder: str | os.PathLike[str] | None) -> str:
    """Return the address that a running service has written into its folder; empty if none runs there."""
    if folder is None:
        return ""
    path = Path(folder, URL_FILE)
    try:
        return path.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return ""
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: expected the address of a service, got {error}. Delete it.") from None


def _blocks(file: BinaryIO, size: int) -> Iterator[bytes]:
    """Yield the first `size` bytes of a file in blocks; the file may grow meanwhile."""
    while size > 0 and (block := file.read(min(size, BLOCK))):
        size -= len(block)
        yield block


def _accepted(answer: httpx.Response) -> httpx.Response:
    if answer.is_success:
        return answer
    try:
        content = answer.json()
        detail, problems = str(content["detail"]), content.get("problems")
    except (ValueError, KeyError, TypeError):
        detail, problems = f"{answer.status_code} {answer.reason_phrase}", None
    raise ServiceError(detail, answer.status_code, problems)


def _with_given_modes(text: str, path: Path) -> str:
    """Return the text of a scene with the modes of its bodies as numbers: the service reads no files of bodies."""
    if "file" not in text and "matrices" not in text:
        return text
    # these imports take time, and few scenes need them
    from vibroimpact.orchestrator.scene import load_scene
    from vibroimpact.orchestrator.scene.file import parse_scene_toml
    from vibroimpact.orchestrator.scene.own_structures import files_named

    try:
        document = parse_scene_toml(text, str(path))
    except SceneError:
        return text  # the service says where
    return load_scene(path).text if any(files_named(document)) else text
