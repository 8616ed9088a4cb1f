"""A command checks its outputs before it computes: their names, existing files, and their size."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from harness import warm
from support.command_line import ENTRY, in_this_process
from support.replay_scenes import BOARD, hit

SCENE = """
[scene]
units = "nondimensional"
[body]
mass = {mass}
stiffness = 1.0
displacement_start = 1.0
[record]
recorded_time = 5.0
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(mass=1.0))
    return path


def misuse(done: subprocess.CompletedProcess[str], expected: str) -> None:
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert expected in done.stderr


@pytest.mark.parametrize("name", ["x.csv", "x", "x.png", "x.NC", "x.nc.txt", ".nc"])
def test_a_dataset_ends_in_nc(name: str, scene: Path, tmp_path: Path) -> None:
    misuse(in_this_process("run", scene, "-o", tmp_path / name), "expected a name ending in .nc")
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


@pytest.mark.parametrize("command", ["campaign", "replay"])
@pytest.mark.parametrize("ending", [".csv", ".png", ".txt"])
def test_a_campaign_is_no_file(command: str, ending: str, scene: Path, tmp_path: Path) -> None:
    done = in_this_process(command, scene, "-o", tmp_path / f"x{ending}")
    misuse(done, f"expected the name of a folder, got that of a file ({ending})")


@pytest.mark.parametrize("command", ["import", "spikes", "estimate decay", "plot", "fmu replay"])
def test_every_command_names_the_ending_that_it_writes_before_it_reads(command: str, tmp_path: Path) -> None:
    ending = {"plot": ".png", "fmu replay": ".fmu"}.get(command, ".nc")
    done = in_this_process(*command.split(), tmp_path / "absent.nc", "-o", tmp_path / "x.docx")
    misuse(done, f"expected a name ending in {ending}")


@pytest.mark.parametrize("length", [250, 256, 30_000])
@pytest.mark.parametrize(
    "command",
    [
        *(
            "check NAME",
            "run NAME -o a.nc",
            "campaign NAME -o a",
            "replay NAME NAME -o a.nc",
            "plot NAME -o a.png",
        ),
        *("describe NAME", "estimate NAME", "estimate impacts NAME", "spikes NAME", "import NAME -o a.nc"),
        "fmu check NAME",
    ],
)
def test_a_name_too_long_for_a_file_is_one_line_from_every_command(
    command: str, length: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    refused = in_this_process(*command.replace("NAME", "x" * length).split())
    assert refused.returncode == 2
    assert "x" * 50 in refused.stderr
    assert "defect" not in refused.stderr
    assert list(tmp_path.iterdir()) == []


FOREIGN_NAME = os.fsdecode(b"caf\xe9")
"""A file name written by a system with Latin-1."""


@pytest.fixture
def foreign_folder(tmp_path: Path) -> Path:
    folder = tmp_path / FOREIGN_NAME
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ("check", "FOLDER/scene.toml"),
        ("run", "FOLDER/scene.toml", "-o", "x.nc"),
        ("run", "scene.toml", "-o", "FOLDER/x.nc"),
        ("campaign", "scene.toml", "-o", "FOLDER/campaign"),
        ("plot", "FOLDER/x.nc", "-o", "x.png"),
        ("describe", "FOLDER/x.nc"),
        ("import", "FOLDER/x.csv", "-o", "x.nc"),
        ("fmu", "export", "oscillator", "-o", "FOLDER/x.fmu"),
    ],
)
def test_a_name_in_another_encoding_is_one_line_from_every_command_before_anything_is_written(
    words: tuple[str, ...], scene: Path, foreign_folder: Path, tmp_path: Path
) -> None:
    for name in ("scene.toml", "x.csv"):
        (foreign_folder / name).write_text(scene.read_text())
    before = sorted(tmp_path.rglob("*"))
    placed = [
        str(tmp_path / word.replace("FOLDER", FOREIGN_NAME)) if "." in word or "/" in word else word
        for word in words
    ]
    misuse(in_this_process(*placed), "expected a name in utf-8, the encoding of this system, got other bytes")
    assert sorted(tmp_path.rglob("*")) == before


