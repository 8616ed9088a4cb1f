"""A command with a missing facility around it works, or prints one true line and ends with exit code 2."""

import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
from support.command_line import in_this_process
from support.places import EXAMPLES

from vibroimpact.fmus import surroundings
from vibroimpact.orchestrator.commands import cli

resource = pytest.importorskip("resource")
COMMAND = str(Path(sys.executable).with_name("vibroimpact"))
SCENE = EXAMPLES / "bifurcation.toml"
PATIENCE = 300.0
"""Many times the duration of a command of this module, s: the machine may be busy."""


def command(*words: str | Path, before: Callable[[], None] | None = None) -> subprocess.CompletedProcess[str]:
    """Run the installed command as a user does."""
    return subprocess.run(
        [COMMAND, *map(str, words)], preexec_fn=before, capture_output=True, text=True, timeout=PATIENCE
    )


@pytest.fixture
def removed(tmp_path: Path) -> Callable[[], None]:
    """Return a function that puts a process into a folder and then removes the folder."""
    folder = tmp_path / "removed"
    folder.mkdir()

    def stand_in_it() -> None:
        os.chdir(folder)
        folder.rmdir()

    return stand_in_it


def test_a_campaign_of_absolute_paths_needs_no_current_folder(
    removed: Callable[[], None], tmp_path: Path
) -> None:
    done = command(
        "campaign", SCENE, "-o", tmp_path / "out", "--workers", "1", "--set",
        'sweep={"forcing.angular_frequency"={values=[0.8,0.9]}}', before=removed,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "dataset.nc").exists()


def test_a_relative_path_without_a_current_folder_is_said_in_one_line(removed: Callable[[], None]) -> None:
    done = command("campaign", SCENE, "-o", "out", "--workers", "1", before=removed)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "current folder: expected one that exists, got one that was removed. "
        "Change to another, or give absolute paths."
    ]


def test_a_campaign_with_few_descriptors_says_so_before_it_starts_a_worker(tmp_path: Path) -> None:
    done = command(
        "campaign", SCENE, "-o", tmp_path / "out", "--workers", "2",
        before=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (24, 24)),
    )  # fmt: skip
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert line.startswith("this machine: expected 56 files that may be opened for 2 workers, got ")
    assert line.endswith("Raise the limit (`ulimit -n 1024`), or ask for fewer workers with --workers.")


RIG = EXAMPLES / "rig" / "oscillator.toml"


def recording_of_a_rig(target: Path) -> tuple[str | Path, ...]:
    inputs = ("--channel", "tip=Dev1/ai0,5", "--rate", "5000", "--duration", "0.1")
    return "rig", "record", "--rig", f"virtual:{RIG}", *inputs, "-o", target


@pytest.mark.parametrize(
    ("words", "purpose"),
    [
        (("campaign", SCENE, "--workers", "1", "-o", "out"), "workers are reached"),
        (("serve", "--data", "service"), "the service and its jobs are reached"),
        (("rig", "serve", RIG, "--port", "0"), "a virtual rig is reached"),
        (recording_of_a_rig(Path("record.nc")), "a virtual rig is reached"),
    ],
    ids=["campaign", "serve", "rig serve", "rig record"],
)
def test_what_needs_loopback_says_so_before_it_starts_anything(
    words: tuple[str | Path, ...], purpose: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # an address reserved for documentation (RFC 5737) belongs to no machine
    monkeypatch.setattr(surroundings, "LOOPBACK", "192.0.2.1")
    monkeypatch.chdir(tmp_path)
    done = in_this_process(*words)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert line.startswith(f"this machine: expected 192.0.2.1 to answer, over which {purpose}, got ")


def test_a_virtual_rig_with_few_descriptors_says_so(tmp_path: Path) -> None:
    """gRPC said "Error in service handler!" with 12 descriptors, and aborted with 6."""
    done = command(
        *recording_of_a_rig(tmp_path / "record.nc"),
        before=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (12, 12)),
    )
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2
    assert line.startswith("this machine: expected 16 files that may be opened for a virtual rig, got ")


def test_a_rig_records_to_an_absolute_path_without_a_current_folder(
    removed: Callable[[], None], tmp_path: Path
) -> None:
    done = command(*recording_of_a_rig(tmp_path / "record.nc"), before=removed)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_a_process_of_its_own_finds_the_folder_that_it_is_started_in(removed: Callable[[], None]) -> None:
    """`accuracy` showed a traceback: the folder was gone before the process that measures memory started in it."""
    program = "from vibroimpact.fmus.processes.call import call_alone; print(call_alone(abs, -3))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", program],
        preexec_fn=removed,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "3\n", "")


def test_a_campaign_that_a_signal_ends_leaves_no_line_of_the_resource_tracker(tmp_path: Path) -> None:
    said = tmp_path / "said"
    with said.open("w") as file:
        process = subprocess.Popen(
            [COMMAND, "campaign", str(SCENE), "-o", str(tmp_path / "out"), "--workers", "1"],
            stdout=subprocess.DEVNULL, stderr=file, start_new_session=True,
        )  # fmt: skip
        _wait_until(lambda: bool(_trackers(process.pid)) and (tmp_path / "out" / "campaign.json").exists())
        trackers = _trackers(process.pid)
        process.send_signal(signal.SIGTERM)
        process.wait(PATIENCE)
    _wait_until(lambda: not any(Path("/proc", one).exists() for one in trackers))
    assert "resource_tracker" not in said.read_text()


def _trackers(session: int) -> list[str]:
    """Return the ids of the resource trackers in a session."""
    found = []
    for one in Path("/proc").glob("[0-9]*"):
        try:
            words = (one / "cmdline").read_bytes()
            if b"resource_tracker" in words and os.getsid(int(one.name)) == session:
                found.append(one.name)
        except OSError:
            continue
    if not Path("/proc/self/cmdline").exists():
        pytest.skip("processes cannot be looked up here")
    return found


def _wait_until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_warning_of_a_library_is_shown_to_nobody_who_did_not_ask_for_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with warnings.catch_warnings():
        warnings.resetwarnings()
        with cli._no_library_warns():
            warnings.warn("ks_2samp: Exact calculation unsuccessful", RuntimeWarning, stacklevel=1)
    assert capsys.readouterr().err == ""
    with cli._no_library_warns(), pytest.raises(RuntimeWarning):  # in tests, warnings are errors
        warnings.warn("ks_2samp: Exact calculation unsuccessful", RuntimeWarning, stacklevel=1)
