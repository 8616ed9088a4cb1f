"""`vibroimpact rig sine` comes to rest in every case; an input that is wired to the output saw every sample.

Ctrl-C and SIGKILL at random moments are in `tests/soak/drives.py`.
"""

from __future__ import annotations

import inspect
import signal
import subprocess
import threading
import time
from collections.abc import Iterator

import psutil
import pytest
from harness import warm
from support.command_line import ENTRY, in_this_process
from support.driving import SECONDS, SINE, STEEPEST, driven
from support.places import ROOT
from support.rig_bench import Bench, opened_bench

import vibroimpact as vi
from vibroimpact.hardware.daqmx import constants, open_channel
from vibroimpact.hardware.rig.guarding import Guardian
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.output import Output
from vibroimpact.hardware.virtual_rig.control import RigControl

RIG = ROOT / "examples" / "rig" / "oscillator.toml"


@pytest.fixture(scope="module")
def served_bench() -> Iterator[Bench]:
    with opened_bench(RIG) as bench:
        yield bench


@pytest.fixture
def bench(served_bench: Bench) -> Iterator[Bench]:
    served_bench.control.pace(lockstep=True)
    yield served_bench
    served_bench.clear()


@pytest.fixture
def live(bench: Bench) -> Bench:
    """In its own time, as a board, at half real speed, so that concurrent tests starve no output."""
    bench.control.pace(lockstep=False, speed=0.5)
    return bench


def sine(bench: Bench, *more: str, output: str = "Dev1/ao0") -> subprocess.CompletedProcess[str]:
    words = ["--output", output, "--frequency", "5.3", "--amplitude", "2", "--ramp", "0.2"]
    return in_this_process("rig", "sine", "--rig", f"grpc://{bench.server.address}", *words, *more)


def guardians() -> list[int]:
    """Return the running guardians started by this process; a zombie, such as another test's, has ended."""
    running = [child for child in psutil.Process().children() if child.status() != psutil.STATUS_ZOMBIE]
    return [child.pid for child in running if "guardian" in " ".join(child.cmdline())]


def test_a_sine_of_a_duration_ends_at_rest(bench: Bench) -> None:
    done = sine(bench, "--duration", "2")
    assert (done.returncode, done.stderr) == (0, "")
    assert "5.3 Hz, 2 V" in done.stdout
    state = bench.control.state()
    assert state["time"] >= 2.0
    assert state["tasks"] == {}
    assert bench.control.truth()["outputs"] == [0.0, 0.0]
    assert guardians() == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--frequency", "nan"], "--frequency: expected a number > 0"),
        (["--amplitude", "nan"], "--amplitude: expected a number >= 0"),
        (["--amplitude", "6"], "got 6. Use a smaller one, or raise --most-amplitude if what"),
        (["--frequency", "400"], "Use smaller ones or a longer ramp, or raise --most-slew if what"),
        (["--most-slew", "nan"], "limits: slew: expected a number > 0"),
        (["--most-amplitude", "20"], "a range of -20 to 20 V"),
        (["--duration", "0.3"], "Use a longer duration, or a shorter --ramp."),
        (["--duration", "inf"], "--duration: expected a number > 0"),
        (["--rate", "2e6"], "a rate of 2e+06 Hz"),
        (
            ["--rate", "99"],
            "--rate: expected at least 100 Hz, so that the output comes to rest soon, got 99.0",
        ),
        (["--output", "Dev1/ao7"], "no such channel: Dev1/ao7"),
        (["--output", "Dev9/ao0"], "no such device: Dev9"),
        (["--output", "ao0"], "--output: expected an output such as Dev1/ao0"),
    ],
)
def test_what_cannot_be_driven_is_one_line_and_drives_nothing(
    bench: Bench, words: list[str], said: str
) -> None:
    done = sine(bench, *words)
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert bench.control.truth()["outputs"] == [0.0, 0.0]
    assert bench.control.state()["tasks"] == {}
    assert guardians() == []


