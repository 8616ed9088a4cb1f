"""The unmodified client of NI on a rig: normal use of voltage tasks, and the required refusals.

On the virtual rig in lockstep, or with `--real-rig` on a board; a board skips tests that need the plant or its
control.
"""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from support.rig_bench import BITS_16, CONTINUOUS, Bench, refused

from vibroimpact.hardware.daqmx import constants

# ---- queries ----


def test_the_system_has_the_device_with_its_channels_and_ranges(bench: Bench) -> None:
    system = bench.system()
    assert bench.device in system.devices.device_names
    device = system.devices[bench.device]
    assert device.product_type
    assert device.ai_physical_chans.channel_names[0] == f"{bench.device}/ai0"
    assert device.ao_physical_chans.channel_names[0] == f"{bench.device}/ao0"
    low, high = device.ai_voltage_rngs[::2], device.ai_voltage_rngs[1::2]
    assert all(least < most for least, most in zip(low, high, strict=True))


def test_a_channel_has_the_smallest_range_that_holds_what_was_asked_for(bench: Bench) -> None:
    ranges = bench.system().devices[bench.device].ai_voltage_rngs
    with bench.task() as task:
        terminal = bench.named("Dev1/ai1")
        channel = task.ai_channels.add_ai_voltage_chan(terminal, "tip", min_val=-1.5, max_val=0.3)
        smallest = min(edge for edge in ranges if edge >= 1.5)
        assert (channel.name, channel.ai_rng_high) == ("tip", smallest)
        assert channel.ai_max >= smallest  # widened to a range of the device
        channel.ai_rng_high = max(ranges)
        assert channel.ai_rng_low == -max(ranges)
        assert task.channel_names == ["tip"]
        assert [device.name for device in task.devices] == [bench.device]


# ---- inputs ----


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
        assert np.max(np.abs(np.diff(np.concatenate([codes[0], raw[::2], steps[0]])))) < 2**12


def test_a_read_may_be_larger_than_the_buffer(bench: Bench) -> None:
    with bench.inputs(bench.loop, 2000.0, sample_mode=CONTINUOUS) as task:
        task.in_stream.input_buf_size = 100
        assert len(task.read(1000)) == 1000


