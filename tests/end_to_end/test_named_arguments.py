"""A message names an argument as the user gave it: `start` for a call in Python, `--from` for a command."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.command_line import in_this_process
from support.impact_records import THESIS, record_of
from support.places import EXAMPLES
from support.replay_scenes import BOARD
from support.spike_signals import channel, pulses

import vibroimpact as vi
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.processes.call import call
from vibroimpact.orchestrator.campaign import CampaignInterrupted, campaign
from vibroimpact.orchestrator.ssp import export_system
from vibroimpact.service.job_process import Work

SCENE = """
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.05
[forcing]
amplitude = 1.0
angular_frequency = 0.9
[[stop]]
position = 1.0
law = "restitution"
restitution = 0.7
[record]
transient_periods = 5
recorded_periods = 5
time_series = { rate = 20.0, variables = ["displacement"] }
"""
SWEEP = '[sweep]\n"stop[1].restitution" = { values = [0.5, 0.6] }\n'
PLAIN = "".join(f"{k / 100:.2f},{k % 7}\n" for k in range(90))
RATE = 20_000.0
DECAY_BEGINS = "the decay is taken from the largest excursion, at 10.98 s; {} sets it."
NO_UNIT = "no unit is known for column_2: pure numbers ({})"
IS_TIME = "the first column has no heading and ascends: it is taken as the instants ({})"


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder with scenes, runs and recordings."""
    monkeypatch.chdir(tmp_path)
    Path("one.toml").write_text(SCENE)
    Path("swept.toml").write_text(SCENE + SWEEP)
    Path("left.toml").write_text(SCENE.replace("restitution = 0.7\n", "") + SWEEP)
    Path("board.toml").write_text(BOARD)
    Path("plain.csv").write_text(PLAIN)
    Path("words.csv").write_text("no numbers\nin this file\n")
    Path("uneven.csv").write_text("a,b\n" + "".join(f"{k % 5},{k % 7}\n" for k in range(90)))
    return tmp_path


@pytest.fixture
def runs(files: Path) -> Path:
    vi.run("swept.toml", files / "runs.nc", progress=False)
    return files / "runs.nc"


@pytest.fixture
def force(files: Path) -> Path:
    """Return a recording of a force with spikes and without a period."""
    time = np.arange(int(0.5 * RATE)) / RATE
    values = pulses(time, np.array([0.05, 0.11, 0.23, 0.31, 0.42]), np.full(5, 2.0), 1e-3)
    values += 0.01 * np.random.default_rng(30).standard_normal(len(time))
    cell = channel(values, 1.0 / RATE)
    vi.write_recording(vi.Recording({cell.name: cell}), files / "force.nc")
    return files / "force.nc"


@pytest.fixture
def decay(files: Path) -> Path:
    """Return a recording of a free decay, whose largest excursion is not its first sample."""
    time = np.arange(0.0, 60.0, 0.01)
    swing = channel(np.exp(-0.02 * np.abs(time - 10.0)) * np.sin(time), 0.01, unit="m")
    vi.write_recording(vi.Recording({swing.name: swing}), files / "decay.nc")
    return files / "decay.nc"


def refusals(call: Callable[[], Any], *words: str | Path) -> tuple[str, str]:
    """Return the messages of one misuse: Python's error and the command's standard error."""
    with pytest.raises(VibroimpactError) as raised:
        call()
    done = in_this_process(*words)
    assert done.returncode == raised.value.exit_code, done.stderr
    return str(raised.value), done.stderr.removesuffix("\n")