def test_in_python_it_is_one_call(bench: Bench, capfd: pytest.CaptureFixture[str]) -> None:
    rig = f"grpc://{bench.server.address}"
    driven_for = vi.drive_sine("Dev1/ao0", 5.3, 2.0, ramp=0.2, duration=1.0, rig=rig, progress=False)
    assert driven_for >= 1.0
    assert capfd.readouterr() == ("", "")
    assert bench.control.truth()["outputs"] == [0.0, 0.0]
    with pytest.raises(vi.VibroimpactError, match="--amplitude: expected at most 5 V, got 6"):
        vi.drive_sine("Dev1/ao0", 5.3, 6.0, duration=2.0, rig=rig)
    assert bench.control.state()["tasks"] == {}
    assert guardians() == []


def test_the_defaults_in_python_are_those_of_the_limits() -> None:
    defaults = {name: one.default for name, one in inspect.signature(vi.drive_sine).parameters.items()}
    assert Limits(defaults["most_amplitude"], defaults["most_slew"]) == Limits()


def test_a_signal_before_the_start_drives_nothing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    ready, heard = Guardian.await_ready, threading.Event()
    stop = Output.stop

    def stopped(output: Output) -> None:
        stop(output)
        heard.set()

    def interrupted(guardian: Guardian) -> None:
        ready(guardian)
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
        assert heard.wait(SECONDS)

    monkeypatch.setattr(Output, "stop", stopped)
    monkeypatch.setattr(Guardian, "await_ready", interrupted)
    with pytest.raises(KeyboardInterrupt):
        vi.drive_sine("Dev1/ao0", 5.3, 2.0, ramp=0.2, rig=f"grpc://{bench.server.address}")
    assert capfd.readouterr().out == "Nothing was driven.\n"
    assert bench.control.state()["tasks"] == {}
    assert guardians() == []


def test_an_output_that_another_program_has_is_not_driven(bench: Bench) -> None:
    with bench.outputs(rate=1000.0) as other:
        other.control(constants.TaskMode.TASK_RESERVE)
        done = sine(bench)
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)
        assert "reserved" in done.stderr
        assert guardians() == []


def test_a_program_that_hangs_is_ended_and_its_output_brought_to_rest(live: Bench) -> None:
    with driven(live) as running:
        since = running.drive(0.3)
        running.program.send_signal(signal.SIGSTOP)
        code, _, err = running.ended()
        assert running.problem_at_rest() is None
    assert code == -signal.SIGKILL
    assert "showed no life for 2 s and was ended: its guardian has brought the output to 0 V" in err
    assert running.seen.steepest <= STEEPEST
    assert running.at_zero_after(since) > 0.5  # it held a voltage until then


def test_a_program_that_was_too_slow_says_so_and_comes_to_rest(live: Bench) -> None:
    with driven(live) as running:
        running.drive(0.3)
        running.program.send_signal(signal.SIGSTOP)
        running.drive(0.7)
        running.program.send_signal(signal.SIGCONT)
        code, _, err = running.ended()
        assert running.problem_at_rest() is None
    assert code == 1
    assert "Dev1/ao0 ran out of samples" in err
    assert err.count("\n") == 1
    assert running.seen.steepest <= STEEPEST


def test_a_program_whose_guardian_has_gone_comes_to_rest_by_itself(live: Bench) -> None:
    with driven(live) as running:
        running.drive(0.3)
        running.guardian.kill()
        code, _, err = running.ended()
        assert running.problem_at_rest() is None
    assert code == 1
    assert "guardian: its process has gone, so Dev1/ao0 was brought to 0 V." in err
    assert running.seen.steepest <= STEEPEST


@pytest.mark.long
def test_more_signals_do_not_hurry_it(live: Bench) -> None:
    with driven(live) as running:
        running.drive(0.3)
        for _ in range(4):
            running.program.send_signal(signal.SIGINT)
            time.sleep(0.02)
        code, _, _ = running.ended()
        assert running.problem_at_rest() is None
    assert code == 130
    assert running.seen.steepest <= STEEPEST
    assert not running.seen.volts[-1]


