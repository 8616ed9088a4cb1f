"""Losses of an FMU elsewhere: a crash, a stall, the end of its server are outcomes of their points, which go on."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support import fmu_factory
from support.coupled_parts import part
from support.served_fmus import HERE, SECONDS, TOKEN, Servers, certificate, elsewhere, know, servers

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.errors import ComponentError, LateComponentError, LostComponentError, SceneError
from vibroimpact.orchestrator.fmu_server.server import Server
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec
from vibroimpact.orchestrator.remote import description, session
from vibroimpact.orchestrator.remote.address import TOKENS_VARIABLE, Address, FmuServer, read_address
from vibroimpact.orchestrator.remote.description import served_fmu
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import Scene, parse_scene

SCENE = """
[component.f]
fmu = "grpc://{address}"
parameters = {{ fault_time = 0.5 }}
[record]
recorded_time = 1.0
rate = 10
variables = ["f.y"]
[execution]
macro_step = 0.25
guard = false
[sweep]
"f.fault" = {{ values = [0, 7] }}
"""
CRASH, HANG = 7, 4


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module")
def faulty(folder: Path) -> Path:
    return fmu_factory.faulty(folder)


@pytest.fixture(scope="module")
def served() -> Iterator[Servers]:
    with servers() as found:
        yield found


@pytest.fixture(autouse=True)
def no_long_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (description, session):
        monkeypatch.setattr(module, "CONNECT_SECONDS", 0.5)


def scene_of(server: Server) -> Scene:
    return parse_scene(SCENE.format(address=server.address), "scene.toml")


def advanced(
    fault: str, faulty: Path, server: Server, seconds: float, begun: Callable[[], None] = lambda: None
) -> None:
    spec = elsewhere(part("f", faulty, fault=fault, fault_time=0.5), server, seconds)
    importer = Importer([spec], macro_step=0.25)
    try:
        importer.begin()
        begun()
        importer.advance(1.0)
    finally:
        importer.free()


def has_no_instance(server: Server) -> bool:
    end = time.monotonic() + 10.0
    while server.instances and time.monotonic() < end:
        time.sleep(0.01)
    return server.instances == 0


def test_a_crash_names_the_call_and_the_signal_and_the_server_goes_on(served: Servers, faulty: Path) -> None:
    server = served.of(faulty)
    with pytest.raises(
        LostComponentError, match=r"f: fmi3DoStep of grpc://127\S+ at time 0.25: .*SIGSEGV in fmi3DoStep"
    ):
        advanced("segfault", faulty, server, 60.0)
    assert has_no_instance(server)
    advanced("none", faulty, server, 60.0)


def test_a_stall_ends_after_its_time_with_the_process(served: Servers, faulty: Path) -> None:
    server = served.of(faulty)
    with pytest.raises(
        LateComponentError, match=r"f: fmi3DoStep .*at time 0.25: expected an answer within 1 s, got none"
    ):
        advanced("hang", faulty, server, 1.0)
    assert has_no_instance(server)


def test_a_server_that_ends_in_a_step_is_a_loss(faulty: Path) -> None:
    with servers() as own:
        server = own.of(faulty)
        ending = threading.Timer(0.3, server.close)
        with pytest.raises(
            LostComponentError, match=r"f: fmi3DoStep .*expected a server that answers, got none"
        ):
            advanced("hang", faulty, server, 60.0, ending.start)
        assert has_no_instance(server)


def test_points_are_outcomes_and_go_on_when_the_server_is_back(faulty: Path, folder: Path) -> None:
    with servers() as own:
        server = own.of(faulty)
        with GeneralRunner(scene_of(server)) as runner:
            fault = "f.fault"
            assert runner.run({fault: 0}).outcome is Outcome.ok
            crashed = runner.run({fault: CRASH})
            assert crashed.outcome is Outcome.crash
            assert "SIGSEGV" in crashed.message
            assert runner.run({fault: 0}).outcome is Outcome.ok
            server.close()
            for _ in range(2):
                gone = runner.run({fault: 0})
                assert gone.outcome is Outcome.crash
                assert "expected a server that answers, got none" in gone.message
            again = Server(faulty, server.address, TOKEN)
            assert runner.run({fault: 0}).outcome is Outcome.ok
            assert runner.fmu_hashes == {"f": again.fmu.sha256}
            again.close()
            other = Server(fmu_factory.mass(folder), server.address, TOKEN)
            with pytest.raises(ComponentError) as refusal:
                runner.run({fault: 0})
            assert server.fmu.sha256 in str(refusal.value)
            assert other.fmu.sha256 in str(refusal.value)
            other.close()


def test_a_stall_is_a_timeout_within_the_deadline_of_the_run(served: Servers, faulty: Path) -> None:
    text = SCENE.format(address=served.of(faulty).address).replace("guard", "deadline = 1.0\nguard")
    with GeneralRunner(parse_scene(text, "scene.toml")) as runner:
        late = runner.run({"f.fault": HANG})
    assert late.outcome is Outcome.timeout
    assert "expected an answer within 1 s" in late.message


def test_the_loss_of_the_second_server_leaves_no_instance_on_the_first(served: Servers, faulty: Path) -> None:
    server = served.of(faulty)
    with servers() as own:
        other = own.of(faulty)
        specs = [elsewhere(part("a", faulty), server), elsewhere(part("b", faulty), other)]
        other.close()
        with pytest.raises(LostComponentError):
            Importer(specs, macro_step=1.0)
    assert has_no_instance(server)


# ---- access ----


def test_a_token_is_given_to_its_own_server_alone(
    served: Servers, faulty: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = served.of(faulty)
    monkeypatch.setenv(TOKENS_VARIABLE, f"127.0.0.1:1={TOKEN}")
    with pytest.raises(
        SceneError, match=rf"expected a token for this server, got none.*{server.address}=TOKEN"
    ):
        scene_of(server)
    monkeypatch.setenv(TOKENS_VARIABLE, f"{server.address}=another")
    with pytest.raises(SceneError, match="expected the token of this server, got none or another"):
        scene_of(server)


def test_tls_takes_its_own_certificate_alone(faulty: Path, tmp_path: Path) -> None:
    tls = certificate()
    for name, found in (
        ("own.pem", tls),
        ("other.pem", certificate()),
        ("named.pem", certificate("lab.example")),
    ):
        Path(tmp_path, name).write_bytes(found.certificate)
    server = Server(faulty, HERE, TOKEN, tls)
    know(server)
    try:
        path, sha256 = served_fmu(server.address, tmp_path / "own.pem")
        assert (path.name, sha256) == (faulty.name, server.fmu.sha256)
        there = FmuServer(server.address, tmp_path / "own.pem", sha256, SECONDS)
        spec = ComponentSpec("f", path, server=there)
        importer = Importer([spec], macro_step=0.5)
        importer.begin()
        importer.advance(1.0)
        importer.free()
        with pytest.raises(ComponentError, match=r"(?i)certificate"):
            served_fmu(server.address, tmp_path / "other.pem")
        with pytest.raises(ComponentError, match="expected a server that answers, got none"):
            served_fmu(server.address, None)
    finally:
        server.close()
        os.environ.pop(TOKENS_VARIABLE)


@pytest.mark.parametrize(
    ("fmu", "expected"),
    [
        ("grpc://lab.example:31800", "expected a certificate for a server beyond this machine, got none"),
        ("grpc://127.0.0.1", "expected grpc://HOST:PORT, got "),
        ("grpc://../../etc:1", "expected grpc://HOST:PORT, got "),
        ("grpc://127.0.0.1:99999", "expected grpc://HOST:PORT, got "),
    ],
)
def test_an_address_that_cannot_be_used_is_a_problem_of_the_scene(
    fmu: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(TOKENS_VARIABLE, f"lab.example:31800={TOKEN}")
    with pytest.raises(SceneError, match=re.escape(expected)):
        parse_scene(
            SCENE.replace("grpc://{address}", fmu).replace("{{", "{").replace("}}", "}"), "scene.toml"
        )


def test_an_address_with_colons_stands_in_brackets() -> None:
    address = read_address("[::1]:31800")
    assert address == Address("::1", 31800)
    assert (str(address), address.is_loopback) == ("[::1]:31800", True)