def on_one_line(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize(
    ("call", "words", "said", "called", "typed"),
    [
        (
            lambda: vi.accuracy("one.toml", budget=2.0),
            ("accuracy", "one.toml", "--budget", "2"),
            "{}: expected a finite processor time of 10 s or more, got 2.0.",
            ("budget",),
            ("--budget",),
        ),
        (
            lambda: vi.hard_cases(only=["ripples"]),
            ("hard-cases", "--only", "ripples"),
            "{}: expected the name of a hard case, got 'ripples'. Did you mean ripple?",
            ("only",),
            ("--only",),
        ),
        (
            lambda: vi.campaign("swept.toml", "out", workers=1, scheduler="tcp://127.0.0.1:1"),
            ("campaign", "swept.toml", "-o", "out", "--workers", "1", "--scheduler", "tcp://127.0.0.1:1"),
            "{} and {}: expected one of them, got both. A scheduler has its own workers.",
            ("workers", "scheduler"),
            ("--workers", "--scheduler"),
        ),
        (
            lambda: vi.accuracy("left.toml"),
            ("accuracy", "left.toml"),
            "left.toml: stop[1].restitution: expected a value beside those of the sweep, which is left out here, got "
            "none. Add it to the scene, or give it: {}.",
            ('with_values({"sweep": {}, "stop[1].restitution": 0.5})',),
            ("--set 'sweep={}' --set 'stop[1].restitution=0.5'",),
        ),
        (
            lambda: vi.replay("board.toml", "a.nc", score="b.nc"),
            ("replay", "board.toml", "a.nc", "--score", "b.nc", "-o", "fit.nc"),
            "{}: expected {} beside it: a recording is scored with numbers fitted on others.",
            ("score", "fit"),
            ("--score", "--fit"),
        ),
        (
            lambda: vi.export_ssp(EXAMPLES / "two_oscillators.toml", "two.ssp", gains="none"),
            ("ssp", "export", EXAMPLES / "two_oscillators.toml", "-o", "two.ssp", "--gains", "none"),
            "{}: expected component or transformation, got 'none'.",
            ("gains",),
            ("--gains",),
        ),
    ],
    ids=["budget", "only", "workers", "sweep", "score", "gains"],
)
def test_what_asks_for_too_little_or_too_much_is_named_as_it_was_given(
    files: Path,
    call: Callable[[], Any],
    words: tuple[str | Path, ...],
    said: str,
    called: tuple[str, ...],
    typed: tuple[str, ...],
) -> None:
    assert refusals(call, *words) == (said.format(*called), said.format(*typed))


def test_figures_name_the_run_and_the_window(runs: Path) -> None:
    data = vi.open_dataset(runs)
    said = "figure: run: expected one run, got 2. Name one by its run_index ({}): 0, 1."
    words = ("plot", "runs.nc", "-o", "a.png", "--kind", "run")
    assert refusals(lambda: vi.draw(data, "run"), *words) == (said.format("run"), said.format("--run"))
    said = "figure: window: expected {} < {}, got 2 and 1. Turn them round."
    assert refusals(
        lambda: vi.draw(data, "run", 0, start=2.0, stop=1.0), *words, "--run", "0", "--from", "2", "--to", "1"
    ) == (said.format("start", "stop"), said.format("from", "to"))


def test_an_analysis_names_the_run_and_the_part(runs: Path, decay: Path) -> None:
    said = "runs.nc: expected one run to be named, got 2 (run_index 0 to 1). Choose one with {}."
    assert refusals(lambda: vi.open_signals("runs.nc"), "estimate", "decay", "runs.nc") == (
        said.format("run"),
        said.format("--run"),
    )
    swing = vi.open_signals(decay).channel()
    said = (
        f"{swing.name}: expected 16 good samples or more from 80 to 90 s, got 0; the channel runs from 0 to 59.99 s. "
        "Widen {} and {}."
    )
    assert refusals(
        lambda: vi.decay_samples(swing, 80.0, 90.0),
        *("estimate", "decay", "decay.nc", "--from", "80", "--to", "90"),
    ) == (said.format("start", "stop"), said.format("--from", "--to"))


def test_spikes_name_what_is_lacking_with_and_without_the_name_of_the_file(force: Path) -> None:
    cell = vi.open_signals(force).channel()
    said = "mass: expected a restitution with it, got none. Give {} too."
    assert refusals(
        lambda: vi.spike_report(cell, mechanics=vi.Mechanics(mass=1.0)), "spikes", "force.nc", "--mass", "1"
    ) == (said.format("restitution"), said.format("--restitution"))
    called, typed = refusals(
        lambda: vi.spike_report(cell, vi.SpikeSettings(method="cycle_median")),
        *("spikes", "force.nc", "--method", "cycle_median"),
    )
    assert called.endswith(". Give its period with period, or use method='threshold'.")
    assert typed.startswith(
        f"force.nc: {cell.name}: cycle_median: expected a periodic excitation, got none: "
    )
    assert typed.endswith(". Give its period with --period, or use --method threshold.")


@pytest.mark.parametrize(
    ("file", "said", "called", "typed"),
    [
        (
            "words.csv",
            "words.csv: expected rows of numbers, got none. Is it text? Give {} and {} if it is.",
            ("delimiter", "decimal"),
            ("--delimiter", "--decimal"),
        ),
        (
            "uneven.csv",
            "uneven.csv: a: expected a column of instants or a sampling interval, got neither. Give {} (samples per "
            "second), or {}. Tried: 'a', 'b': no heading names a time, and no column ascends.",
            ("rate", "time_column"),
            ("--rate", "--time-column"),
        ),
    ],
    ids=["in the process that reads", "in this one"],
)
def test_a_file_that_is_not_imported_is_refused_with_arguments(
    files: Path, file: str, said: str, called: tuple[str, ...], typed: tuple[str, ...]
) -> None:
    found = refusals(lambda: vi.import_recording(file), "import", file, "-o", "recording.nc")
    assert found == (said.format(*called), said.format(*typed))


def test_remarks_of_an_import_are_printed_and_kept_as_its_arguments_were_given(files: Path) -> None:
    recording = vi.import_recording("plain.csv")
    assert recording.remarks == (IS_TIME.format("time_column"), NO_UNIT.format("unit"))
    vi.write_recording(recording, "called.nc")
    assert vi.open_recording("called.nc").remarks == recording.remarks
    done = in_this_process("import", "plain.csv", "-o", "typed.nc")
    assert f"- {IS_TIME.format('--time-column')}\n- {NO_UNIT.format('--unit')}\n" in done.stdout
    assert vi.open_recording("typed.nc").attrs["remarks"] == "\n".join(
        (IS_TIME.format("--time-column"), NO_UNIT.format("--unit"))
    )


def test_a_decay_says_where_it_begins_as_the_start_is_given(decay: Path) -> None:
    found = vi.estimate_decay(vi.decay_samples(vi.open_signals(decay).channel()))
    assert found.words()[0] == DECAY_BEGINS.format("start")
    assert found.dataset().attrs["remarks"].splitlines()[0] == DECAY_BEGINS.format("start")
    done = in_this_process("estimate", "decay", "decay.nc", "-o", "found.nc")
    assert f"- {DECAY_BEGINS.format('--from')}\n" in done.stdout
    remarks = vi.open_measured("found.nc").attrs["remarks"]
    assert remarks == found.dataset().attrs["remarks"].replace("; start sets", "; --from sets")


def test_a_campaign_is_resumed_by_the_same_call_or_command(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(campaign._Campaign, "_complete", interrupted)
    said = f"Interrupted: 0 of 2 points are complete in {files / 'out'}. The same {{}} resumes."
    with pytest.raises(CampaignInterrupted) as raised:
        vi.campaign("swept.toml", "out", workers=1, progress=False)
    assert str(raised.value) == said.format("call")
    done = in_this_process("campaign", "swept.toml", "-o", "out", "--workers", "1")
    assert (done.returncode, done.stderr) == (130, said.format("command") + "\n")
    Path("other").mkdir()
    Path("other", "dataset.nc").touch()
    said = (
        f"{files / 'other'}: expected an empty folder or one of a campaign, got data without campaign.json. "
    )
    assert refusals(
        lambda: vi.campaign("swept.toml", "other", progress=False),
        *("campaign", "swept.toml", "-o", "other"),
    ) == (f"{said}Choose another folder.", f"{said}Choose another folder with -o.")


def test_notes_of_an_export_name_its_arguments(files: Path) -> None:
    scene, notes = EXAMPLES / "two_oscillators.toml", list[str]()
    export_system(vi.Scene.from_file(scene), files / "called.ssp", note=notes.append)
    assert notes[0].endswith(" than with gains transformation")
    done = in_this_process("ssp", "export", scene, "-o", "typed.ssp")
    assert done.stderr.splitlines()[0] == notes[0].replace("with gains", "with --gains")


def test_clocks_that_differ_are_hinted_at_with_the_argument_that_lets_them(files: Path) -> None:
    record = record_of(THESIS, periods=60)
    swing = record.channel(0.005)
    vi.write_recording(vi.Recording({swing.name: swing}), "drift.nc")
    wrong = 64.32 * 1.001
    said = "or clocks that differ ({})"
    found = vi.estimate_impacts(swing, record.forcing(angular_frequency=wrong), methods=["weak_form"])
    assert said.format("clock_drifts") in found.verdict
    done = in_this_process(
        *("estimate", "impacts", "drift.nc", "--angular-frequency", str(wrong), "--static-deflection", "2.3"),
        *("--phase", str(record.truth.phase), "-o", "found.nc"),
    )
    written = vi.open_measured("found.nc").attrs
    typed = said.format("--clock-drifts")
    assert written["verdict"] in on_one_line(done.stdout)
    assert all(typed in text for text in (on_one_line(done.stdout), written["verdict"], written["doubts"]))
    assert "clock_drifts" not in done.stdout + written["verdict"] + written["doubts"]


def served(process: str, *arguments: str | Path) -> list[str]:
    """Return the lines printed by a process of the service."""
    command = [sys.executable, "-m", f"vibroimpact.service.{process}", *map(str, arguments)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, start_new_session=True) as started:
        assert started.stdout is not None
        return started.stdout.read().splitlines()  # the process would end with its input, which stays open


def test_processes_of_the_service_name_arguments_as_python_does(files: Path, decay: Path) -> None:
    imported = partial(call, "vibroimpact.service.import_process:answer", seconds=60.0)
    said = imported(str(files / "words.csv"), str(files / "recording.nc"), "{}").answer
    assert said["failed"].endswith("Give delimiter and decimal if it is.")
    imported(str(files / "plain.csv"), str(files / "recording.nc"), "{}")
    assert vi.open_recording("recording.nc").remarks == (
        IS_TIME.format("time_column"),
        NO_UNIT.format("unit"),
    )
    asked = {"data": "decay.nc", "asked": {"kind": "decay", "law": "none"}}
    lines = served("job_process", files, Work("estimate", options=asked).written())
    assert f"- {DECAY_BEGINS.format('start')}" in lines
    remarks = vi.open_measured("estimates.nc").attrs["remarks"]
    assert remarks.splitlines()[0] == DECAY_BEGINS.format("start")
