from __future__ import annotations

import time

import pytest

from vibroimpact.service import sessions as module
from vibroimpact.service.page_files import page_files
from vibroimpact.service.sessions import Sessions


def request(sessions: Sessions, **headers: str) -> dict[bytes, bytes]:
    cookie = f"other=1; {sessions.cookie}={sessions.made()}"
    found = {"cookie": cookie, "host": "127.0.0.1:8737"} | headers
    return {name.replace("_", "-").encode(): value.encode() for name, value in found.items()}


def test_a_session_reads_from_anywhere_but_another_site() -> None:
    sessions = Sessions("token")
    assert sessions.are_in(request(sessions), "GET")
    assert sessions.are_in(request(sessions, sec_fetch_site="same-origin"), "GET")
    for site in ("same-site", "cross-site"):
        assert not sessions.are_in(request(sessions, sec_fetch_site=site), "GET")


def test_a_session_changes_things_from_its_own_page_alone() -> None:
    sessions = Sessions("token")
    assert sessions.are_in(request(sessions, origin="http://127.0.0.1:8737"), "POST")
    for origin in ("http://127.0.0.1:9999", "null", "", "http://[", "https://evil.example"):
        assert not sessions.are_in(request(sessions, origin=origin), "POST"), origin
    assert not sessions.are_in(request(sessions), "DELETE")


@pytest.mark.parametrize("value", ["", ".", "99999999999.", "nan.x", "1.2.3", "\xff.\xff", "1e400.0"])
def test_what_no_service_made_is_no_session(value: str) -> None:
    assert not Sessions("token").is_known(value)


def test_a_session_ends_with_its_time_and_with_its_token(monkeypatch: pytest.MonkeyPatch) -> None:
    value = Sessions("token").made()
    assert Sessions("token").is_known(value)
    assert not Sessions("other").is_known(value)
    monkeypatch.setattr(module.time, "time", lambda: float(value.partition(".")[0]) + 1.0)
    assert not Sessions("token").is_known(value)


@pytest.mark.parametrize(
    "filler", ['x="' + "\\" * 60_000 + '"', "; " * 30_000, "vibroimpact-" * 5_000, "a=1; " * 12_000]
)
def test_a_cookie_header_of_a_stranger_is_looked_through_at_once(filler: str) -> None:
    sessions = Sessions("token")
    began = time.process_time()
    assert not sessions.are_in({b"cookie": filler.encode()}, "GET")
    assert sessions.are_in({b"cookie": f"{filler}; {sessions.cookie}={sessions.made()}".encode()}, "GET")
    assert time.process_time() - began < 0.1


def test_the_files_of_the_page_name_no_other_host() -> None:
    assert len(page_files()) > 10
    for path in page_files().values():
        assert "http" not in path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", ""), path
