"""`vibroimpact rig record` in a process that is interrupted, killed, or has a full disk: no measured sample is
lost."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from harness import warm
from support.command_line import ENTRY, in_this_process
from support.places import ROOT
from support.rig_programs import PATIENCE, program, wait_for_bytes

from vibroimpact.analysis.recording import open_recording
from vibroimpact.hardware.daqmx import nidaqmx, open_channel
from vibroimpact.hardware.rig.journal import read_journal

RIG = ROOT / "examples" / "rig" / "oscillator.toml"
RATE = 20_000


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Serve a rig whose output is at 1 V, so that a recording is not all zeros."""
    server = warm.start(ENTRY, "rig", "serve", RIG, "--port", "0", stderr=warm.DEVNULL)
    assert server.stdout is not None
    found = server.stdout.readline().split("grpc://")[1].split(",")[0]
    with open_channel(found) as channel:
        options = nidaqmx.GrpcSessionOptions(channel, "")
        with nidaqmx.Task(grpc_options=options) as drive:
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0")
            drive.write(1.0)
    yield found
    server.send_signal(signal.SIGINT)
    server.wait(10)
    server.stdout.close()


def words(address: str, *more: str) -> list[str]:
    inputs = ["--channel", "tip=Dev1/ai0,2", "--loopback", "back=Dev1/ai2,2"]
    return ["rig", "record", "--rig", f"grpc://{address}", *inputs, "--rate", str(RATE), *more]


def test_ctrl_c_leaves_a_whole_recording_and_no_journal(address: str, tmp_path: Path) -> None:
    with program(*words(address, "-o", "tip.nc"), cwd=tmp_path) as process:
        wait_for_bytes(tmp_path / "tip.journal", 200_000, process)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, err) == (0, "")
    assert "Recording written to tip.nc." in out
    back = open_recording(tmp_path / "tip.nc").channel("back")
    np.testing.assert_allclose(back.values, 1.0, atol=1e-3)
    assert len(back.values) >= 12_000
    assert [path.name for path in tmp_path.iterdir()] == ["tip.nc"]


@pytest.mark.parametrize(
    "amount", [100_000, *(pytest.param(n, marks=pytest.mark.long) for n in (700_000, 1_500_000))]
)
def test_a_recording_that_is_killed_is_recovered_with_all_that_reached_its_journal(
    address: str, tmp_path: Path, amount: int
) -> None:
    with program(*words(address, "-o", "tip.nc", "--duration", "600"), cwd=tmp_path) as process:
        wait_for_bytes(tmp_path / "tip.journal", amount, process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    there = read_journal(tmp_path / "tip.journal")
    samples = sum(block.volts.shape[1] for block in there.blocks)
    assert samples * 16 >= amount - 100_000
    done = in_this_process("rig", "recover", tmp_path / "tip.journal")
    assert done.returncode == 0, done.stderr
    assert "the program died: what its journal has is here" in done.stdout
    found = open_recording(tmp_path / "tip.nc")
    assert len(found.channel("tip").values) == samples
    np.testing.assert_allclose(found.channel("back").values, 1.0, atol=1e-3)
    assert found.channel("back").attrs["role"] == "loopback"
    # the journal still exists, so that the next recording does not take its name
    again = in_this_process(*words(address, "--duration", "1", "-o"), tmp_path / "tip.nc", "--force")
    assert again.returncode == 2
    assert "tip.journal: expected no journal of an earlier measurement, got one" in again.stderr


def test_a_journal_that_grows_is_not_recovered(address: str, tmp_path: Path) -> None:
    with program(*words(address, "-o", "tip.nc"), cwd=tmp_path) as process:
        wait_for_bytes(tmp_path / "tip.journal", 50_000, process)
        done = in_this_process("rig", "recover", tmp_path / "tip.journal", "-o", tmp_path / "b.nc")
    assert done.returncode == 2
    assert "got one that is still being written. End that with Ctrl-C" in done.stderr
    assert not (tmp_path / "b.nc").exists()


@pytest.mark.long
def test_a_rig_that_dies_leaves_the_recording_until_then(tmp_path: Path) -> None:
    with program("rig", "serve", RIG, "--port", "0", cwd=tmp_path) as server:
        assert server.stdout is not None
        address = server.stdout.readline().split("grpc://")[1].split(",")[0]
        with program(*words(address, "-o", "tip.nc"), cwd=tmp_path) as process:
            wait_for_bytes(tmp_path / "tip.journal", 200_000, process)
            server.kill()
            out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "Recording written to tip.nc." in out
    assert "expected a rig that answers, got none" in err
    assert err.count("\n") == 1
    assert len(open_recording(tmp_path / "tip.nc").channel("tip").values) >= 10_000
    assert not (tmp_path / "tip.journal").exists()


FULL = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of the size of files")
def test_a_disk_that_takes_no_more_is_said_and_what_is_there_is_kept(address: str, tmp_path: Path) -> None:
    limit = FULL.format(limit=400_000)
    done = warm.run(limit + ENTRY, *words(address, "-o", "tip.nc", "--duration", "60"), cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "ended early: the journal cannot be written: File too large" in done.stderr
    # zeros and ones compress well, so that the recording fits
    assert len(open_recording(tmp_path / "tip.nc").channel("tip").values) * 16 >= 400_000


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of the size of files")
def test_a_recording_that_cannot_be_written_is_still_in_its_journal(address: str, tmp_path: Path) -> None:
    # the journal of 1 s of one input has 170 kB; the disk takes one such file, then only smaller ones
    limit = FULL.format(limit=10_000_000) + (
        "import vibroimpact.hardware.programs.measuring as m\n"
        "write = m.write_and_show\n"
        "def full(*given):\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 10_000_000))\n"
        "    write(*given)\n"
        "m.write_and_show = full\n"
    )
    done = warm.run(limit + ENTRY, *words(address, "-o", "tip.nc", "--duration", "1"), cwd=tmp_path)
    assert done.returncode == 2
    assert "tip.nc: could not be written: File too large." in done.stderr
    assert "vibroimpact rig recover tip.journal -o FILE.nc" in done.stderr
    assert not (tmp_path / "tip.nc").exists()
    assert in_this_process("rig", "recover", tmp_path / "tip.journal").returncode == 0
    assert len(open_recording(tmp_path / "tip.nc").channel("tip").values) == RATE