@pytest.fixture
def server() -> Iterator[tuple[warm.Program, str]]:
    with warm.start(ENTRY, "rig", "serve", RIG, "--port", "0", stderr=warm.DEVNULL) as process:
        assert process.stdout is not None
        yield process, process.stdout.readline().split("grpc://")[1].split(",")[0]
        process.kill()


@pytest.mark.parametrize("program_too", [True, pytest.param(False, marks=pytest.mark.long)])
def test_where_the_server_has_gone_nothing_is_claimed_of_the_output(
    server: tuple[warm.Program, str], program_too: bool
) -> None:
    process, address = server
    words = ("rig", "sine", "--rig", f"grpc://{address}", *SINE)
    with warm.start(ENTRY, *words) as program:
        assert program.stdout is not None
        program.stdout.readline()
        (guardian,) = psutil.Process(program.pid).children()
        with open_channel(address) as channel:
            assert RigControl(channel).state()["tasks"]
        if program_too:
            program.kill()
        process.kill()
        _, err = program.communicate(timeout=SECONDS)
        guardian.wait(SECONDS)
    assert err.count("\n") == 1
    assert "Nobody knows what it puts out: switch the amplifier off." in err
    assert "0 V" not in err
    assert program.returncode == (-signal.SIGKILL if program_too else 1)


def test_a_virtual_rig_of_its_own_goes_with_the_program() -> None:
    words = ("rig", "sine", "--rig", f"virtual:{RIG}", *SINE)
    with warm.start(ENTRY, *words) as program:
        assert program.stdout is not None
        assert "virtual:oscillator.toml" in program.stdout.readline()
        (guardian,) = psutil.Process(program.pid).children()
        program.kill()
        _, err = program.communicate(timeout=SECONDS)
        guardian.wait(SECONDS)
    assert "Nobody knows" in err


WITHOUT_ATTACHING = """
import sys
from vibroimpact.hardware.rig.limits import Limits
from vibroimpact.hardware.rig.opening import opened_rig
from vibroimpact.hardware.rig.output import Output
from vibroimpact.hardware.rig.waveforms import Sine
with opened_rig("grpc://" + sys.argv[1]) as rig:
    with Output(rig, "Dev1/ao0", 10000.0, Sine(5.3, 2.0, 10000.0, 0.2), Limits(), attach=False) as output:
        output.start()
        print("driving", flush=True)
        output.wait()
"""


@pytest.mark.parametrize("hanging", [False, pytest.param(True, marks=pytest.mark.long)])
def test_where_nobody_can_attach_the_guardian_waits_for_the_device(live: Bench, hanging: bool) -> None:
    # as with a driver in the program; there the driver ends the task, here the test does
    with warm.start(WITHOUT_ATTACHING, live.server.address) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "driving\n"
        (guardian,) = psutil.Process(program.pid).children()
        time.sleep(0.5)
        program.send_signal(signal.SIGSTOP if hanging else signal.SIGKILL)
        assert program.wait(SECONDS) == -signal.SIGKILL
        (task,) = [task for name, task in live.server.board.tasks.items() if name.startswith("vibroimpact")]
        held = live.control.truth()["outputs"][0]
        live.server.board.remove(task)
        guardian.wait(SECONDS)
        assert program.stderr is not None
        said = program.stderr.read()
    assert "its guardian has brought the output to 0 V" in said
    assert abs(held) <= 2.0
    assert live.control.truth()["outputs"][0] == 0.0
    assert live.control.state()["tasks"] == {}


@pytest.mark.long
def test_a_device_that_is_not_freed_is_said(live: Bench) -> None:
    with warm.start(WITHOUT_ATTACHING, live.server.address) as program:
        assert program.stdout is not None
        program.stdout.readline()
        program.kill()
        _, err = program.communicate(timeout=SECONDS)
    assert "reserved" in err
    assert "Nobody knows what it puts out: switch the amplifier off." in err


def test_the_defaults_of_the_options_are_those_of_the_limits() -> None:
    shown = in_this_process("rig", "sine", "--help").stdout
    limits = Limits()
    assert f"[default: {limits.amplitude}]" in shown
    assert f"[default: {limits.slew}]" in shown
    assert "Example: vibroimpact rig sine" in shown
