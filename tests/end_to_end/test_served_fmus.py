"""`vibroimpact fmu serve` and scenes in other processes, as by a user."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import psutil
import pytest
from harness import warm
from support import fmu_factory
from support.command_line import ENTRY, vibroimpact
from support.served_fmus import certificate

import vibroimpact as vi
from vibroimpact.fmus.private_folder import CACHE_VARIABLE

SCENE = """
[component.f]
fmu = "{fmu}"
{more}
[record]
recorded_time = 1.0
rate = 10
variables = ["f.y"]
[execution]
macro_step = 0.25
[sweep]
"f.fault_time" = {{ values = [0.3, 0.6] }}
"""


def results(folder: Path, fmu: str, more: str = "") -> tuple[dict[str, bytes], str]:
    """Run a scene in a guarded process; return all its numbers, and the hashes of its FMUs."""
    (folder / "scene.toml").write_text(SCENE.format(fmu=fmu, more=more))
    done = vibroimpact("run", folder / "scene.toml", "-o", folder / "run.nc", "--force")
    assert done.returncode == 0, done.stderr
    with vi.open_dataset(folder / "run.nc") as runs:
        assert not any(runs.message.values)
        numbers = {
            name: found.values.tobytes()
            for name, found in runs.data_vars.items()
            if found.dtype.kind in "fib"
        }
        del numbers["point_seconds"]
        return {str(name): data for name, data in numbers.items()}, str(runs.attrs["fmu_hashes"])


def test_a_served_fmu_gives_the_results_of_its_file_and_ctrl_c_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    file, made = fmu_factory.faulty(tmp_path), certificate()
    (tmp_path / "own.pem").write_bytes(made.certificate)
    (tmp_path / "own.key").write_bytes(made.key)
    options = ["--certificate", tmp_path / "own.pem", "--key", tmp_path / "own.key"]
    more = 'certificate = "own.pem"'
    token = tmp_path / "token"
    given = ["fmu", "serve", file, "--listen", "127.0.0.1:0", "--token-file", token]
    with warm.start(ENTRY, *given, *options, env=dict(os.environ)) as server:
        try:
            assert server.stdout is not None
            address = server.stdout.readline().partition("grpc://")[2].partition(". ")[0]
            assert token.stat().st_mode & 0o777 == 0o600
            monkeypatch.setenv("VIBROIMPACT_FMU_TOKENS", f"{address}={token.read_text().strip()}")
            assert results(tmp_path, f"grpc://{address}", more) == results(tmp_path, file.name)
            running = psutil.Process(server.pid).children(recursive=True)
            os.kill(server.pid, signal.SIGINT)
            out, err = server.communicate(timeout=60)
        except BaseException:
            server.kill()
            raise
        assert (server.wait(), err) == (0, "")
    assert out.endswith("Ended.\n")
    assert not any(process.is_running() for process in running)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--listen", "0.0.0.0:0"], "--listen: expected --certificate and --key for 0.0.0.0:0"),
        (["--listen", "nowhere"], "--listen: expected HOST:PORT, got 'nowhere'"),
        (["--key", "own.key"], "--certificate: expected it with --key, got --key alone"),
        (["--certificate", "a.pem", "--key", "b.key"], "--certificate: a.pem: expected a file (PEM)"),
    ],
    ids=["no TLS", "no address", "half", "no file"],
)
def test_options_that_cannot_be_are_refused(options: list[str], text: str, tmp_path: Path) -> None:
    done = vibroimpact("fmu", "serve", "absent.fmu", *options, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(text)
