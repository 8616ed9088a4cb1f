"""A rig under misuse: odd rig files and messages, clients that die, several clients at once."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import pytest
from harness import warm
from hypothesis import given
from hypothesis import strategies as st
from support.places import ROOT
from support.rig_bench import BITS_16, CONTINUOUS, opened_bench, refused

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.daqmx import grpc
from vibroimpact.hardware.virtual_rig.control import SERVICE
from vibroimpact.hardware.virtual_rig.settings import read_rig

RIG = ROOT / "examples" / "rig" / "oscillator.toml"
BEAM = ROOT / "examples" / "rig" / "beam.toml"

_VALUES = st.one_of(
    st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.lists(st.integers(), max_size=2)
)
_TERMINALS = st.one_of(
    st.sampled_from(["ao0", "ao1", "ai0", "ai7", "ai8", "ai00", "AI0"]), st.text(max_size=6)
)
_SIGNALS = st.one_of(st.sampled_from(["exciter", "ao0", "ao9", "drive", "load_cell"]), _VALUES)


@given(
    rig=st.dictionaries(
        st.sampled_from(["scene", "recording", "run", "device", "name", "speed", "x"]), _VALUES
    ),
    wiring=st.one_of(_VALUES, st.dictionaries(_TERMINALS, _SIGNALS, max_size=4)),
)
def test_any_rig_file_is_read_or_refused_in_lines(
    tmp_path_factory: pytest.TempPathFactory, rig: dict[str, object], wiring: object
) -> None:
    import tomli_w

    file = tmp_path_factory.mktemp("rig") / "rig.toml"
    file.write_text(tomli_w.dumps({"rig": {"device": "labpc+", **rig}, "wiring": wiring}), encoding="utf-8")
    said = ""
    try:
        assert read_rig(file).wiring.signals is not None
    except UsageError as error:
        said = str(error)
    assert all(line.startswith(str(file)) for line in said.splitlines())


def test_any_control_message_is_answered_or_refused_and_the_rig_goes_on() -> None:
    messages = [b"", b"[]", b"{", b"\xff", b"[" * 100_000, b'{"terminal": 3}', b'{"volts": 1e999}']
    odd = (None, True, -1, 1e308, "x", [], {}, "Dev1/ai0", float("nan"))
    messages += [json.dumps({"terminal": a, "volts": b, "ppm": b}).encode() for a in odd for b in odd]
    messages += [json.dumps({"speed": value, "lockstep": value}).encode() for value in odd]
    with opened_bench(RIG) as bench:
        codes = set()
        for method in (
            "State",
            "Pace",
            "Pulse",
            "Stick",
            "Clip",
            "ClockError",
            "Mend",
            "Truth",
            "Overrun",
            "None",
        ):
            call = bench.channel.unary_unary(f"/{SERVICE}/{method}")
            for message in messages:
                try:
                    json.loads(call(message, timeout=10.0))
                except grpc.RpcError as error:
                    codes.add(error.code())
        assert codes == {grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.UNIMPLEMENTED}
        bench.control.mend()
        bench.control.pace(lockstep=True, speed=1.0)
        with bench.inputs(rate=1000.0, samps_per_chan=10) as task:
            assert len(task.read(10)) == 10


DYING = """
import sys
import nidaqmx
from vibroimpact.hardware.daqmx import open_channel
from nidaqmx.constants import AcquisitionType
channel = open_channel(sys.argv[1])
task = nidaqmx.Task(grpc_options=nidaqmx.GrpcSessionOptions(channel, "dying"), new_task_name="dying")
task.ai_channels.add_ai_voltage_chan("Dev1/ai0")
task.timing.cfg_samp_clk_timing(1000.0, sample_mode=AcquisitionType.CONTINUOUS)
task.start()
print("reads", flush=True)
task.read(10**6, timeout=-1)
"""


def test_a_client_that_is_killed_in_the_middle_of_a_read_leaves_a_task_that_others_can_end() -> None:
    with opened_bench(RIG, lockstep=False) as bench:
        with warm.start(DYING, bench.server.address) as client:
            assert client.stdout is not None
            assert client.stdout.readline() == "reads\n"
            client.kill()
        with bench.inputs(rate=1000.0, samps_per_chan=10) as task, refused(-50103):
            task.start()
        bench.server.board.remove(bench.server.board.tasks["dying"])
        with bench.inputs(rate=1000.0, samps_per_chan=10) as task:
            assert len(task.read(10)) == 10


def test_many_clients_write_and_read_at_once() -> None:
    failed: list[BaseException] = []
    with opened_bench(RIG) as bench:

        def write(number: int) -> None:
            try:
                with bench.outputs(f"Dev1/ao{number}") as drive:
                    for volts in np.linspace(0.0, 1.0, 50):
                        drive.write(volts)
                        bench.control.truth()
            except BaseException as error:
                failed.append(error)

        writers = [threading.Thread(target=write, args=(number,)) for number in (0, 1)]
        for writer in writers:
            writer.start()
        with bench.inputs("Dev1/ai2", 1000.0, sample_mode=CONTINUOUS) as task:
            for _ in range(50):
                assert len(task.read(100)) == 100
        for writer in writers:
            writer.join()
        assert failed == []
        assert bench.control.truth()["outputs"] == pytest.approx([1.0, 1.0], abs=BITS_16)


def test_the_truth_has_the_force_of_the_exciter_and_that_on_the_load_cell(tmp_path: Path) -> None:
    with opened_bench(BEAM) as bench, bench.task() as drive:
        drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
        drive.write(-5.0)
        assert bench.control.truth()["exciter_force"] == pytest.approx(-0.5, abs=1e-3)
        forces = []
        for _ in range(400):
            bench.control.advance(1e-4)
            forces.append(bench.control.truth()["load_cell_force"])
    # the beam, pushed towards the cell, hits it: half sines of 1.5 ms
    assert max(forces) > 0.1
    assert min(forces) == 0.0
