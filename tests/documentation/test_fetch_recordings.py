"""examples/recordings/fetch.py gets the files of the pages, whole or not at all, from a server on this machine."""

from __future__ import annotations

import hashlib
import importlib.util
import re
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote

import pytest
from support.places import ROOT

CONTENT = b"0.0 1.0\n0.1 2.0\n"
REQUESTED = "/somebody/rig/0123abcd/data/set #1/hit 1.txt"


@pytest.fixture
def fetch(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the script with a single recording of a single file."""
    spec = importlib.util.spec_from_file_location("fetch", ROOT / "examples" / "recordings" / "fetch.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "fetch", script)
    spec.loader.exec_module(script)
    return script


@pytest.fixture
def one_file(fetch: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    file = fetch.File("hit.txt", "data/set #1/hit 1.txt", hashlib.sha256(CONTENT).hexdigest())
    monkeypatch.setattr(fetch, "SOURCES", {"hit": fetch.Source("somebody/rig", "0123abcd", "MIT", (file,))})


class Server(HTTPServer):
    """Serves one file; stores the requests."""

    content = CONTENT
    requests: list[str]


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        self.server.requests.append(unquote(self.path))
        found = unquote(self.path) == REQUESTED
        self.send_response(200 if found else 404)
        self.send_header("Content-Length", str(len(self.server.content) if found else 0))
        self.end_headers()
        if found:
            self.wfile.write(self.server.content)

    def log_message(self, format: str, *arguments: object) -> None:
        """Write no log."""


@pytest.fixture
def server() -> Iterator[Server]:
    with Server(("127.0.0.1", 0), Handler) as served:
        served.requests = []
        thread = threading.Thread(target=served.serve_forever)
        thread.start()
        yield served
        served.shutdown()
        thread.join()


def address(server: Server) -> str:
    return f"http://127.0.0.1:{server.server_port}"


@pytest.mark.usefixtures("one_file")
def test_a_recording_is_fetched_once_with_its_licence_said(
    fetch: ModuleType, server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        assert fetch.main(["hit", "-o", str(tmp_path), "--server", address(server)]) == 0
    assert (tmp_path / "hit.txt").read_bytes() == CONTENT
    assert server.requests == [REQUESTED]
    said = capsys.readouterr().out
    assert said.count("hit: hit.txt\n    MIT, github.com/somebody/rig at 0123abcd") == 2


@pytest.mark.usefixtures("one_file")
def test_other_bytes_than_those_of_the_pages_leave_nothing(
    fetch: ModuleType, server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    server.content = CONTENT + b"!"
    assert fetch.main(["-o", str(tmp_path), "--server", address(server)]) == 1
    assert list(tmp_path.iterdir()) == []
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "hit.txt" in said
    assert "hash" in said


@pytest.mark.usefixtures("one_file")
def test_a_server_that_is_not_there_is_one_line(
    fetch: ModuleType, server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = HTTPServer(("127.0.0.1", 0), Handler)
    gone.server_close()
    assert fetch.main(["-o", str(tmp_path), "--server", f"http://127.0.0.1:{gone.server_port}"]) == 1
    assert fetch.main(["-o", str(tmp_path), "--server", f"{address(server)}/elsewhere"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert all("cannot be fetched as" in line for line in said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("one_file")
def test_a_file_of_the_users_own_is_not_overwritten(
    fetch: ModuleType, server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hit.txt").write_text("mine")
    assert fetch.main(["hit", "-o", str(tmp_path), "--server", address(server)]) == 2
    assert (tmp_path / "hit.txt").read_text() == "mine"
    assert server.requests == []
    assert capsys.readouterr().err.endswith("got another. Move it away.\n")


def test_an_unknown_name_is_misuse_and_says_the_known_ones(
    fetch: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fetch.main(["bord"]) == 2
    assert "expected some of board, package" in capsys.readouterr().err


def test_the_page_of_the_recordings_names_the_same_repositories_commits_and_licences(
    fetch: ModuleType,
) -> None:
    page = (ROOT / "docs" / "recordings" / "README.md").read_text(encoding="utf-8")
    for name, source in fetch.SOURCES.items():
        row = next(line for line in page.splitlines() if line.startswith("|") and source.repository in line)
        assert row.lower().startswith(f"| {name}")
        assert f"`{source.commit[:8]}` | {source.licence}" in row
        assert len({file.name for file in source.files}) == len(source.files)
        assert all(re.fullmatch("[0-9a-f]{64}", file.sha256) for file in source.files)


def test_the_hashes_are_those_of_the_recordings_beside_this_checkout(fetch: ModuleType) -> None:
    kept = {path.name: path for path in (ROOT.parent / "shared" / "data").glob("*/*")}
    files = [file for source in fetch.SOURCES.values() for file in source.files if file.name in kept]
    if not files:
        pytest.skip("the recordings are not beside this checkout (shared/data)")
    for file in files:
        assert hashlib.sha256(kept[file.name].read_bytes()).hexdigest() == file.sha256, file.name
