"""The unmodified client of NI on the virtual rig: what a voltage program does, and what it must be refused."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.places import ROOT
from support.rig_bench import BITS_16, CONTINUOUS, Bench, opened_bench, refused

from vibroimpact.fmus.core import Oscillator, flow
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.daqmx import METHODS, DaqError, System, constants, grpc, nidaqmx, open_channel
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig


@pytest.fixture(scope="module")
def rig() -> Iterator[Bench]:
    with opened_bench(ROOT / "examples" / "rig" / "oscillator.toml") as opened:
        yield opened


@pytest.fixture
def bench(rig: Bench) -> Iterator[Bench]:
    rig.control.pace(lockstep=True)
    yield rig
    rig.clear()


# ---- queries ----


def test_the_system_has_one_device_with_its_channels(bench: Bench) -> None:
    system = System.remote(bench.options())
    assert system.devices.device_names == ["Dev1"]
    device = system.devices["Dev1"]
    assert device.product_type == "X Series (virtual)"
    assert device.is_simulated
    assert device.ai_physical_chans.channel_names == [f"Dev1/ai{k}" for k in range(8)]
    assert device.ao_physical_chans.channel_names == ["Dev1/ao0", "Dev1/ao1"]
    assert device.ai_voltage_rngs == [-1, 1, -2, 2, -5, 5, -10, 10]
    assert device.ai_simultaneous_sampling_supported


def test_a_channel_has_the_smallest_range_that_holds_what_was_asked_for(bench: Bench) -> None:
    with bench.task() as task:
        channel = task.ai_channels.add_ai_voltage_chan("Dev1/ai1", "tip", min_val=-1.5, max_val=0.3)
        assert (channel.name, channel.ai_rng_high, channel.ai_max) == ("tip", 2.0, 2.0)
        channel.ai_rng_high = 10.0
        assert channel.ai_rng_low == -10.0
        with refused(-200077):
            channel.ai_rng_high = 3.0
        assert task.channel_names == ["tip"]
        assert [device.name for device in task.devices] == ["Dev1"]


def test_an_attribute_that_is_not_modelled_is_refused(bench: Bench) -> None:
    with bench.inputs() as task:
        with refused(-200452):
            _ = task.ai_channels[0].ai_lowpass_enable
        with refused(-200452):
            task.ai_channels[0].ai_dither_enable = True
        with refused(-200452):
            task.ci_channels.add_ci_freq_chan("Dev1/ctr0")


# ---- inputs and the plant ----


def test_recorded_samples_are_those_of_the_exact_motion_to_half_a_bit(bench: Bench) -> None:
    # reference: the exact flow of examples/rig/oscillator_scene.toml from where the plant is
    before = bench.control.truth()
    with bench.outputs() as drive, bench.inputs("Dev1/ai0:1", 5000.0, samps_per_chan=400) as task:
        drive.write(1.0)
        data = np.array(task.read(400))
    volts = np.round(1.0 / BITS_16) * BITS_16
    body, start = Oscillator(0.092, 0.6, 100.0), (before["displacement"], before["velocity"])
    found = [flow(body, start, 1e-5 + k / 5000.0, held=0.1 * volts / 0.092) for k in range(400)]
    for row, gain, values in zip(data, (1000.0, 10.0), np.transpose(found), strict=True):
        assert np.max(np.abs(row - gain * values)) <= 0.51 * BITS_16


def test_all_ways_to_read_give_the_same_samples(bench: Bench) -> None:
    from nidaqmx.stream_readers import AnalogMultiChannelReader

    with bench.inputs("Dev1/ai0:1", 1000.0, sample_mode=CONTINUOUS) as task:
        task.start()
        codes = np.zeros((2, 50), dtype=np.int16)
        task._interpreter.read_binary_i16(task._handle, 50, 10.0, 0, codes)
        raw = task.in_stream.read(50)
        assert raw.dtype == np.int16
        assert raw.size == 100
        doubles = np.zeros((2, 50))
        assert AnalogMultiChannelReader(task.in_stream).read_many_sample(doubles, 50) == 50
        steps = doubles / BITS_16
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
        assert np.max(np.abs(np.diff(np.concatenate([codes[0], raw[::2], steps[0]])))) < 2**12


def test_a_read_may_be_larger_than_the_buffer(bench: Bench) -> None:
    with bench.inputs("Dev1/ai2", 2000.0, sample_mode=CONTINUOUS) as task:
        task.in_stream.input_buf_size = 100
        assert len(task.read(1000)) == 1000


def test_large_reads_come_through(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0:7", 100_000.0, sample_mode=CONTINUOUS) as task:
        assert np.shape(task.read(80_000)) == (8, 80_000)


def test_samples_that_are_late_are_said_with_what_is_there(bench: Bench) -> None:
    bench.control.pace(lockstep=False)
    with bench.inputs("Dev1/ai0", 1000.0, sample_mode=CONTINUOUS) as task:
        task.start()
        with refused(-200284) as caught:
            task.read(5000, timeout=0.1)
        assert 0 < caught.value.samps_per_chan_read < 1000


def test_a_program_that_reads_too_late_loses_samples_and_hears_it(bench: Bench) -> None:
    bench.control.pace(lockstep=False)
    with bench.inputs("Dev1/ai0", 100_000.0, sample_mode=CONTINUOUS) as task:
        task.in_stream.input_buf_size = 1000
        task.start()
        time.sleep(0.1)
        with refused(-200279):
            task.read(100)


def test_a_finite_task_is_done_and_has_no_more(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=100) as task:
        task.start()
        assert not task.is_task_done()
        task.wait_until_done()
        assert task.is_task_done()
        assert len(task.read(100)) == 100
        with refused(-200278):
            task.read(1)


def test_a_task_without_a_clock_reads_at_once(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0:1") as task:
        assert len(task.read()) == 2
        assert len(task.read(3)[0]) == 3
        task.start()
        task.wait_until_done(0.0)


def test_a_rig_that_nobody_has_used_for_a_year_answers_at_once(bench: Bench) -> None:
    for _ in range(32):
        bench.control.advance(1e6)
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=100) as task:
        assert len(task.read(100)) == 100


# ---- outputs ----


def test_a_loop_from_output_to_input_gives_back_what_was_written(bench: Bench) -> None:
    wave = 3.0 * np.sin(2.0 * np.pi * np.arange(200) / 200.0)
    with (
        bench.outputs(rate=2000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 2000.0, source="/Dev1/ao/SampleClock", samps_per_chan=500) as task,
    ):
        assert drive.write(wave) == 200
        task.start()
        drive.start()
        seen = np.array(task.read(500))
    # an edge samples what was put out before it
    np.testing.assert_allclose(seen[1:], np.tile(wave, 3)[:499], atol=BITS_16)
    assert bench.control.truth()["outputs"][0] != 0.0  # an output holds its last value


def test_an_input_inside_the_device_measures_an_output(bench: Bench) -> None:
    with bench.outputs("Dev1/ao1") as drive, bench.inputs("Dev1/_ao1_vs_aognd") as task:
        drive.write([1.0, 2.0, 3.0], auto_start=True)
        assert task.read() == pytest.approx(3.0, abs=BITS_16)
        assert task.ai_channels[0].physical_channel.name == "Dev1/_ao1_vs_aognd"
        with refused(-200170):
            task.ai_channels.add_ai_voltage_chan("Dev1/_ao2_vs_aognd")
        with refused(-200170):
            bench.outputs("Dev1/_ao0_vs_aognd")


def test_an_output_without_regeneration_streams_any_length(bench: Bench) -> None:
    wave = np.linspace(-1.0, 1.0, 5000)
    with bench.outputs(rate=10_000.0, sample_mode=CONTINUOUS) as drive:
        drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
        drive.out_stream.output_buf_size = 1000
        with bench.inputs("Dev1/ai2", 10_000.0, source="/Dev1/ao/SampleClock", samps_per_chan=4000) as task:
            drive.write(wave[:1000])
            task.start()
            drive.start()
            for begin in range(1000, 5000, 500):
                assert drive.write(wave[begin : begin + 500]) == 500
            seen = np.array(task.read(4000))
    np.testing.assert_allclose(seen[1:], wave[:3999], atol=BITS_16)


def test_an_output_that_runs_empty_says_so_when_written_to_and_when_stopped(bench: Bench) -> None:
    bench.control.pace(lockstep=False)
    drive = bench.outputs(rate=10_000.0, sample_mode=CONTINUOUS)
    drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
    drive.write(np.ones(100))
    drive.start()
    time.sleep(0.1)
    with refused(-200290):
        drive.write(np.ones(100))
    with refused(-200290):
        drive.stop()
    drive.close()
    assert bench.control.truth()["outputs"][0] == pytest.approx(1.0, abs=BITS_16)


@pytest.mark.parametrize("value", [np.nan, np.inf, 10.5])
def test_no_number_and_no_voltage_out_of_range_reaches_an_output(bench: Bench, value: float) -> None:
    with bench.outputs() as drive, refused(-200561):
        drive.write(value)
    assert bench.control.truth()["outputs"] == [0.0, 0.0]


# ---- triggers and events ----


def test_an_edge_on_a_terminal_starts_a_task(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=10) as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI0")
        task.start()
        bench.control.advance(1.0)
        assert task.in_stream.avail_samp_per_chan == 0
        assert bench.control.pulse("/Dev1/PFI0") == 1
        assert len(task.read(10)) == 10


def test_an_input_that_waits_for_an_output_starts_with_it(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 2000.0, samps_per_chan=21) as task,
    ):
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/ao/StartTrigger")
        drive.write(np.arange(1.0, 9.0))
        task.start()
        bench.control.advance(0.5)
        drive.start()
        seen = np.array(task.read(21))
    np.testing.assert_allclose(seen[1:5], [1.0, 1.0, 2.0, 2.0], atol=BITS_16)


def test_an_input_on_the_clock_of_an_output_waits_for_it(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=9) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.start()
        bench.control.advance(0.5)
        assert task.in_stream.avail_samp_per_chan == 0
        drive.start()
        np.testing.assert_allclose(task.read(9)[1:], np.arange(1.0, 9.0), atol=BITS_16)


def test_an_input_may_wait_for_an_edge_and_for_the_clock_of_an_output(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=9) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI3")
        task.start()
        drive.start()
        bench.control.advance(0.0985)
        assert task.in_stream.avail_samp_per_chan == 0
        bench.control.pulse("/Dev1/PFI3")
        seen = task.read(9)
    # 99 edges are over: the next is the fourth of its round
    np.testing.assert_allclose(seen, [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 1.0, 2.0, 3.0], atol=BITS_16)


def test_an_input_that_waits_for_the_start_of_an_output_has_its_clock_too(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=9) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/ao/StartTrigger")
        task.start()
        drive.start()
        np.testing.assert_allclose(task.read(9)[1:], np.arange(1.0, 9.0), atol=BITS_16)


def test_an_input_goes_on_when_the_clock_of_its_output_does(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, samps_per_chan=8) as drive,
        bench.inputs("Dev1/ai2", 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=16) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.start()
        for _ in range(2):
            drive.start()
            drive.wait_until_done()
            drive.stop()
            drive.write(np.arange(1.0, 9.0))
        seen = task.read(16)
    np.testing.assert_allclose(seen[1:8], np.arange(1.0, 8.0), atol=BITS_16)
    np.testing.assert_allclose(seen[9:], np.arange(1.0, 8.0), atol=BITS_16)


def test_events_come_every_so_many_samples_and_at_the_end(bench: Bench) -> None:
    heard, over = [], threading.Event()
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=1000) as task:
        task.register_every_n_samples_acquired_into_buffer_event(100, lambda *said: heard.append(said) or 0)
        task.register_done_event(lambda *said: over.set() or 0)
        task.start()
        task.wait_until_done()
        assert over.wait(5.0)
        deadline = time.monotonic() + 5.0
        while len(heard) < 10 and time.monotonic() < deadline:
            time.sleep(0.01)
        task.stop()
        task.register_done_event(None)
        task.register_every_n_samples_acquired_into_buffer_event(100, None)
    assert len(heard) == 10


# ---- what is refused ----


def test_what_the_device_does_not_have_is_refused_by_its_code(bench: Bench) -> None:
    with bench.task() as task:
        with refused(-200220):
            task.ai_channels.add_ai_voltage_chan("Dev9/ai0")
        with refused(-200170):
            task.ai_channels.add_ai_voltage_chan("Dev1/ai8")
        with refused(-200077):
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-50, max_val=50)
        with refused(-200478):
            task.start()
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-5, max_val=5)
        with refused(-200011):
            task.ao_channels.add_ao_voltage_chan("Dev1/ao0")


@pytest.mark.parametrize(
    ("code", "timing"),
    [
        (-200077, {"rate": 2e6}),
        (-200077, {"rate": 0.0}),
        (-200077, {"rate": 1000.0, "samps_per_chan": 1}),
        (-89120, {"rate": 1000.0, "source": "/Dev1/PFI99"}),
    ],
)
def test_a_clock_that_the_device_lacks_is_refused_when_the_task_is_verified(
    bench: Bench, code: int, timing: dict[str, Any]
) -> None:
    # NI's driver takes any clock, and says at the first look at it what is wrong
    with bench.inputs() as task:
        task.timing.cfg_samp_clk_timing(**timing)
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
        assert task.triggers.start_trigger.dig_edge_src == "/Dev1/PFI0"
        with refused(-200262):
            task.start()
        task.timing.cfg_samp_clk_timing(1000.0)
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev2/PFI0")
        with refused(-89120):
            task.start()


def test_one_name_for_several_channels_is_numbered(bench: Bench) -> None:
    with bench.task() as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0:2", "tip", min_val=-5, max_val=5)
        assert task.channel_names == ["tip0", "tip1", "tip2"]
        assert task.ai_channels["tip0:1"].ai_rng_high == 5.0
        with refused(-200461):
            task.ai_channels.add_ai_voltage_chan("Dev1/ai3:5", "a, b")
        with refused(-200489):
            task.ai_channels.add_ai_voltage_chan("Dev1/ai3:4", "new, tip0")
        assert len(task.channel_names) == 3  # all of a list or none


def test_a_read_of_more_than_a_finite_task_has_returns_what_is_left(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=100) as task:
        task.start()
        assert len(task.read(60)) == 60
        assert len(task.read(60)) == 40


def test_a_read_may_begin_at_the_newest_sample(bench: Bench) -> None:
    wave = np.arange(1.0, 9.0)
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs("Dev1/ai2", 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=101) as task,
    ):
        drive.write(wave)
        task.start()
        drive.start()
        task.wait_until_done()
        task.in_stream.relative_to = constants.ReadRelativeTo.MOST_RECENT_SAMPLE
        task.in_stream.offset = -3
        np.testing.assert_allclose(task.read(3), [2.0, 3.0, 4.0], atol=BITS_16)
        task.in_stream.relative_to = constants.ReadRelativeTo.FIRST_SAMPLE
        task.in_stream.offset = 1
        np.testing.assert_allclose(task.read(3), [1.0, 2.0, 3.0], atol=BITS_16)


def test_a_program_may_let_unread_samples_be_written_over(bench: Bench) -> None:
    bench.control.pace(lockstep=False, speed=100.0)
    with bench.inputs("Dev1/ai0", 10_000.0, sample_mode=CONTINUOUS) as task:
        task.in_stream.input_buf_size = 1000
        task.in_stream.overwrite = constants.OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        task.start()
        bench.wait_until(lambda: task.in_stream.total_samp_per_chan_acquired > 5000)
        with refused(-200279):
            task.read(100)
        task.in_stream.relative_to = constants.ReadRelativeTo.MOST_RECENT_SAMPLE
        task.in_stream.offset = -100
        assert len(task.read(100)) == 100


def test_codes_are_read_and_written_as_numbers_of_any_width(bench: Bench) -> None:
    from nidaqmx.stream_readers import AnalogUnscaledReader
    from nidaqmx.stream_writers import AnalogUnscaledWriter

    code = 2**13
    for width in (np.int16, np.uint16, np.int32, np.uint32):
        with bench.outputs() as drive, bench.inputs("Dev1/ai2") as task:
            writer = AnalogUnscaledWriter(drive.out_stream, auto_start=True)
            name = np.dtype(width).name
            if hasattr(writer, f"write_{name}"):
                getattr(writer, f"write_{name}")(np.full((1, 1), code, dtype=width))
            else:
                drive.write(code * BITS_16)
            seen = np.zeros((1, 2), dtype=width)
            getattr(AnalogUnscaledReader(task.in_stream), f"read_{name}")(seen, 2)
        assert seen.tolist() == [[code, code]]


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
        drive.ao_channels.add_ao_voltage_chan("Dev1/ao0")
        drive.write(2.0)
        with pytest.raises(DaqError, match="-200089"):
            nidaqmx.Task("drive", grpc_options=bench.options("drive", initialization_behavior=create))
        with open_channel(bench.server.address) as channel:
            other = nidaqmx.GrpcSessionOptions(channel, "drive", initialization_behavior=attach)
            with nidaqmx.Task("drive", grpc_options=other) as same:
                same.write(0.0)
        assert bench.control.truth()["outputs"] == [0.0, 0.0]
        assert drive.channel_names == ["Dev1/ao0"]
    with pytest.raises(DaqError, match="-200088"):
        nidaqmx.Task("drive", grpc_options=bench.options("drive", initialization_behavior=attach))


def constants_of(behaviour: str) -> Any:
    from nidaqmx.grpc_session_options import SessionInitializationBehavior

    return SessionInitializationBehavior[behaviour]


# ---- another device, another plant ----


def test_a_lab_pc_samples_one_input_after_the_other() -> None:
    settings = read_rig(ROOT / "examples" / "rig" / "beam.toml")
    with served(settings) as server, open_channel(server.address) as channel:
        bench = Bench(server, channel)
        bench.control.pace(lockstep=True)
        with bench.task() as task:
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0:2", min_val=-5, max_val=5)
            task.timing.cfg_samp_clk_timing(30_000.0)
            with refused(-200077):
                task.start()
            with bench.task() as other:
                other.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-5, max_val=5)
                other.timing.cfg_samp_clk_timing(60_000.0)
                other.ai_channels.add_ai_voltage_chan("Dev1/ai1", min_val=-5, max_val=5)
                with refused(-200077):
                    other.start()
            task.timing.cfg_samp_clk_timing(10_000.0, samps_per_chan=2000)
            with bench.task() as drive:
                drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
                drive.write(3.0)
                displacement, _, loop = np.array(task.read(2000))
    step = 5.0 / 2**11
    assert np.max(np.abs(displacement)) > 50 * step
    np.testing.assert_allclose(loop, 3.0, atol=4 * step)  # noise of 1 mV


def test_inputs_of_a_lab_pc_see_one_signal_12_us_later_each(tmp_path: Path) -> None:
    scene = (ROOT / "examples" / "rig" / "oscillator_scene.toml").as_posix()
    file = tmp_path / "rig.toml"
    wires = "".join(f'ai{place} = "sensor.displacement"\n' for place in range(8))
    file.write_text(
        f'[rig]\nscene = "{scene}"\ndevice = "labpc+"\n[wiring]\nao0 = "exciter"\n{wires}', encoding="utf-8"
    )
    with served(read_rig(file)) as server, open_channel(server.address) as channel:
        bench = Bench(server, channel)
        bench.control.pace(lockstep=True)
        with bench.task() as drive, bench.task() as task:
            drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
            drive.write(2.0)
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0:7", min_val=-5, max_val=5)
            task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=150)
            first, *_, last = np.array(task.read(150))
    shift = np.sum((last - first) * np.gradient(first, 1e-3)) / np.sum(np.gradient(first, 1e-3) ** 2)
    assert shift == pytest.approx(7 * 12e-6, rel=0.05)


def test_a_scan_of_a_lab_pc_is_the_same_when_time_stops_in_the_middle_of_it() -> None:
    def displacements(steps: int) -> Any:
        with opened_bench(ROOT / "examples" / "rig" / "beam.toml") as bench, bench.task() as task:
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0:1", min_val=-5, max_val=5)
            task.timing.cfg_samp_clk_timing(10_000.0, samps_per_chan=100)
            with bench.task() as drive:
                drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
                drive.write(5.0)
            task.start()
            for _ in range(steps):
                bench.control.advance(3e-6)
            return task.read(100)

    assert np.ptp(displacements(0)[1]) > 0.0
    np.testing.assert_array_equal(displacements(100), displacements(0))


def test_a_device_that_is_gone_ends_the_read_that_waits_and_is_said_from_then_on() -> None:
    settings = read_rig(ROOT / "examples" / "rig" / "oscillator.toml")
    with served(settings) as server, open_channel(server.address) as channel:
        bench = Bench(server, channel)
        task = bench.inputs("Dev1/ai0", 1000.0, sample_mode=CONTINUOUS)
        task.start()
        threading.Timer(0.1, bench.control.lose).start()
        with refused(-201003) as caught:
            task.read(100_000, timeout=10.0)
        assert caught.value.samps_per_chan_read < 1000
        with refused(-201003):
            bench.outputs().write(1.0)
        with pytest.raises(UsageError, match="The device does not answer: Dev1"):
            bench.control.truth()
        task.close()


def test_every_call_of_the_protocol_is_answered_or_refused_in_words(bench: Bench) -> None:
    # no call may end in UNIMPLEMENTED (the client then speaks of an upgrade) or in an exception of the server
    metadata = {}
    for name, method in METHODS.items():
        call = bench.channel.unary_stream if method.server_streaming else bench.channel.unary_unary
        try:
            answer = call(f"/nidaqmx_grpc.NiDAQmx/{name}")(b"", timeout=5.0)
            list(answer) if method.server_streaming else None
        except grpc.RpcError as error:
            metadata[name] = dict(error.trailing_metadata() or ())
    assert set(METHODS) - set(metadata) == {"CreateTask", "GetErrorString"}
    assert [name for name, said in metadata.items() if int(said.get("ni-error", 0)) > -1000] == []
