"""Properties of the virtual rig alone: its plant, its numbers, a lost device, all calls of the protocol."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.places import ROOT
from support.rig_bench import BITS_16, CONTINUOUS, Bench, opened_bench, refused

from vibroimpact.fmus.core import Oscillator, flow
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.daqmx import METHODS, DaqError, System, constants, grpc, message_class, open_channel
from vibroimpact.hardware.rig.opening import refusal_of
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig


@pytest.fixture(scope="module")
def rig() -> Iterator[Bench]:
    with opened_bench(ROOT / "examples" / "rig" / "oscillator.toml") as opened:
        yield opened


@pytest.fixture
def bench(rig: Bench) -> Iterator[Bench]:
    rig.as_it_waits()
    yield rig
    rig.clear()


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


def test_only_ranges_of_the_device_can_be_chosen(bench: Bench) -> None:
    with bench.task() as task:
        channel = task.ai_channels.add_ai_voltage_chan("Dev1/ai1", "tip", min_val=-1.5, max_val=0.3)
        assert (channel.ai_rng_high, channel.ai_max) == (2.0, 2.0)
        with refused(-200077):
            channel.ai_rng_high = 3.0


def test_an_attribute_that_is_not_modelled_is_refused(bench: Bench) -> None:
    with bench.inputs() as task:
        with refused(-200452):
            _ = task.ai_channels[0].ai_lowpass_enable
        with refused(-200452):
            task.ai_channels[0].ai_dither_enable = True
        with refused(-200452):
            task.ci_channels.add_ci_freq_chan("Dev1/ctr0")


def test_recorded_samples_are_those_of_the_exact_motion_to_half_a_bit(bench: Bench) -> None:
    # reference: the exact flow of examples/rig/oscillator_scene.toml from the present state of the plant
    before = bench.control.truth()
    with bench.outputs() as drive, bench.inputs("Dev1/ai0:1", 5000.0, samps_per_chan=400) as task:
        drive.write(1.0)
        data = np.array(task.read(400))
    volts = np.round(1.0 / BITS_16) * BITS_16
    body, start = Oscillator(0.092, 0.6, 100.0), (before["displacement"], before["velocity"])
    found = [flow(body, start, 1e-5 + k / 5000.0, held=0.1 * volts / 0.092) for k in range(400)]
    for row, gain, values in zip(data, (1000.0, 10.0), np.transpose(found), strict=True):
        assert np.max(np.abs(row - gain * values)) <= 0.51 * BITS_16


def test_a_rig_that_nobody_has_used_for_a_year_answers_at_once(bench: Bench) -> None:
    for _ in range(32):
        bench.control.advance(1e6)
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=100) as task:
        assert len(task.read(100)) == 100


def test_one_name_for_several_channels_is_numbered(bench: Bench) -> None:
    with bench.task() as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0:2", "tip", min_val=-5, max_val=5)
        assert task.channel_names == ["tip0", "tip1", "tip2"]
        assert task.ai_channels["tip0:1"].ai_rng_high == 5.0
        with refused(-200461):
            task.ai_channels.add_ai_voltage_chan("Dev1/ai3:5", "a, b")
        with refused(-200489):
            task.ai_channels.add_ai_voltage_chan("Dev1/ai3:4", "new, tip0")
        assert len(task.channel_names) == 3  # all channels of a list or none


def test_an_input_has_no_more_samples_than_the_clock_of_a_finite_output_has_edges(bench: Bench) -> None:
    with (
        bench.outputs(rate=1000.0, samps_per_chan=8) as drive,
        bench.inputs("Dev1/ai2", 1000.0, source="/Dev1/ao/SampleClock", samps_per_chan=16) as task,
    ):
        drive.write(np.arange(1.0, 9.0))
        task.start()
        drive.start()
        bench.control.advance(0.1)
        assert task.in_stream.avail_samp_per_chan == 8


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
    # no call may end in UNIMPLEMENTED (the client then suggests an upgrade) or in an exception of the server
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


def status_of_stop(task: Any) -> int:
    """Return the status with which the server stops a task: NI's client drops it."""
    request = message_class(METHODS["StopTask"].input_type)(task=task._handle)
    return int(task._interpreter._client.StopTask(request).status)


def test_a_finite_task_that_is_stopped_early_is_warned_of_and_one_that_is_done_is_not(bench: Bench) -> None:
    with bench.inputs("Dev1/ai0", 1000.0, samps_per_chan=100) as task:
        task.start()
        assert status_of_stop(task) == 200010
        task.start()
        assert len(task.read(100)) == 100
        assert status_of_stop(task) == 0
    with bench.inputs("Dev1/ai0", 1000.0, sample_mode=CONTINUOUS) as task:
        task.start()
        assert status_of_stop(task) == 0


@pytest.mark.parametrize(
    ("asked", "given"),
    [(44_100.0, 100e6 / 2268), (60_000.0, 100e6 / 1667), (5000.0, 5000.0), (1_000_000.0, 1_000_000.0)],
)
def test_sample_clocks_are_whole_fractions_of_the_timebase(bench: Bench, asked: float, given: float) -> None:
    with bench.inputs("Dev1/ai0", asked, samps_per_chan=1000) as task:
        assert task.timing.samp_clk_rate == given
        before = bench.control.state()["time"]
        task.read(1000)
        # the last of 1000 samples comes 999 intervals after the first
        assert bench.control.state()["time"] - before == pytest.approx(999 / given, abs=3e-4)


def test_a_rate_is_never_rounded_above_the_highest(bench: Bench) -> None:
    with bench.task() as task:
        task.ao_channels.add_ao_voltage_chan("Dev1/ao0")
        task.timing.cfg_samp_clk_timing(900_000.0)
        assert task.timing.samp_clk_rate == 100e6 / 112


def test_reset_device_ends_tasks_that_have_failed_without_saying_so_again(bench: Bench) -> None:
    with bench.task() as drive, bench.inputs("Dev1/ai0", 1000.0, sample_mode=CONTINUOUS) as task:
        drive.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5, max_val=5)
        drive.timing.cfg_samp_clk_timing(1000.0, sample_mode=CONTINUOUS)
        drive.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
        drive.write(np.full(1000, 2.0))
        drive.start()
        task.start()
        bench.control.advance(0.2)
        assert bench.control.starve() == 1
        System.remote(bench.options()).devices["Dev1"].reset_device()
        assert bench.control.truth()["outputs"][0] == 0.0
        # no task holds the inputs any more
        with bench.inputs("Dev1/ai1", 1000.0, samps_per_chan=10) as other:
            assert len(other.read(10)) == 10


def test_a_refusal_of_what_is_reserved_names_who_holds_which_channels(bench: Bench) -> None:
    with bench.task("first") as first, bench.inputs("Dev1/ai1", 1000.0) as second:
        first.ai_channels.add_ai_voltage_chan("Dev1/ai0, Dev1/ai3", min_val=-10, max_val=10)
        first.timing.cfg_samp_clk_timing(1000.0, sample_mode=CONTINUOUS)
        first.start()
        with pytest.raises(DaqError, match=r"by task 'first', which runs \(Dev1/ai0, Dev1/ai3\)") as refusal:
            second.start()
        said = str(refusal_of("grpc://rig", refusal.value))
        assert "\n" not in said
        assert "A program that died leaves its task on the device" in said
