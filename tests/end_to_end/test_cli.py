"""The command line for a user: its output, the streams, and the exit code."""

from __future__ import annotations

import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from importlib import metadata, resources
from pathlib import Path

import pytest
import typer
from support.campaign_scenes import assert_same_rows
from support.command_line import in_this_process, vibroimpact
from support.places import EXAMPLES
from support.serial_pool import campaign_here

from vibroimpact.analysis.dataset import Outcome, read_flat
from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.commands.cli import app, load_commands, main
from vibroimpact.orchestrator.commands.table import PANELS
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

HEAVY = (
    *("numpy", "xarray", "pandas", "scipy", "netCDF4", "pint", "matplotlib", "dask", "distributed", "fmpy"),
    *("vibroimpact.analysis.dataset", "vibroimpact.orchestrator.scene", "vibroimpact.fmus.packaging.build"),
)
ALL_HELP = f"""
import contextlib, io, sys
import typer
from vibroimpact.orchestrator.commands.cli import app, load_commands, main

def paths(command, *path):
    yield path
    for name, inner in getattr(command, "commands", {{}}).items():
        yield from paths(inner, *path, name)

load_commands()
commands = list(paths(typer.main.get_command(app)))
for path in commands:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        main([*path, "--help"])
print(len(commands))
print([name for name in {HEAVY!r} if name in sys.modules])
"""


def small_sweep(path: str) -> str:
    text = (EXAMPLES / "bifurcation.toml").read_text()
    assert 'points = 401, path = "up-down"' in text
    text = text.replace('points = 401, path = "up-down"', f'points = 31, path = "{path}"')
    return text.replace("transient_periods = 1000", "transient_periods = 100")


def assert_misuse(done: subprocess.CompletedProcess[str], *expected: str) -> None:
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout
    for words in expected:
        assert words in done.stderr


def test_an_export_loads_nothing_of_datasets(tmp_path: Path) -> None:
    scene, output = str(EXAMPLES / "single_run.toml"), str(tmp_path / "body.fmu")
    program = f"""
import sys
from vibroimpact.orchestrator.commands.cli import main
try:
    main(["fmu", "export", sys.argv[1], "-o", {output!r}])
finally:
    print([name for name in ("xarray", "pandas", "scipy", "dask", "matplotlib") if name in sys.modules])
"""
    for what in ("beam", scene):
        done = subprocess.run([sys.executable, "-c", program, what], capture_output=True, text=True)
        assert done.stdout.splitlines() == [output, "[]"], done.stderr