def test_large_reads_come_through(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0:7", 100_000.0, sample_mode=CONTINUOUS) as task:
        assert np.shape(task.read(80_000)) == (8, 80_000)


def test_samples_that_are_late_are_said_with_what_is_there(bench: Bench) -> None:
    bench.as_in_life()
    with bench.inputs("Dev1/ai0", 1000.0, sample_mode=CONTINUOUS) as task:
        task.start()
        with refused(-200284) as caught:
            task.read(5000, timeout=0.1)
        assert 0 < caught.value.samps_per_chan_read < 1000


def test_a_program_that_reads_too_late_loses_samples_and_hears_it(bench: Bench) -> None:
    bench.as_in_life()
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


# ---- outputs ----


def test_a_loop_from_output_to_input_gives_back_what_was_written(bench: Bench) -> None:
    wave = 3.0 * np.sin(2.0 * np.pi * np.arange(200) / 200.0)
    with (
        bench.outputs(rate=2000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs(bench.loop, 2000.0, source="/Dev1/ao/SampleClock", samps_per_chan=500) as task,
    ):
        assert drive.write(wave) == 200
        task.start()
        drive.start()
        seen = np.array(task.read(500))
    # an edge samples the output value before it
    np.testing.assert_allclose(seen[1:], np.tile(wave, 3)[:499], atol=bench.tolerance)
    assert abs(bench.output(0)) > 0.05  # an output holds its last value


def test_an_input_inside_the_device_measures_an_output(bench: Bench) -> None:
    with bench.outputs("Dev1/ao1") as drive, bench.inputs("Dev1/_ao1_vs_aognd") as task:
        drive.write([1.0, 2.0, 3.0], auto_start=True)
        assert task.read() == pytest.approx(3.0, abs=bench.tolerance)
        assert task.ai_channels[0].physical_channel.name == bench.named("Dev1/_ao1_vs_aognd")
        with refused(-200170):
            task.ai_channels.add_ai_voltage_chan(bench.named("Dev1/_ao9_vs_aognd"))
        with refused(-200170):
            bench.outputs("Dev1/_ao0_vs_aognd")


def test_an_output_without_regeneration_streams_any_length(bench: Bench) -> None:
    wave = np.linspace(-1.0, 1.0, 5000)
    with bench.outputs(rate=10_000.0, sample_mode=CONTINUOUS) as drive:
        drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
        drive.out_stream.output_buf_size = 1000
        with bench.inputs(bench.loop, 10_000.0, source="/Dev1/ao/SampleClock", samps_per_chan=4000) as task:
            drive.write(wave[:1000])
            task.start()
            drive.start()
            for begin in range(1000, 5000, 500):
                assert drive.write(wave[begin : begin + 500]) == 500
            seen = np.array(task.read(4000))
    np.testing.assert_allclose(seen[1:], wave[:3999], atol=bench.tolerance)


def test_an_output_that_runs_empty_says_so_when_written_to_and_when_stopped(bench: Bench) -> None:
    bench.as_in_life()
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
    assert bench.output(0) == pytest.approx(1.0, abs=bench.tolerance)


@pytest.mark.parametrize("value", [np.nan, np.inf, 10.5])
def test_no_number_and_no_voltage_out_of_range_reaches_an_output(bench: Bench, value: float) -> None:
    with bench.outputs() as drive, refused(-200561):
        drive.write(value)
    assert bench.output(0) == pytest.approx(0.0, abs=bench.tolerance)


# ---- triggers and events ----


def test_an_edge_on_a_terminal_starts_a_task(bench: Bench) -> None:
    control = bench.control
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=10) as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig(bench.named("/Dev1/PFI0"))
        task.start()
        bench.pass_time(1.0)
        assert task.in_stream.avail_samp_per_chan == 0
        assert control.pulse("/Dev1/PFI0") == 1
        assert len(task.read(10)) == 10


def test_an_input_that_waits_for_an_output_starts_with_it(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs(bench.loop, 2000.0, samps_per_chan=21) as task,
    ):
        task.triggers.start_trigger.cfg_dig_edge_start_trig(bench.named("/Dev1/ao/StartTrigger"))
        drive.write(np.arange(1.0, 9.0))
        task.start()
        bench.pass_time(0.5)
        drive.start()
        seen = np.array(task.read(21))
    np.testing.assert_allclose(seen[1:5], [1.0, 1.0, 2.0, 2.0], atol=bench.tolerance)


def test_an_input_on_the_clock_of_an_output_waits_for_it(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs(bench.loop, 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=9) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.start()
        bench.pass_time(0.5)
        assert task.in_stream.avail_samp_per_chan == 0
        drive.start()
        np.testing.assert_allclose(task.read(9)[1:], np.arange(1.0, 9.0), atol=bench.tolerance)


def test_an_input_may_wait_for_an_edge_and_for_the_clock_of_an_output(bench: Bench) -> None:
    control = bench.control
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs(bench.loop, 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=9) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.triggers.start_trigger.cfg_dig_edge_start_trig(bench.named("/Dev1/PFI3"))
        task.start()
        drive.start()
        control.advance(0.0985)
        assert task.in_stream.avail_samp_per_chan == 0
        control.pulse("/Dev1/PFI3")
        seen = task.read(9)
    # 99 edges have passed: the next is the fourth of its round
    np.testing.assert_allclose(seen, [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 1.0, 2.0, 3.0], atol=bench.tolerance)


def test_an_input_that_waits_for_the_start_of_an_output_has_its_clock_too(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, sample_mode=CONTINUOUS) as drive,
        bench.inputs(bench.loop, 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=9) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.triggers.start_trigger.cfg_dig_edge_start_trig(bench.named("/Dev1/ao/StartTrigger"))
        task.start()
        drive.start()
        np.testing.assert_allclose(task.read(9)[1:], np.arange(1.0, 9.0), atol=bench.tolerance)


def test_an_input_goes_on_when_the_clock_of_its_output_does(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, samps_per_chan=8) as drive,
        bench.inputs(bench.loop, 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=16) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.start()
        for _ in range(2):
            drive.start()
            drive.wait_until_done()
            drive.stop()
            drive.write(np.arange(1.0, 9.0))
        seen = task.read(16)
    np.testing.assert_allclose(seen[1:8], np.arange(1.0, 8.0), atol=bench.tolerance)
    np.testing.assert_allclose(seen[9:], np.arange(1.0, 8.0), atol=bench.tolerance)


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
