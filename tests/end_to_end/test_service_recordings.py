"""Recordings of the service: uploaded, replayed, fitted, estimated; and files that are no recording."""

from __future__ import annotations

import io
import socket
import threading
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
from support.command_line import in_this_process
from support.places import EXAMPLES
from support.replay_scenes import BOARD, hit
from support.served import Served, scene_file

import vibroimpact as vi
from vibroimpact.fmus.shipped import fmu_path
from vibroimpact.service.client import RemoteRecording, ServiceError

pytestmark = pytest.mark.together("service")

COUPLED = (EXAMPLES / "two_oscillators.toml").read_text(encoding="utf-8").replace("70.0", "2.0")


# for the whole session, like the service: workers that take over tests set up a module's fixtures again
@pytest.fixture(scope="session")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return hit(tmp_path_factory.mktemp("hit"))


@pytest.fixture(scope="session")
def recording(served: Served, file: Path) -> Iterator[RemoteRecording]:
    with served.client() as service:
        yield service.upload_recording(file)


def test_a_recording_comes_back_as_it_was_uploaded(
    served: Served, raw: httpx.Client, recording: RemoteRecording, file: Path, tmp_path: Path
) -> None:
    with served.client() as service:
        assert service.recording("hit.nc").id == recording.id
        assert service.upload_recording(file).id == recording.id, "the same again is the same"
        found = service.recording(recording.id).recording()
        assert recording.id in [one.id for one in service.recordings()]
        with pytest.raises(ServiceError, match="which another recording has"):
            service.upload_recording(hit(tmp_path, seed=2))
    own = vi.open_recording(file)
    assert [one["name"] for one in recording.status["channels"]] == ["base", "board"]
    assert np.array_equal(found.channel("base").values, own.channel("base").values)
    part = raw.get(f"/recordings/{recording.id}/file", headers={"Range": "bytes=0-3"})
    assert (part.status_code, part.content) == (206, b"\x89HDF")
    assert raw.get(f"/recordings/{recording.id}/figure").content[:4] == b"\x89PNG"


def test_text_is_imported_as_its_settings_say(served: Served, tmp_path: Path) -> None:
    text = tmp_path / "acc.txt"
    text.write_text("\n".join(f"{k / 100};{k % 7}" for k in range(50)), encoding="utf-8")
    with served.client() as service:
        found = service.upload_recording(text, {"unit": ["g"], "name": ["tip"]})
        assert found.name == "acc.nc"
        assert found.recording().channel("tip").values[1] == pytest.approx(1.0)
        assert found.status["channels"][0]["units"] == found.recording().channel("tip").unit
        found.delete()
        with pytest.raises(ServiceError, match="got an unknown one"):
            service.recording("acc.nc")


def test_a_fit_of_the_service_is_that_of_the_command_line(
    served: Served, recording: RemoteRecording, file: Path, tmp_path: Path
) -> None:
    scene = scene_file(tmp_path, BOARD)
    with served.client() as service:
        fitted = service.submit(scene, recordings=[recording], fit="body.frequency").wait()
        assert fitted.status["kind"] == "replay"
        found = fitted.dataset()
        assert "body.frequency" in fitted.fitted_scene().splitlines()[1]
    expected = vi.replay(scene, file, fit="body.frequency")
    assert found.fitted_value.equals(expected.fitted_value)
    assert found.variance_accounted_for.equals(expected.variance_accounted_for)
    # the command line can continue in this folder
    folder = served.folder / "jobs" / fitted.id
    again = in_this_process("replay", str(folder / "fitted.toml"), "-o", str(tmp_path / "again.nc"))
    assert again.returncode == 0, again.stderr


def test_an_estimate_of_the_service_is_that_of_the_command_line(
    served: Served, raw: httpx.Client, recording: RemoteRecording, file: Path, tmp_path: Path
) -> None:
    with served.client() as service:
        job = service.estimate("decay", recording, channel="board", start=0.006, law="viscous").wait()
        found = job.dataset()
    target = tmp_path / "own.nc"
    options = ("--channel", "board", "--from", "0.006", "--law", "viscous", "-o", str(target))
    assert in_this_process("estimate", "decay", str(file), *options).returncode == 0
    with vi.open_measured(target) as expected:
        assert found.equals(expected.load())
        assert found.attrs == expected.attrs
    assert raw.get(f"/campaigns/{job.id}/figure").content[:4] == b"\x89PNG"
    assert "Estimates" in raw.get(f"/campaigns/{job.id}/log").text
    assert raw.get(f"/campaigns/{job.id}/scene").status_code == 409


