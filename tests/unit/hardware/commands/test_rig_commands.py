"""`vibroimpact rig`: served in a separate process, listed, recorded from; refusals end with exit code 2."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from harness import warm
from support.command_line import ENTRY, in_this_process
from support.places import ROOT

from vibroimpact.analysis.recording import open_recording
from vibroimpact.hardware.daqmx import nidaqmx, open_channel
from vibroimpact.hardware.virtual_rig.control import RigControl

RIG = ROOT / "examples" / "rig" / "oscillator.toml"
BEAM = ROOT / "examples" / "rig" / "beam.toml"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    words = ("rig", "serve", RIG, "--port", "0", "--speed", "20")
    server = warm.start(ENTRY, *words, stderr=warm.DEVNULL)
    assert server.stdout is not None
    said = server.stdout.readline()
    assert said.startswith("Dev1, X Series (virtual), at grpc://127.0.0.1:")
    yield said.split("grpc://")[1].split(",")[0]
    server.send_signal(signal.SIGINT)
    assert server.wait(10) == 130
    server.stdout.close()


def test_devices_of_a_virtual_rig_are_listed() -> None:
    done = in_this_process("rig", "devices", "--rig", f"virtual:{BEAM}")
    assert done.returncode == 0, done.stderr
    assert "Dev1  Lab-PC+ (virtual)  on virtual:beam.toml" in done.stdout
    assert "83300 samples/s, one after the other" in done.stdout


def test_a_served_rig_is_driven_and_recorded_by_two_programs(address: str, tmp_path: Path) -> None:
    assert "X Series (virtual)" in in_this_process("rig", "devices", "--rig", f"grpc://{address}").stdout
    with open_channel(address) as channel:
        options = nidaqmx.GrpcSessionOptions(channel, "")
        with nidaqmx.Task(grpc_options=options) as drive:
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0")
            drive.write(1.0)
        words = ["--rate", "2000", "--duration", "4", "-o", tmp_path / "held.nc"]
        inputs = ["--channel", "tip=Dev1/ai0,2", "--channel", "loop=Dev1/ai2", "--channel", "spare=Dev1/ai5"]
        done = in_this_process("rig", "record", "--rig", f"grpc://{address}", *inputs, *words)
        truth = RigControl(channel).truth()
    assert done.returncode == 0, done.stderr
    recording = open_recording(tmp_path / "held.nc")
    assert recording.attrs["rig"] == f"grpc://{address}"
    assert recording.attrs["device"] == "Dev1, X Series (virtual)"
    tip, loop = recording.channel("tip"), recording.channel("loop")
    assert (tip.unit, len(tip.values), tip.axis.rate) == ("V", 8000, 2000.0)
    np.testing.assert_allclose(loop.values, 1.0, atol=2e-4)
    # 0.1 N on 100 N/m settles at 1 mm: 1 V
    assert truth["displacement"] == pytest.approx(1e-3, rel=1e-3)
    assert tip.values[-1] == pytest.approx(1.0, abs=2e-3)
    assert "rig record of" in in_this_process("describe", tmp_path / "held.nc").stdout


def test_samples_beyond_the_range_are_flagged(address: str, tmp_path: Path) -> None:
    with open_channel(address) as channel:
        options = nidaqmx.GrpcSessionOptions(channel, "")
        with nidaqmx.Task(grpc_options=options) as drive:
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0")
            drive.write(3.0)
    done = in_this_process(
        *("rig", "record", "--rig", f"grpc://{address}", "--channel", "loop=Dev1/ai2,1"),
        *("--rate", "1000", "--duration", "0.1", "-o", tmp_path / "over.nc"),
    )
    assert "loop: 100 samples are clipped" in done.stdout
    assert not open_recording(tmp_path / "over.nc").channel("loop").good.any()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["devices"], "expected the driver NI-DAQmx on this machine, got none. --rig virtual:RIG.toml"),
        (["devices", "--rig", "local"], "--rig local uses the board of this machine"),
        (["devices", "--rig", "board"], "--rig: expected a rig, got 'board'. --rig virtual:RIG.toml"),
        (["serve", str(RIG), "--speed", "0"], "--speed: expected a number > 0"),
        (["serve", "none.toml"], "none.toml: expected the file of a rig (TOML), got none"),
    ],
)
def test_what_is_no_rig_is_said_in_one_line(words: list[str], said: str) -> None:
    done = in_this_process("rig", *words)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("channels", "timing", "said"),
    [
        (["tip"], ["1000", "1"], "--channel: expected NAME=TERMINAL[,RANGE]"),
        (["tip=Dev1/ai0,x"], ["1000", "1"], "--channel: expected NAME=TERMINAL[,RANGE]"),
        (["tip=Dev1/ai0", "tip=Dev1/ai1"], ["1000", "1"], "--channel: expected NAME=TERMINAL"),
        (["tip=Dev1/ai0"], ["nan", "1"], "--rate: expected samples per second > 0, got nan"),
        (["tip=Dev1/ai0"], ["1000", "1e-3"], "--rate, --duration: expected 2 samples or more"),
        (["tip=Dev1/ai0"], ["1000", "nan"], "--rate, --duration: expected 2 samples or more"),
        (
            ["tip=Dev1/ai0"],
            ["1e5", "1e3"],
            "--rate, --duration: expected at most 47058823 samples of each of 1",
        ),
        (["a=Dev1/ai0", "b=Dev1/ai0"], ["1000", "1"], "The channel is in the task already: b"),
        (["tip=Dev1/ai9"], ["1000", "1"], "The device has no such channel: Dev1/ai9"),
        (["tip=Dev1/ai0"], ["2e6", "1"], "a rate of 2e+06 Hz with 1 channel; expected at most 1e+06 Hz"),
        (["tip=Dev1/ai0,50"], ["1000", "1"], "a range of -50 to 50 V"),
    ],
)
def test_what_cannot_be_recorded_leaves_no_file(
    address: str, tmp_path: Path, channels: list[str], timing: list[str], said: str
) -> None:
    given = [word for channel in channels for word in ("--channel", channel)]
    output = tmp_path / "none.nc"
    done = in_this_process(
        *("rig", "record", "--rig", f"grpc://{address}", *given),
        *("--rate", timing[0], "--duration", timing[1], "-o", output),
    )
    assert done.returncode == 2
    assert said in done.stderr
    assert not output.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("rig", "sweep", "sweep.toml", "-o", "x" * 300 + ".nc"),
            "expected a name of 200 bytes at most, got 303.",
        ),
        (("rig", "recover", "."), ".: expected a journal, got a folder."),
    ],
)
def test_names_that_no_output_or_journal_can_have_are_one_line(words: tuple[str, ...], said: str) -> None:
    done = in_this_process(*words)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