def test_a_folder_in_another_encoding_is_told_of_where_names_are_relative_to_it(
    scene: Path, foreign_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(foreign_folder)
    for command, name in (("run", "x.nc"), ("campaign", "campaign")):
        misuse(in_this_process(command, scene, "-o", name), "expected a name in utf-8")
    assert list(foreign_folder.iterdir()) == []


def test_a_run_may_be_repeated_but_another_scene_needs_force(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "run.nc"
    command = ("run", scene, "-o", output)
    assert in_this_process(*command).returncode == 0
    scene.write_text("# the same, told otherwise\n" + SCENE.format(mass="1"))
    assert in_this_process(*command).returncode == 0
    scene.write_text(SCENE.format(mass=2.0))
    before = output.read_bytes()
    misuse(in_this_process(*command), "got one that holds something else. Choose another name, or overwrite")
    assert output.read_bytes() == before
    assert in_this_process(*command, "--force").returncode == 0
    with xr.open_dataset(output) as dataset:
        assert "mass = 2.0" in dataset.attrs["scene"]


@pytest.mark.parametrize("content", [b"notes of a whole year", b"\x89HDF\r\n\x1a\n" + bytes(200), b""])
def test_a_file_that_is_no_dataset_is_not_overwritten_without_force(
    content: bytes, scene: Path, tmp_path: Path
) -> None:
    output = tmp_path / "run.nc"
    output.write_bytes(content)
    misuse(in_this_process("run", scene, "-o", output), "--force")
    assert output.read_bytes() == content
    assert in_this_process("run", scene, "-o", output, "--force").returncode == 0


def test_imports_and_analyses_may_be_repeated_and_nothing_else_is_overwritten(tmp_path: Path) -> None:
    time = np.arange(4000) / 1000.0
    signal = np.exp(-0.3 * time) * np.cos(40.0 * time)
    for name, scale in (("a", 1.0), ("b", 2.0)):
        rows = "".join(f"{t:.4f},{scale * x:.6f}\n" for t, x in zip(time, signal, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"time (s),x (m)\n{rows}")
    recording, other, found = tmp_path / "a.nc", tmp_path / "b.nc", tmp_path / "found.nc"
    for _ in range(2):
        assert in_this_process("import", tmp_path / "a.csv", "-o", recording).returncode == 0
    misuse(in_this_process("import", tmp_path / "b.csv", "-o", recording), "--force")
    assert in_this_process("import", tmp_path / "b.csv", "-o", other).returncode == 0
    for _ in range(2):
        assert in_this_process("estimate", "decay", recording, "-o", found).returncode == 0
    misuse(in_this_process("estimate", "decay", other, "-o", found), "--force")
    misuse(in_this_process("spikes", recording, "-o", found), "--force")
    assert in_this_process("spikes", recording, "-o", found, "--force").returncode == 0
    assert in_this_process("spikes", recording, "-o", found).returncode == 0


@pytest.mark.parametrize("command", ["run", "replay", "accuracy", "effects"])
def test_a_recording_that_a_scene_names_is_not_written_over_with_force_either(
    command: str, tmp_path: Path
) -> None:
    recording, scene = hit(tmp_path), tmp_path / "named.toml"
    scene.write_text(BOARD.replace("[replay]", '[replay]\nrecordings = ["hit.nc"]'))
    before = recording.read_bytes()
    done = in_this_process(command, scene, "-o", recording, "--force")
    misuse(done, "hit.nc: expected a new file, got one that is read")
    assert recording.read_bytes() == before


LARGE = {
    "a hundred million points": (
        "[sweep]\n"
        '"body.mass" = { start = 1, stop = 2, points = 10000 }\n'
        '"body.stiffness" = { start = 1, stop = 2, points = 10000 }\n',
        "Use `vibroimpact campaign`",
    ),
    "samples": ("[record.time_series]\nrate = 1.9e7\n", "sample fewer variables, more slowly"),
    "points with samples": (
        '[record.time_series]\nrate = 1e4\n[sweep]\n"body.mass" = { start = 1, stop = 2, points = 2000 }\n',
        "Use `vibroimpact campaign`",
    ),
    "periods": (
        "[forcing]\namplitude = 1.0\nangular_frequency = 1.0\n",
        "Record fewer periods",
    ),
}


@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the memory of a process")
@pytest.mark.parametrize(("more", "todo"), LARGE.values(), ids=LARGE)
def test_what_does_not_fit_into_memory_is_refused_before_it_is_computed(
    more: str, todo: str, scene: Path, tmp_path: Path
) -> None:
    text = SCENE.format(mass=1.0)
    if "[forcing]" in more:
        text = text.replace("recorded_time = 5.0", "transient_periods = 0\nrecorded_periods = 100000000")
    scene.write_text(text + more)
    # /proc counts the memory of this program alone; getrusage includes that of the parent process
    status = "pathlib.Path('/proc/self/status').read_text()"
    prints_status = f"import atexit, pathlib; atexit.register(lambda: print({status}))"
    command = [
        sys.executable,
        "-c",
        f"{prints_status}\n{ENTRY}",
        "run",
        str(scene),
        "-o",
        str(tmp_path / "x.nc"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    misuse(done, "expected results of at most 1.0 GB")
    assert todo in done.stderr
    (peak,) = (int(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("VmHWM:"))
    # kB: enough for any command, but not for 10^8 points
    assert peak < 600_000
    assert not (tmp_path / "x.nc").exists()


@pytest.mark.parametrize("command", ["import", "spikes", "run"])
def test_a_command_whose_reader_has_gone_writes_what_it_computed(
    command: str, scene: Path, tmp_path: Path
) -> None:
    """As with `| head`: the tables come before the dataset."""
    written = ["time,force"] + [f"{k / 1000:.3f},{np.sin(k / 9.0) ** 40:.6f}" for k in range(2000)]
    table, recording, output = (tmp_path / name for name in ("table.csv", "recording.nc", "output.nc"))
    table.write_text("\n".join(written))
    if command == "spikes":
        assert in_this_process("import", table, "-o", recording, "--unit", "N").returncode == 0
    given = {"import": table, "spikes": recording, "run": scene}[command]
    with warm.start(ENTRY, command, given, "-o", output) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        errors = process.stderr.read()
    assert (process.returncode, errors) == (0, "")
    with xr.open_dataset(output) as dataset:
        assert dataset.sizes


@pytest.mark.skipif(
    not Path("/dev/full").exists(), reason="no /dev/full, which takes nothing, on this system"
)
@pytest.mark.parametrize("command", ["import", "run", "--help"])
def test_text_for_a_disk_that_is_full_is_told_of_and_the_dataset_is_written(
    command: str, scene: Path, tmp_path: Path
) -> None:
    table, output = tmp_path / "table.csv", tmp_path / "output.nc"
    table.write_text("time,force\n" + "".join(f"{k / 1000:.3f},{k % 7}\n" for k in range(200)))
    given = {"import": [str(table), "-o", str(output), "--unit", "N"], "run": [str(scene), "-o", str(output)]}
    with Path("/dev/full").open("w") as full:
        done = warm.run(ENTRY, command, *given.get(command, []), stdout=full)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert "cannot be written" in done.stderr
    assert command == "--help" or xr.open_dataset(output).sizes
