"""Refusals that the unmodified client of NI meets on a rig, by code; also on a board, see `test_conformance`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.rig_bench import CONTINUOUS, Bench, refused

from vibroimpact.hardware.daqmx import DaqError, constants, nidaqmx, open_channel


def test_what_the_device_does_not_have_is_refused_by_its_code(bench: Bench) -> None:
    with bench.task() as task:
        with refused(-200220):
            task.ai_channels.add_ai_voltage_chan(bench.named("Dev9/ai0"))
        with refused(-200170):
            task.ai_channels.add_ai_voltage_chan(bench.named("Dev1/ai999"))
        with refused(-200077):
            task.ai_channels.add_ai_voltage_chan(bench.named("Dev1/ai0"), min_val=-1000, max_val=1000)
        with refused(-200478):
            task.start()
        task.ai_channels.add_ai_voltage_chan(bench.named("Dev1/ai0"), min_val=-5, max_val=5)
        with refused(-200011):
            task.ao_channels.add_ao_voltage_chan(bench.named("Dev1/ao0"))


@pytest.mark.parametrize(
    ("code", "timing"),
    [
        (-200077, {"rate": 1e9}),
        (-200077, {"rate": 0.0}),
        (-200077, {"rate": 1000.0, "samps_per_chan": 1}),
        (-89120, {"rate": 1000.0, "source": "/Dev1/PFI99"}),
    ],
)
def test_a_clock_that_the_device_lacks_is_refused_when_the_task_is_verified(
    bench: Bench, code: int, timing: dict[str, Any]
) -> None:
    # NI's driver accepts any clock, and reports the error when the clock is first used
    with bench.inputs() as task:
        source = bench.named(timing.get("source", ""))
        task.timing.cfg_samp_clk_timing(**(timing | {"source": source}))
        with refused(code):
            _ = task.timing.samp_clk_rate
        with refused(code):
            task.control(constants.TaskMode.TASK_VERIFY)
        with refused(code):
            task.start()
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=2)
        assert len(task.read(2)) == 2


def test_a_trigger_needs_a_clock_and_a_terminal_of_the_device(bench: Bench) -> None:
    with bench.inputs() as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig("PFI0")
        assert task.triggers.start_trigger.dig_edge_src == bench.named("/Dev1/PFI0")
        with refused(-200262):
            task.start()
        task.timing.cfg_samp_clk_timing(1000.0)
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev2/PFI0")
        with refused(-89120):
            task.start()


def test_a_read_of_more_than_a_finite_task_has_returns_what_is_left(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=100) as task:
        task.start()
        assert len(task.read(60)) == 60
        assert len(task.read(60)) == 40


def test_a_read_may_begin_at_the_newest_sample(bench: Bench) -> None:
    wave = np.arange(1.0, 9.0)
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs(bench.loop, 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=101) as task,
    ):
        drive.write(wave)
        task.start()
        drive.start()
        task.wait_until_done()
        task.in_stream.relative_to = constants.ReadRelativeTo.MOST_RECENT_SAMPLE
        task.in_stream.offset = -3
        np.testing.assert_allclose(task.read(3), [2.0, 3.0, 4.0], atol=bench.tolerance)
        task.in_stream.relative_to = constants.ReadRelativeTo.FIRST_SAMPLE
        task.in_stream.offset = 1
        np.testing.assert_allclose(task.read(3), [1.0, 2.0, 3.0], atol=bench.tolerance)


def test_a_program_may_let_unread_samples_be_written_over(bench: Bench) -> None:
    bench.as_in_life()
    with bench.inputs("Dev1/ai0", 100_000.0, sample_mode=CONTINUOUS) as task:
        task.in_stream.input_buf_size = 1000
        task.in_stream.overwrite = constants.OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        task.start()
        bench.wait_until(lambda: task.in_stream.total_samp_per_chan_acquired > 5000)
        with refused(-200279):
            task.read(100)
        task.in_stream.relative_to = constants.ReadRelativeTo.MOST_RECENT_SAMPLE
        task.in_stream.offset = -100
        assert len(task.read(100)) == 100


def test_what_is_not_saved_cannot_be_loaded(bench: Bench) -> None:
    from nidaqmx.system.storage import PersistedChannel, PersistedTask

    with bench.task() as task, refused(-200882):
        task.add_global_channels([PersistedChannel("tip", grpc_options=bench.options())])
    with refused(-200485):
        PersistedTask("sweep", grpc_options=bench.options()).load()


def test_a_resource_belongs_to_one_task(bench: Bench) -> None:
    with (
        bench.inputs("Dev1/ai0", 1000.0, sample_mode=CONTINUOUS) as first,
        bench.inputs("Dev1/ai1", 1000.0) as second,
    ):
        first.start()
        with refused(-50103):
            second.start()
        # only a person stops a continuous task: no warning
        first.stop()
        second.start()


def test_a_running_task_is_not_changed_or_started_again(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0", 1000.0, sample_mode=CONTINUOUS) as task:
        task.start()
        with refused(-200479):
            task.timing.cfg_samp_clk_timing(10.0)
        with refused(-200479):
            task.start()
        with refused(-200560):
            task.wait_until_done(0.01)


def test_another_program_attaches_to_a_named_task_and_stops_it(bench: Bench) -> None:
    attach = constants_of("ATTACH_TO_SERVER_SESSION")
    create = constants_of("INITIALIZE_SERVER_SESSION")
    with bench.task("drive") as drive:
        drive.ao_channels.add_ao_voltage_chan(bench.named("Dev1/ao0"))
        drive.write(2.0)
        with pytest.raises(DaqError, match="-200089"):
            nidaqmx.Task("drive", grpc_options=bench.options("drive", initialization_behavior=create))
        with open_channel(bench.address) as channel:
            other = nidaqmx.GrpcSessionOptions(channel, "drive", initialization_behavior=attach)
            with nidaqmx.Task("drive", grpc_options=other) as same:
                same.write(0.0)
        assert bench.output(0) == pytest.approx(0.0, abs=bench.tolerance)
        assert drive.channel_names == [bench.named("Dev1/ao0")]
    with pytest.raises(DaqError, match="-200088"):
        nidaqmx.Task("drive", grpc_options=bench.options("drive", initialization_behavior=attach))


def constants_of(behaviour: str) -> Any:
    from nidaqmx.grpc_session_options import SessionInitializationBehavior

    return SessionInitializationBehavior[behaviour]
