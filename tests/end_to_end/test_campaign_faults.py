"""Faults during a campaign: one clear message, complete parts, no orphans, and the campaign can be resumed."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed.security import Security
from support.busy_runner import run_busy
from support.campaign_process import CampaignProcess, fork_servers_of, run_campaign_process, wait_until
from support.campaign_scenes import amplitude_text, assert_same_rows, frequency_text, scene_of
from support.cluster import free_port, started_cluster

import vibroimpact.orchestrator.campaign.campaign as engine
from vibroimpact.analysis.dataset import Outcome, read_flat
from vibroimpact.fmus.errors import CampaignError
from vibroimpact.orchestrator.campaign import run_campaign

POINTS, MILLISECONDS = 600, 3.0
"""Points of a campaign, and duration of a point, ms: half a second of work is left after four parts, on either path."""
TWO = ("--workers", "2")
FINISHED_POINTS = 10
independent = pytest.mark.parametrize("uninterrupted", ["independent"], indirect=True)
up_and_down = pytest.mark.parametrize("uninterrupted", ["up-down"], indirect=True)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and sessions")


@pytest.fixture(scope="module")
def uninterrupted(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path]:
    """Return a scene with the path of the parameter, and the dataset of all its points from one process."""
    folder = tmp_path_factory.mktemp(request.param)
    scene, dataset = folder / "scene.toml", folder / "run.nc"
    points = POINTS if request.param == "independent" else POINTS // 2
    scene.write_text(frequency_text(points, request.param, MILLISECONDS))
    run_busy(scene_of(scene.read_text()), dataset)
    return scene, dataset


@pytest.fixture(scope="module")
def finished(cluster: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return a scene and the dataset of its undisturbed campaign."""
    folder = tmp_path_factory.mktemp("finished")
    scene = folder / "scene.toml"
    scene.write_text(frequency_text(FINISHED_POINTS))
    code, out, err = run_campaign_process(scene, folder / "campaign", "--scheduler", cluster)
    assert code == 0, err
    assert f"{FINISHED_POINTS} points computed" in out
    return scene, folder / "campaign" / "dataset.nc"


def assert_one_clear_message(err: str) -> None:
    assert "Traceback" not in err
    lines = [line for line in err.splitlines() if "points/s" not in line]
    assert len(lines) == 1, err


def resume(scene: Path, folder: Path) -> str:
    code, out, err = run_campaign_process(scene, folder, *TWO)
    assert code == 0, err
    assert not list(folder.rglob("*.tmp"))
    return out


@up_and_down
def test_a_campaign_survives_a_worker_that_is_killed(
    uninterrupted: tuple[Path, Path], tmp_path: Path
) -> None:
    scene, expected = uninterrupted
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    campaign = CampaignProcess(scene, tmp_path / "campaign", *TWO, TMPDIR=str(scratch))
    campaign.wait_for_parts(3)
    campaign.workers()[0].send_signal(signal.SIGKILL)
    code, out, err = campaign.end()
    assert code == 0, err
    assert "Traceback" not in err
    said = [line for line in err.splitlines() if "points/s" not in line]
    assert said == ["1 worker was lost; what it had not finished was computed again."]
    assert f"{POINTS} points computed" in out
    assert_same_rows(tmp_path / "campaign" / "dataset.nc", expected)
    campaign.assert_nothing_lives()
    assert not list(scratch.rglob("*"))


@pytest.mark.long
@independent
@pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux alone")
def test_a_campaign_survives_the_end_of_what_its_workers_are_forked_from(
    uninterrupted: tuple[Path, Path], tmp_path: Path
) -> None:
    scene, expected = uninterrupted
    campaign = CampaignProcess(scene, tmp_path / "campaign", *TWO)
    campaign.wait_for_parts(3)
    (server,) = fork_servers_of(campaign.process.pid)
    server.kill()
    code, _, err = campaign.end()
    assert code == 0, err
    assert "2 workers were lost; what they had not finished was computed again." in err
    assert_same_rows(tmp_path / "campaign" / "dataset.nc", expected)
    campaign.assert_nothing_lives()