@pytest.mark.parametrize(
    ("name", "content", "status"),
    [
        ("garbage.tdms", b"TDSm" + bytes(range(256)) * 8, 422),
        ("garbage.mat", b"MATLAB 5.0 MAT-file" + b"\xff" * 500, 422),
        ("empty.txt", b"", 422),
        ("bomb.parquet", b"PAR1" + b"\0" * 100 + b"PAR1", 422),
        ("../out.txt", b"0 1\n1 2\n", 422),
        ("a/b.txt", b"0 1\n1 2\n", 422),
        ("nul\0.txt", b"0 1\n1 2\n", 422),
        (".hidden", b"0 1\n1 2\n", 422),
        ("run.txt", b"0 1\n1 2\n", 422),
        ("x" * 100_000, b"0 1\n1 2\n", 422),
    ],
)
def test_what_is_no_recording_is_refused_and_leaves_nothing(
    served: Served, raw: httpx.Client, name: str, content: bytes, status: int
) -> None:
    before = sorted((served.folder / "recordings").iterdir())
    try:
        answer = raw.post("/recordings", params={"name": name}, content=content)
    except httpx.InvalidURL:  # the client itself refuses a name of this length
        return
    assert answer.status_code == status, answer.text[:300]
    assert str(served.folder) not in answer.text
    assert sorted((served.folder / "recordings").iterdir()) == before
    assert not list(served.folder.glob(".upload-*"))


@pytest.mark.parametrize("settings", ["[", "[]", "[" * 3999, '{"a":' * 700])
def test_settings_that_are_no_object_are_refused(raw: httpx.Client, settings: str) -> None:
    answer = raw.post("/recordings", params={"name": "a.txt", "settings": settings}, content=b"0 1\n1 2\n")
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("settings: expected a JSON object")


def test_a_recording_whose_file_somebody_has_removed_is_named_and_can_be_deleted(
    served: Served, raw: httpx.Client, tmp_path: Path
) -> None:
    with served.client() as service:
        found = service.upload_recording(hit(tmp_path, seed=3), name="removed.nc")
    (served.folder / "recordings" / f"{found.id}.nc").unlink()
    decay = {"recording": found.name, "estimate": {"kind": "decay"}}
    answers = [raw.get(f"/recordings/removed.nc/{what}") for what in ("file", "figure")]
    for answer in (*answers, raw.post("/estimates", json=decay)):
        assert (answer.status_code, "somebody has removed it" in answer.text) == (409, True)
        assert str(served.folder) not in answer.text
    replayed = raw.post("/campaigns", json={"scene": BOARD, "recordings": ["removed.nc"]})
    assert (replayed.status_code, "somebody has removed it" in replayed.text) == (422, True)
    assert raw.delete("/recordings/removed.nc").status_code == 204


def test_uploads_without_an_honest_length_are_refused_or_forgotten(served: Served, raw: httpx.Client) -> None:
    assert raw.post("/recordings?name=a.txt", content=iter([b"0 1\n"])).status_code == 413
    place = httpx.URL(served.url)
    token = (served.folder / "token").read_text(encoding="utf-8").strip()
    for length, expected in (("999999999999", b" 413 "), ("9" * 5000, b" 4"), ("-1", b" 4"), ("100000", b"")):
        with socket.create_connection((place.host, place.port), 10.0) as connection:
            line = "POST /api/v1/recordings?name=a.txt HTTP/1.1\r\nHost: 127.0.0.1\r\n"
            head = f"{line}Authorization: Bearer {token}\r\n"
            connection.sendall(f"{head}Content-Length: {length}\r\n\r\n0 1\n".encode())
            if not expected:
                continue  # cut off in the middle
            assert expected in connection.recv(4096).split(b"\r\n")[0]
    end = time.monotonic() + 10.0
    while list(served.folder.glob(".upload-*")):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_many_uploads_at_once_are_all_answered(served: Served, raw: httpx.Client) -> None:
    statuses: list[int] = []

    def upload(number: int) -> None:
        answer = raw.post(f"/recordings?name=many{number}.tdms", content=b"TDSm" * 1000, timeout=600.0)
        statuses.append(answer.status_code)

    threads = [threading.Thread(target=upload, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert statuses == [422] * 8


def test_fmus_are_taken_by_a_service_that_allows_it_alone(
    served: Served, raw: httpx.Client, tmp_path: Path
) -> None:
    refused = raw.post("/fmus?name=own.fmu", content=b"PK")
    assert refused.status_code == 403
    assert "--allow-fmu-upload" in refused.json()["detail"]
    allowing = Served(tmp_path / "allowing", "--allow-fmu-upload")
    try:
        own = tmp_path / "own.fmu"
        own.write_bytes(Path(fmu_path("Oscillator", "3.0")).read_bytes())
        scene = COUPLED.replace('fmu = "Oscillator"', 'fmu = "own.fmu"')
        outside = io.BytesIO()
        with zipfile.ZipFile(outside, "w") as archive:
            archive.writestr("../outside", "x")
        with allowing.client() as service:
            with pytest.raises(ServiceError, match=r"expected one of .*, got 'own.fmu'"):
                service.submit(scene_file(tmp_path, scene))
            with pytest.raises(ServiceError, match=r"bad\.fmu"):
                service.ask("POST", "/fmus", params={"name": "bad.fmu"}, content=outside.getvalue())
            assert service.upload_fmu(own) == "own.fmu"
            assert {"name": "own.fmu", "origin": "uploaded"} in service.ask("GET", "/fmus").json()
            assert service.ask("GET", "/fmus/own.fmu").content == own.read_bytes()
            found = service.submit(scene_file(tmp_path, scene)).wait().dataset()
        scene_file(tmp_path, COUPLED)
        assert found.sizes["sample"] == vi.run(tmp_path / "scene.toml").sizes["sample"]
    finally:
        allowing.stop()
