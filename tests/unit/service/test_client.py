"""The client's errors: answers that are not the service's, and targets that are no place for a file."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.errors import UsageError
from vibroimpact.service.client import RemoteJob, Service, ServiceError

KNOWN = {"id": "0" * 32}


@contextmanager
def answering(status: int, body: bytes, kind: str = "text/html") -> Iterator[tuple[str, list[bytes]]]:
    """Serve one answer to every request; yield the address, and the received requests and bodies."""
    got: list[bytes] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            got.append(self.path.encode())
            got.append(self.rfile.read(int(self.headers.get("Content-Length", "0"))))
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_GET

        def log_message(self, *_: object) -> None:
            """Log nothing."""

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}", got
        finally:
            server.shutdown()
            thread.join()


@pytest.mark.parametrize("body", [b"<html>hello</html>", b"", b"[1, 2]", b"\xff\xfe"])
def test_another_server_is_told_from_a_service(body: bytes) -> None:
    with answering(200, body) as (url, _), Service(url, "token") as service:
        with pytest.raises(ServiceError, match="expected a service of vibroimpact, got another's answer"):
            service.job("x")
        with pytest.raises(ServiceError, match="expected a service of vibroimpact"):
            list(service.jobs())


def test_a_redirection_is_no_answer(tmp_path: Path) -> None:
    with answering(307, b"<html>") as (url, _), Service(url, "token") as service:
        with pytest.raises(ServiceError, match="307"):
            service.job("x")
        with pytest.raises(ServiceError, match="307"):
            RemoteJob(service, KNOWN).fetch(tmp_path / "fetched.nc")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["../../etc/passwd", "a?b#c", "é", "a b"])
def test_an_id_stays_where_it_belongs_in_an_address(name: str) -> None:
    with answering(404, b"") as (url, got), Service(url, "token") as service, pytest.raises(ServiceError):
        service.job(name)
    (path,) = [one for one in got if one]
    assert path.startswith(b"/api/v1/campaigns/")
    assert path.count(b"/") == 4
    assert not set(b"?# ") & set(path)


def test_an_id_that_fits_into_no_address_is_refused() -> None:
    with Service("http://127.0.0.1:1", "token") as service, pytest.raises(ServiceError, match="too long"):
        service.job("x" * 70_000)


@pytest.mark.parametrize("token", ["a b", "a\nb", "é", "☃", " "])
def test_what_no_header_can_carry_is_no_token(token: str) -> None:
    with pytest.raises(UsageError, match="token: expected printable characters"):
        Service("http://127.0.0.1:1", token)


def test_a_token_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "token").write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match="expected the token of a service, got no text"):
        Service("http://127.0.0.1:1", folder=tmp_path)


def test_a_file_that_grows_is_uploaded_as_long_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "growing.txt"
    file.write_bytes(b"0 1\n1 2\n3 4\n")
    real = os.fstat

    def before_it_grew(handle: int) -> os.stat_result:
        found = list(real(handle))
        found[6] = min(found[6], 8)
        return os.stat_result(found)

    with answering(201, b'{"id": "0", "name": "growing.nc"}') as (url, got), Service(url, "token") as service:
        monkeypatch.setattr(os, "fstat", before_it_grew)
        service.upload_recording(file)
    assert got[1] == b"0 1\n1 2\n"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names, which Windows has not")
def test_no_file_takes_the_place_of_a_pipe_or_a_folder(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with answering(200, b"content") as (url, _), Service(url, "token") as service:
        job = RemoteJob(service, KNOWN)
        for target in (pipe, tmp_path, Path("")):
            with pytest.raises(UsageError, match="expected a place for a file, got"):
                job.fetch(target)
            with pytest.raises(OSError, match=r"a device, a pipe or a socket|Is a directory"):
                write_atomically(target, b"content")
        with pytest.raises(UsageError, match="File name too long"):
            job.fetch(tmp_path / ("x" * 256))
        with pytest.raises(UsageError, match="expected a file to upload"):
            service.upload_recording(pipe)
        assert job.fetch(tmp_path / "fetched").read_bytes() == b"content"
    assert pipe.is_fifo()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fetched", "pipe"]