def test_a_run_without_a_tolerance_loads_no_studies(tmp_path: Path) -> None:
    # studies load scipy.stats and more, which takes longer than the run
    program = f"""
import sys
from vibroimpact.orchestrator.commands.cli import main
try:
    main(["run", sys.argv[1], "-o", {str(tmp_path / "run.nc")!r}])
finally:
    light = ("vibroimpact.orchestrator.study", "vibroimpact.orchestrator.study.preparing")
    heavy = [name for name in sys.modules if "orchestrator.study" in name or name == "scipy.stats"]
    print([name for name in heavy if name not in light])
"""
    scene = str(EXAMPLES / "single_run.toml")
    done = subprocess.run([sys.executable, "-c", program, scene], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


def test_every_command_has_help_with_an_example() -> None:
    load_commands()
    group = typer.main.get_command(app)
    commands = group.commands  # type: ignore[attr-defined]
    names = [name for name, one in commands.items() if not (one.hidden or hasattr(one, "commands"))]
    names += [f"{name} {inner}" for name in ("fmu", "estimate") for inner in commands[name].commands]
    assert {"run", "campaign", "demo", "plot", "fmu export", "estimate decay"} <= set(names)
    for name in names:
        done = in_this_process(*name.split(), "--help")
        assert done.returncode == 0
        assert f"Example: vibroimpact {name}" in done.stdout, name


def test_commands_are_listed_in_the_order_of_their_use() -> None:
    shown = in_this_process("--help").stdout
    listed = [line.split()[1] for line in shown.splitlines() if line.startswith("│ ") and line[2].islower()]
    assert listed == [name for names in PANELS.values() for name in names]
    assert all(panel in shown for panel in PANELS)


def test_the_help_of_no_command_loads_what_computes() -> None:
    done = subprocess.run([sys.executable, "-c", ALL_HELP], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    commands, loaded = done.stdout.splitlines()
    assert int(commands) > 14
    assert loaded == "[]"


def test_the_version_is_that_of_the_package() -> None:
    assert vibroimpact("--version").stdout.strip() == f"vibroimpact {metadata.version('vibroimpact')}"


@pytest.mark.parametrize(
    "arguments",
    [("nonsense",), ("run",), ("run", "scene.toml"), ("campaign", "scene.toml", "-o", "x", "--workers", "0")],
)
def test_misuse_ends_with_exit_code_2(arguments: tuple[str, ...]) -> None:
    assert_misuse(in_this_process(*arguments))


def test_a_missing_scene_is_one_clear_message(tmp_path: Path) -> None:
    for command in ("run", "campaign"):
        done = vibroimpact(command, tmp_path / "absent.toml", "-o", tmp_path / "out")
        assert_misuse(done, "absent.toml")
        assert len(done.stderr.splitlines()) == 1


def test_all_problems_of_a_scene_are_told_at_once(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(small_sweep("up").replace("mass = 1.0", "mas = 1.0").replace("0.7", "1.7"))
    done = in_this_process("run", scene, "-o", tmp_path / "out.nc")
    assert_misuse(done, "mass", "restitution", "1.7")
    assert not list(tmp_path.glob("out*"))


def test_workers_and_scheduler_exclude_each_other(tmp_path: Path) -> None:
    scene = EXAMPLES / "bifurcation.toml"
    both = ("--workers", "2", "--scheduler", "tcp://127.0.0.1:9")
    done = in_this_process("campaign", scene, "-o", tmp_path / "x", *both)
    assert_misuse(done, "expected one of them")


def fused_examples() -> list[str]:
    texts = {path.name: path.read_text() for path in EXAMPLES.glob("*.toml")}
    return sorted(name for name, text in texts.items() if "[body]" in text and '"coupled"' not in text)


@pytest.mark.parametrize("example", fused_examples())
def test_every_example_of_a_single_body_runs(example: str, tmp_path: Path) -> None:
    done = in_this_process("run", EXAMPLES / example, "-o", tmp_path / "run.nc")
    assert done.returncode == 0, done.stderr
    rows = read_flat(tmp_path / "run.nc")
    assert (rows["outcome"].values <= Outcome.stuck).all()
    written = (EXAMPLES / example).read_text()
    if 'kind = "matrices"' in written:  # bodies by files are kept by their modes
        assert parse_toml(rows.attrs["scene"])["body"][0]["origin"]["files"]
    else:
        assert rows.attrs["scene"] == written


@pytest.mark.parametrize("path", ["up", "down"])
def test_a_campaign_of_one_process_has_the_rows_of_a_run(
    tmp_path: Path, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(small_sweep(path))
    assert in_this_process("run", scene, "-o", tmp_path / "run.nc").returncode == 0
    campaign_here(monkeypatch, scene.read_text(), tmp_path / "campaign", runner=DEFAULT_RUNNER)
    assert_same_rows(tmp_path / "run.nc", tmp_path / "campaign" / "dataset.nc")


@pytest.mark.parametrize("path", ["independent", "up-down"])
def test_run_and_campaign_give_bit_identical_rows(tmp_path: Path, path: str, cluster: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(small_sweep(path))
    assert in_this_process("run", scene, "-o", tmp_path / "run.nc").returncode == 0
    done = vibroimpact("campaign", scene, "-o", tmp_path / "campaign", "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    assert_same_rows(tmp_path / "run.nc", tmp_path / "campaign" / "dataset.nc")


def test_an_up_sweep_is_not_a_down_sweep_where_motions_coexist(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(small_sweep("up-down"))
    assert in_this_process("run", scene, "-o", tmp_path / "run.nc").returncode == 0
    rows = read_flat(tmp_path / "run.nc")
    w, up = rows["angular_frequency"].values, rows["direction"].values == 1
    # Between the upper graze at 1.219 and the fold at 1.517 the way up still impacts, the way down does not.
    between = (w > 1.25) & (w < 1.45)
    assert (rows["impact_count"].values[between & up] > 0).all()
    assert (rows["impact_count"].values[between & ~up] == 0).all()


@pytest.mark.parametrize("target", ["file/run.nc", "folder", "absent/run.nc"])
def test_a_dataset_that_cannot_be_written_is_refused_before_anything_runs(
    tmp_path: Path, target: str
) -> None:
    (tmp_path / "file").write_text("not a folder")
    (tmp_path / "folder").mkdir()
    done = in_this_process("run", EXAMPLES / "bifurcation.toml", "-o", tmp_path / target)
    assert_misuse(done, "expected a place where a file can be written")
    assert len(done.stderr.splitlines()) == 1


def test_the_demo_reads_the_known_landmarks_within_two_steps(tmp_path: Path) -> None:
    began = time.monotonic()
    done = vibroimpact("demo", "-o", tmp_path / "demo")
    assert done.returncode == 0, done.stderr
    assert time.monotonic() - began < 60.0
    assert read_flat(tmp_path / "demo" / "dataset.nc").sizes["run"] == 802
    assert (tmp_path / "demo" / "bifurcation.png").stat().st_size > 10_000
    for expected in ("lower graze", "upper graze", "fold", "doubling", "0.936493", "1.516611", "dataset.nc"):
        assert expected in done.stdout
    again = in_this_process("demo", "-o", tmp_path / "demo")
    assert again.returncode == 0
    assert "were there already" in again.stdout


def test_the_demo_runs_the_example() -> None:
    packaged = resources.files("vibroimpact.orchestrator.commands") / "demo_scene.toml"
    assert packaged.read_bytes() == (EXAMPLES / "bifurcation.toml").read_bytes()


@app.command("fail-for-a-test", hidden=True)
def fail_for_a_test() -> None:
    """Raise an unforeseen error."""
    raise TypeError("an unforeseen thing")


def test_a_defect_is_one_line_and_a_hint(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["fail-for-a-test"])
    assert left.value.code == 1
    err = capsys.readouterr().err
    assert "Unexpected error: TypeError: an unforeseen thing" in err
    assert "--debug" in err
    assert "Traceback" not in err


def test_a_defect_shows_its_place_with_debug(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["--debug", "fail-for-a-test"])
    assert left.value.code == 1
    assert "in fail_for_a_test" in capsys.readouterr().err


def fmu_from_oscillator(path: Path, change: Callable[[str, bytes], tuple[str, bytes]]) -> Path:
    """Write the Oscillator's FMU with changed members."""
    with zipfile.ZipFile(fmu_path("Oscillator")) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            target.writestr(*change(name, source.read(name)))
    return path


def for_another_machine(name: str, data: bytes) -> tuple[str, bytes]:
    return name.replace("x86_64-linux", "riscv64-plan9"), data


def with_entities(name: str, data: bytes) -> tuple[str, bytes]:
    text = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><x>&b;</x>'
    return name, text if name == "modelDescription.xml" else data


def that_escapes(name: str, data: bytes) -> tuple[str, bytes]:
    return ("../" + name if name.endswith(".md") else name), data


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (for_another_machine, "riscv64-plan9"),
        (with_entities, "document type declaration"),
        (that_escapes, "leads out of the archive"),
        (None, "zip"),
    ],
)
@pytest.mark.parametrize("command", ["run", "campaign"])
def test_a_bad_fmu_file_is_misuse_with_one_message(
    command: str, change: Callable[[str, bytes], tuple[str, bytes]] | None, expected: str, tmp_path: Path
) -> None:
    fmu = tmp_path / "bad.fmu"
    if change is None:
        fmu.write_bytes(b"PK\x03\x04 no archive")
    else:
        fmu_from_oscillator(fmu, change)
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[component.body]\nfmu = "bad.fmu"\n[record]\nrecorded_time = 1.0\n'
        'variables = ["body.displacement"]\nrate = 10\n'
    )
    output = "x.nc" if command == "run" else "folder"
    # the workers of a campaign need a process of their own as parent, as in a terminal
    start = in_this_process if command == "run" else vibroimpact
    assert_misuse(start(command, scene, "-o", tmp_path / output), expected)
    assert not (tmp_path / "x.nc").exists()


def test_a_build_into_a_file_is_misuse(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert_misuse(in_this_process("fmu", "build", "--output", tmp_path / "file"), "expected a folder to fill")


@pytest.mark.parametrize(
    "command",
    [
        "WORD",
        "--WORD",
        "run a.toml WORD -o a.nc",
        "run --WORD",
        "estimate decay a.nc WORD",
    ],
)
def test_a_word_that_turns_text_around_is_shown_as_its_escape_where_a_command_is_misused(
    command: str,
) -> None:
    refused = in_this_process(*command.replace("WORD", "a\N{RIGHT-TO-LEFT OVERRIDE}b").split())
    assert refused.returncode == 2
    assert "\N{RIGHT-TO-LEFT OVERRIDE}" not in refused.stderr
    assert "u202e" in refused.stderr