@pytest.mark.parametrize(
    ("uninterrupted", "everyone"),
    [("independent", True), pytest.param("up-down", False, marks=pytest.mark.long)],
    indirect=["uninterrupted"],
    ids=["independent, from a terminal", "up-down, to the command alone"],
)
def test_after_ctrl_c_the_same_command_resumes_bit_identically(
    uninterrupted: tuple[Path, Path], tmp_path: Path, everyone: bool
) -> None:
    scene, expected = uninterrupted
    folder = tmp_path / "campaign"
    campaign = CampaignProcess(scene, folder, *TWO)
    campaign.wait_for_parts(3)
    began = time.monotonic()
    (os.killpg if everyone else os.kill)(campaign.process.pid, signal.SIGINT)
    code, _, err = campaign.end()
    assert code == 130
    assert time.monotonic() - began < 10.0
    assert_one_clear_message(err)
    assert f"of {POINTS} points are complete" in err
    assert "The same command resumes." in err
    campaign.assert_nothing_lives()
    assert campaign.parts()
    assert not list(folder.rglob("*.tmp"))
    assert "were there" in resume(scene, folder)
    assert_same_rows(folder / "dataset.nc", expected)


def test_ctrl_c_does_not_wait_for_a_long_point(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(frequency_text(10, milliseconds=60_000.0))
    campaign = CampaignProcess(scene, tmp_path / "campaign", *TWO)
    wait_until((tmp_path / "campaign" / "campaign.json").exists)
    time.sleep(1.0)
    began = time.monotonic()
    os.killpg(campaign.process.pid, signal.SIGINT)
    code, _, err = campaign.end()
    assert code == 130
    assert time.monotonic() - began < 10.0
    assert_one_clear_message(err)
    assert "0 of 10 points are complete" in err
    campaign.assert_nothing_lives()


@pytest.mark.long
def test_ctrl_c_while_the_workers_start_leaves_nothing_behind(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(frequency_text(POINTS, milliseconds=MILLISECONDS))
    for delay in (0.3, 0.8, 1.3, 1.8):
        campaign = CampaignProcess(scene, tmp_path / "campaign", *TWO)
        time.sleep(delay)
        os.killpg(campaign.process.pid, signal.SIGINT)
        code, _, err = campaign.end()
        # Before the command itself runs, Python handles the signal.
        assert code in (130, -signal.SIGINT)
        if (tmp_path / "campaign").exists():
            assert "Traceback" not in err, (delay, err)
        campaign.assert_nothing_lives()


@pytest.fixture(scope="module")
def killed(uninterrupted: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a killed campaign; its processes have ended."""
    scene, _ = uninterrupted
    campaign = CampaignProcess(scene, tmp_path_factory.mktemp("killed") / "campaign", *TWO)
    campaign.wait_for_parts(4)
    campaign.process.kill()
    campaign.end()
    campaign.assert_nothing_lives()
    return campaign.folder


@up_and_down
def test_after_kill_9_the_workers_end_and_the_same_command_resumes_bit_identically(
    uninterrupted: tuple[Path, Path], killed: Path, tmp_path: Path
) -> None:
    scene, expected = uninterrupted
    folder = shutil.copytree(killed, tmp_path / "campaign")
    assert "were there" in resume(scene, folder)
    assert_same_rows(folder / "dataset.nc", expected)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL], ids=["ctrl-c", "kill -9"])
@up_and_down
def test_a_campaign_without_workers_that_is_ended_is_resumed_by_workers_and_the_other_way_round(
    uninterrupted: tuple[Path, Path], tmp_path: Path, number: signal.Signals
) -> None:
    scene, expected = uninterrupted
    first = CampaignProcess(scene, tmp_path / "campaign", runner="BusyRunner@here")
    first.wait_for_parts(3)
    assert first.workers() == []
    os.kill(first.process.pid, number)
    code, _, err = first.end()
    first.assert_nothing_lives()
    assert code == (130 if number == signal.SIGINT else -number)
    if number == signal.SIGINT:
        assert f"of {POINTS} points are complete" in err
    second = CampaignProcess(scene, tmp_path / "campaign", *TWO)
    second.wait_for_parts(len(first.parts()) + 2)
    os.killpg(second.process.pid, number)
    second.end()
    second.assert_nothing_lives()
    code, out, err = run_campaign_process(scene, tmp_path / "campaign", runner="BusyRunner@here")
    assert code == 0, err
    assert "in this process, " in out  # other parts were there
    assert_same_rows(tmp_path / "campaign" / "dataset.nc", expected)


@up_and_down
def test_damaged_parts_are_noticed_and_computed_again(
    uninterrupted: tuple[Path, Path], killed: Path, cluster: str, tmp_path: Path
) -> None:
    scene, expected = uninterrupted
    folder = shutil.copytree(killed, tmp_path / "campaign")
    cut, garbled = sorted((folder / "parts").glob("branch-*.nc"))[:2]
    cut.write_bytes(cut.read_bytes()[:1000])
    garbled.write_bytes(b"not a dataset")
    (folder / "parts" / f".{cut.name}.17.0123abcd.tmp").write_bytes(b"half")
    code, _, err = run_campaign_process(scene, folder, "--scheduler", cluster)
    assert code == 0
    assert f"{cut.name} was damaged and is removed" in err
    assert f"{garbled.name} was damaged and is removed" in err
    assert_same_rows(folder / "dataset.nc", expected)


def test_a_finished_campaign_has_nothing_left_to_do(finished: tuple[Path, Path]) -> None:
    scene, dataset = finished
    before = dataset.stat().st_mtime_ns
    code, out, _ = run_campaign_process(scene, dataset.parent, *TWO)
    assert code == 0
    assert f"Nothing to do: all {FINISHED_POINTS} points are in" in out
    assert dataset.stat().st_mtime_ns == before


def test_a_changed_scene_is_refused_with_the_key_that_changed(
    finished: tuple[Path, Path], tmp_path: Path
) -> None:
    scene, dataset = finished
    changed = tmp_path / "changed.toml"
    changed.write_text(scene.read_text().replace("restitution = 0.7", "restitution = 0.8"))
    code, _, err = run_campaign_process(changed, dataset.parent, *TWO)
    assert code == 2
    assert_one_clear_message(err)
    assert "stop[1].restitution was 0.7, is 0.8" in err


def test_a_changed_comment_is_the_same_scene(finished: tuple[Path, Path], tmp_path: Path) -> None:
    scene, dataset = finished
    changed = tmp_path / "changed.toml"
    changed.write_text("# the same\n" + scene.read_text().replace("restitution = 0.7", "restitution = 0.70"))
    code, out, _ = run_campaign_process(changed, dataset.parent, *TWO)
    assert code == 0
    assert "Nothing to do" in out


def test_another_kind_of_machine_is_refused(tmp_path: Path) -> None:
    scene, folder = tmp_path / "scene.toml", tmp_path / "campaign"
    scene.write_text(frequency_text(POINTS, milliseconds=MILLISECONDS))
    campaign = CampaignProcess(scene, folder, *TWO)
    campaign.wait_for_parts(2)
    campaign.process.kill()
    campaign.end()
    campaign.assert_nothing_lives()
    code, _, err = run_campaign_process(scene, folder, *TWO, runner="OtherMachineRunner")
    assert code == 2
    assert_one_clear_message(err)
    assert 'instruction_set was "none", is "other"' in err


def test_workers_of_different_kinds_are_refused(tmp_path: Path, cluster: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(frequency_text(10))
    where = ("--scheduler", cluster)
    code, _, err = run_campaign_process(scene, tmp_path / "campaign", *where, runner="UnlikeRunner")
    assert code == 2
    assert_one_clear_message(err)
    assert "one kind of runner" in err


def test_a_failed_point_is_a_row_with_its_message(tmp_path: Path, cluster: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(amplitude_text(61, start=-0.3))
    where = ("--scheduler", cluster)
    code, out, err = run_campaign_process(scene, tmp_path / "campaign", *where, runner="BrittleRunner")
    assert code == 0
    assert "61 points computed" in out
    assert "15 points ended with the outcome error" in err
    assert "  amplitude = -0.3: oscillator: the step failed" in err
    assert "  5 more are in the dataset" in err
    assert err.count("the step failed") == 10
    rows = read_flat(tmp_path / "campaign" / "dataset.nc")
    failed = rows["amplitude"].values < 0
    assert (rows["outcome"].values == failed * Outcome.error).all()
    assert all("the step failed" in message for message in rows["message"].values[failed])
    assert (rows["impact_count"].values[~failed] == 3).all()


def test_a_point_that_kills_its_process_is_a_row_that_says_so(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(amplitude_text(60, start=-0.005))
    code, _, err = run_campaign_process(scene, tmp_path / "campaign", *TWO, runner="DeadlyRunner")
    assert code == 0, err
    rows = read_flat(tmp_path / "campaign" / "dataset.nc")
    assert (rows["outcome"].values == (rows["amplitude"].values < 0) * Outcome.crash).all()
    assert "kills the process that runs it: run alone, it was ended by SIGKILL" in rows["message"].values[0]
    assert rows.sizes["run"] == 60


@pytest.mark.long
def test_an_innocent_point_is_computed_however_often_its_worker_is_taken_away(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(amplitude_text(60, start=-0.005))
    code, _, err = run_campaign_process(scene, tmp_path / "campaign", *TWO, runner="HuntedRunner")
    assert code == 0, err
    rows = read_flat(tmp_path / "campaign" / "dataset.nc")
    assert (rows["amplitude"].values < 0).any()
    assert (rows["outcome"].values == Outcome.ok).all()


def test_two_campaigns_do_not_share_a_folder(tmp_path: Path) -> None:
    scene, folder = tmp_path / "scene.toml", tmp_path / "campaign"
    scene.write_text(frequency_text(POINTS, milliseconds=MILLISECONDS))
    first = CampaignProcess(scene, folder, *TWO)
    first.wait_for_parts(1)
    # a stopped campaign does not end before the other one starts, however long that start takes
    os.killpg(first.process.pid, signal.SIGSTOP)
    code, _, err = run_campaign_process(scene, folder, *TWO)
    os.killpg(first.process.pid, signal.SIGCONT)
    assert code == 2
    assert_one_clear_message(err)
    assert "another campaign is running" in err
    assert first.end()[0] == 0


@pytest.mark.parametrize("below", ["file", "file/deeper"])
def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path, below: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(frequency_text(10))
    (tmp_path / "file").write_text("not a folder")
    code, _, err = run_campaign_process(scene, tmp_path / below / "campaign", *TWO)
    assert code == 2
    assert_one_clear_message(err)
    assert "expected a folder that can be written" in err


def test_a_folder_with_other_data_is_refused(tmp_path: Path) -> None:
    scene, folder = tmp_path / "scene.toml", tmp_path / "campaign"
    scene.write_text(frequency_text(10))
    folder.mkdir()
    (folder / "dataset.nc").write_bytes(b"of someone else")
    code, _, err = run_campaign_process(scene, folder, *TWO)
    assert code == 2
    assert_one_clear_message(err)
    assert (folder / "dataset.nc").read_bytes() == b"of someone else"


def test_an_address_where_nothing_listens_is_refused_within_seconds(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(frequency_text(10))
    began = time.monotonic()
    address = f"tcp://127.0.0.1:{free_port()}"
    code, _, err = run_campaign_process(scene, tmp_path / "campaign", "--scheduler", address)
    assert code == 2
    assert_one_clear_message(err)
    assert "expected a Dask scheduler that listens there" in err
    assert time.monotonic() - began < 20.0


@up_and_down
def test_a_campaign_on_a_dask_cluster_gives_the_same_rows_and_leaves_the_workers(
    uninterrupted: tuple[Path, Path], tmp_path: Path, cluster: str
) -> None:
    scene, expected = uninterrupted
    for name in ("first", "second"):
        code, out, err = run_campaign_process(scene, tmp_path / name, "--scheduler", cluster)
        assert code == 0, err
        assert "2 workers" in out
        assert_same_rows(tmp_path / name / "dataset.nc", expected)
        assert not [*(tmp_path / name).glob(".question*"), *(tmp_path / name).glob(".answer*")]


def test_a_scheduler_with_tls_is_reached_with_certificates_and_not_without(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(frequency_text(20, milliseconds=0.1))
    security = Security.temporary()
    files = {
        "ca-file": security.tls_ca_file,
        "cert": security.tls_client_cert,
        "key": security.tls_client_key,
    }
    for name, text in files.items():
        (tmp_path / f"{name}.pem").write_text(text)
    options = [word for name in files for word in (f"--tls-{name}", str(tmp_path / f"{name}.pem"))]
    variables = {"ca-file": "CA_FILE", "cert": "CLIENT__CERT", "key": "CLIENT__KEY"}
    environment = {
        f"DASK_DISTRIBUTED__COMM__TLS__{variables[name]}": str(tmp_path / f"{name}.pem") for name in files
    }
    address = f"tls://127.0.0.1:{free_port()}"
    with started_cluster(address, "--protocol", "tls", *options):
        campaign = CampaignProcess(scene, tmp_path / "with", "--scheduler", address, **environment)
        code, _, err = campaign.end()
        assert code == 0, err
        for given in (address, address.replace("tls", "tcp")):
            code, _, err = run_campaign_process(scene, tmp_path / "without", "--scheduler", given)
            assert code == 2
            assert_one_clear_message(err)
            assert f"--scheduler {given}: expected a Dask scheduler that listens there" in err
    assert read_flat(tmp_path / "with" / "dataset.nc").sizes["run"] == 20


def test_a_scheduler_without_this_package_is_refused_in_one_line(tmp_path: Path) -> None:
    scene, preload = tmp_path / "scene.toml", tmp_path / "lacks.py"
    scene.write_text(frequency_text(10))
    preload.write_text("import sys\nsys.modules['vibroimpact'] = None\n")
    address = f"tcp://127.0.0.1:{free_port()}"
    with started_cluster(address, "--preload", str(preload)):
        code, _, err = run_campaign_process(scene, tmp_path / "campaign", "--scheduler", address)
    assert code == 2
    assert_one_clear_message(err)
    assert "Install vibroimpact where they run" in err


def test_a_full_folder_for_temporary_files_is_named_and_no_defect(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/full/notes")

    monkeypatch.setattr(engine, "open_workers", full)
    with pytest.raises(CampaignError, match=r"/full/notes: .*No space left.*folder for temporary files"):
        run_campaign(scene_of(frequency_text(10)), tmp_path / "campaign", workers=1)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a file system of 300 kB."""
    if shutil.which("mount") is None:
        pytest.skip("there is no mount command")
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(disk)]
    mounted = subprocess.run(command, capture_output=True)
    if mounted.returncode:
        pytest.skip(f"this user may not mount a small disk: {mounted.stderr.decode().strip()}")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


@independent
def test_a_full_disk_ends_the_campaign_with_a_message_and_room_lets_it_go_on(
    uninterrupted: tuple[Path, Path], small_disk: Path
) -> None:
    scene, expected = uninterrupted
    folder = small_disk / "campaign"
    code, _, err = run_campaign_process(scene, folder, *TWO)
    assert code == 1
    assert_one_clear_message(err)
    assert "No space left on device" in err
    assert "the same command" in err
    assert not list(folder.rglob("*.tmp"))
    assert not (folder / "dataset.nc").exists()
    subprocess.run(["mount", "-o", "remount,size=20m", str(small_disk)], check=True)
    assert "were there" in resume(scene, folder)
    assert_same_rows(folder / "dataset.nc", expected)


@pytest.mark.long
def test_a_worker_that_is_killed_again_and_again_does_not_end_the_campaign(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(frequency_text(POINTS, milliseconds=MILLISECONDS))
    wish = tmp_path / "kill"
    campaign = CampaignProcess(
        scene, tmp_path / "campaign", *TWO, runner="OnceDeadlyRunner", VIBROIMPACT_TEST_KILL=str(wish)
    )
    for parts in (2, 4):
        campaign.wait_for_parts(parts)
        wish.touch()
        wait_until(lambda: not wish.exists())
    code, out, err = campaign.end()
    assert code == 0, err
    assert f"{POINTS} points computed" in out
    assert (read_flat(tmp_path / "campaign" / "dataset.nc")["outcome"].values == Outcome.ok).all()
    campaign.assert_nothing_lives()
