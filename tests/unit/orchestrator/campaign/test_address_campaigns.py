"""Campaigns at an address: in the memory of this process, and in S3 as a server of this machine plays it."""

from __future__ import annotations

import errno
import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import fsspec
import pytest
import s3fs
from support.campaign_scenes import assert_same_datasets, axis
from support.command_line import in_this_process
from support.object_store import close_all
from support.serial_pool import Notes, campaign_here
from support.store_scenes import BODY

import vibroimpact.analysis.files.object_lock as object_lock
import vibroimpact.orchestrator.campaign.formats as formats
import vibroimpact.orchestrator.campaign.schedule as schedule
import vibroimpact.orchestrator.campaign.stores.sealing as sealing
from vibroimpact.analysis.files.object_paths import ObjectPath, located
from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted, run_campaign
from vibroimpact.orchestrator.scene import parse_scene

UP = [0.1, 0.2, 0.3, 0.4, 0.5]
FREQUENCY = "forcing.angular_frequency"
MAP = BODY + axis("forcing.amplitude", UP) + "\n" + axis(FREQUENCY, [0.6, 0.8, 1.0, 1.2])
BRANCHES = BODY + axis(FREQUENCY, UP, "up-down") + "\n" + axis("forcing.amplitude", [0.5, 0.6, 0.4])
ADAPTIVE = (
    BODY
    + f'"{FREQUENCY}" = {{ start = 0.5, stop = 1.6, points = 9, adaptive = {{ tolerance = 0.02, at_most = 30 }} }}'
)
SMALL = {"MOST_POINTS": 3, "SHARD_SECONDS": 0.0, "LAST_SHARD_SECONDS": 0.0}
HOME = "memory://map"


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(formats, "SHARD_POINTS", 8)
    monkeypatch.setattr(schedule, "FIRST_POINTS", 3)
    monkeypatch.setattr(object_lock, "BEAT_SECONDS", 0.04)
    monkeypatch.setattr(object_lock, "LEASE_SECONDS", 0.4)
    yield
    fsspec.filesystem("memory").store.clear()


@pytest.fixture
def half(monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the address of a campaign with a sealed shard, a second one in parts, and a part of the third."""
    with monkeypatch.context() as patch:
        for name, value in SMALL.items():
            patch.setattr(schedule, name, value)
        with pytest.raises(CampaignInterrupted, match=f"19 of 20 points are complete in {HOME}"):
            campaign_here(patch, MAP, HOME, most_chunks=8)
    assert (len(objects("seals")), len(objects("parts"))) == (1, 4)
    return HOME


def objects(below: str = "") -> list[str]:
    return [key for key in fsspec.filesystem("memory").store if key.startswith(f"/map/{below}")]


@pytest.mark.parametrize("text", [MAP, BRANCHES, ADAPTIVE, BODY.replace("[sweep]\n", "")])
def test_a_campaign_at_an_address_has_the_dataset_of_a_folder(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in SMALL.items():
        monkeypatch.setattr(schedule, name, value)
    report = campaign_here(monkeypatch, text, HOME)
    assert str(report.dataset) == f"{HOME}/dataset.zarr"
    campaign_here(monkeypatch, text, tmp_path / "file", format="netcdf")
    assert_same_datasets(HOME, tmp_path / "file")
    assert objects("parts") == objects(".lock") == []
    again = campaign_here(monkeypatch, text, HOME)
    assert (again.resumed, again.chunks) == (report.runs, [])


def test_points_in_lanes_go_there_from_this_process(tmp_path: Path) -> None:
    scene = parse_scene(MAP, "test.toml")
    assert run_campaign(scene, HOME).workers == 0
    run_campaign(scene, tmp_path / "file")
    assert_same_datasets(HOME, tmp_path / "file")


def test_an_address_of_files_is_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    report = campaign_here(monkeypatch, MAP, f"file://{tmp_path}/a b")
    assert report.dataset == tmp_path / "a b" / "dataset.nc"


def test_an_interrupted_campaign_goes_on_at_its_address(
    half: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert campaign_here(monkeypatch, MAP, half).resumed == 19
    campaign_here(monkeypatch, MAP, tmp_path / "file")
    assert_same_datasets(half, tmp_path / "file")


@pytest.mark.parametrize(
    "damaged", ["seals/shard", "parts/branch", "dataset.zarr/outcome/c", "campaign.json"]
)
@pytest.mark.parametrize("is_lost", [True, False])
def test_a_damaged_object_is_noticed_and_its_points_come_again(
    damaged: str, is_lost: bool, half: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = fsspec.filesystem("memory")
    key = min(objects(damaged))
    if is_lost:
        system.rm_file(key)
    else:
        content = bytearray(system.cat_file(key))
        content[len(content) // 2] ^= 1
        system.pipe_file(key, bytes(content))
    notes = Notes()
    campaign_here(monkeypatch, MAP, half, notes=notes)
    assert bool(notes.lines) == (not is_lost or damaged in ("dataset.zarr/outcome/c", "campaign.json"))
    campaign_here(monkeypatch, MAP, tmp_path / "file")
    assert_same_datasets(half, tmp_path / "file")


REFUSED: dict[str, tuple[str, formats.DatasetFormat | None, str]] = {
    "another scene": (
        MAP.replace("0.6", "0.7"),
        None,
        "expected the scene that this campaign was started with",
    ),
    "a file": (MAP, "netcdf", "expected the format zarr for a campaign at an address, got netcdf"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_campaigns_that_do_not_go_to_an_address_are_one_line(
    what: str, half: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, format, words = REFUSED[what]
    before = objects()
    with pytest.raises(UsageError, match=f"{half}: {words}") as refused:
        campaign_here(monkeypatch, text, half, format=format)
    assert "\n" not in str(refused.value)
    assert objects() == before


@pytest.mark.parametrize("address", ["nothing://map", "simplecache::memory://map"])
def test_an_address_of_no_kind_is_one_line(address: str) -> None:
    with pytest.raises(UsageError, match=f"{address}: expected an address of fsspec"):
        run_campaign(parse_scene(MAP, "test.toml"), address)


@pytest.mark.parametrize("address", ["s3://", Path("memory://")])
def test_an_address_without_a_name_is_no_folder(address: str | Path) -> None:
    with pytest.raises(UsageError, match="expected a name after the kind of address"):
        run_campaign(parse_scene(MAP, "test.toml"), address)


def test_workers_that_do_not_see_the_memory_of_this_process_are_refused() -> None:
    with pytest.raises(
        UsageError, match=f"{HOME}: expected .* every worker reads and writes, got 1 that do not"
    ):
        run_campaign(parse_scene(MAP, "test.toml"), HOME, workers=1)


def test_a_second_campaign_at_an_address_is_refused_while_the_first_lives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    home = ObjectPath(HOME)
    with object_lock.locked_address(home, print) as refuse_lost:
        with pytest.raises(UsageError, match=f"{HOME}: .* another campaign is running"):
            campaign_here(monkeypatch, MAP, HOME)
        refuse_lost()
        assert json.loads((home / ".lock").read_bytes())["beat"] > 1
    assert not (home / ".lock").exists()


def test_the_lock_of_a_dead_campaign_is_taken_over_after_its_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    home, notes = located(HOME), Notes()
    (home / ".lock").write_bytes(b'{"owner": "dead"}')
    assert campaign_here(monkeypatch, MAP, HOME, notes=notes).runs == 20
    assert "the lock of a campaign without a beat" in notes.lines[0]
    assert not (home / ".lock").exists()


def test_a_campaign_whose_lock_was_taken_over_gives_up_and_leaves_the_lock() -> None:
    home, lock = ObjectPath(HOME), ObjectPath(f"{HOME}/.lock")
    with object_lock.locked_address(home, print) as refuse_lost:
        lock.write_bytes(b'{"owner": "other"}')
        threading.Event().wait(0.2)
        lock.write_bytes(b'{"owner": "other"}')  # a beat between the look and the write of this one
        threading.Event().wait(0.2)
        with pytest.raises(CampaignError, match="another campaign has taken over"):
            refuse_lost()
    assert b"other" in lock.read_bytes()


class Requests:
    """Requests to the object store in memory: each takes some milliseconds; that of one object may fail."""

    def __init__(self, patch: pytest.MonkeyPatch, failing: str = "") -> None:
        self.seen: list[tuple[str, str, float, float]] = []
        sealing._writer.cache_clear()  # it keeps a file system
        kind = fsspec.get_filesystem_class("memory")
        for name in ("pipe_file", "cat_file", "info", "rm_file"):
            patch.setattr(kind, name, self._slow(name, getattr(kind, name), failing))

    def _slow(self, name: str, request: Callable[..., object], failing: str) -> Callable[..., object]:
        def slow(system: object, path: str, *arguments: object, **options: object) -> object:
            began = time.perf_counter()
            time.sleep(0.01)
            if failing and path.endswith(failing):
                raise OSError(errno.EIO, "no answer", path)
            try:
                return request(system, path, *arguments, **options)
            finally:
                self.seen.append((name, "/" + path.lstrip("/"), began, time.perf_counter()))

        return slow


def test_the_objects_of_a_shard_are_written_at_once_and_its_seal_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as patch:
        requests = Requests(patch)
        campaign_here(patch, MAP, HOME)
    written = {path: (began, ended) for name, path, began, ended in requests.seen if name == "pipe_file"}
    for number in range(3):
        seal = f"/map/seals/shard-{number:06d}.json"
        keys = json.loads(fsspec.filesystem("memory").cat_file(seal))["objects"]
        spans = [written[f"/map/dataset.zarr/{key}"] for key in keys]
        first, last = min(began for began, _ in spans), max(ended for _, ended in spans)
        assert last <= written[seal][0]
        assert max(sum(began <= at < ended for began, ended in spans) for at, _ in spans) >= 3
        among = [(name, path) for name, path, began, _ in requests.seen if first < began < last]
        assert [name for name, path in among if "/dataset.zarr/" in path] == ["pipe_file"] * (len(keys) - 1)


@pytest.mark.parametrize("failing", ["outcome/c/1/0", "impact_time/c/2/0", "seals/shard-000001.json"])
def test_a_request_that_fails_is_one_line_and_loses_no_other_shard(
    failing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        Requests(patch, failing)
        with pytest.raises(CampaignError, match="no answer") as gone:
            campaign_here(patch, MAP, HOME)
    sealing._writer.cache_clear()
    assert "\n" not in str(gone.value)
    sealed = objects("seals/shard")
    number = int(failing.split("/")[2] if "/c/" in failing else 1)
    assert f"/map/seals/shard-{number:06d}.json" not in sealed
    assert campaign_here(monkeypatch, MAP, HOME).resumed >= 8 * len(sealed)
    campaign_here(monkeypatch, MAP, tmp_path / "file")
    assert_same_datasets(HOME, tmp_path / "file")


def test_a_campaign_in_a_bucket_has_the_dataset_of_a_folder(
    bucket: s3fs.S3FileSystem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = BODY + axis(FREQUENCY, [0.6, 0.8])
    campaign_here(monkeypatch, small, "s3://bucket/map")
    campaign_here(monkeypatch, small, tmp_path / "file")
    assert_same_datasets("s3://bucket/map", tmp_path / "file")
    inside = ("campaign.json", "dataset.zarr", "seals")
    assert sorted(bucket.ls("bucket/map")) == [f"bucket/map/{name}" for name in inside]


def test_a_bucket_that_is_gone_or_refuses_is_one_line(
    bucket: s3fs.S3FileSystem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, endpoint: str
) -> None:
    file = tmp_path / "map.toml"
    file.write_text(MAP)
    done = in_this_process("campaign", file, "-o", "s3://gone/map")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert done.stderr.startswith("s3://gone/map: expected an address that can be written, got ")
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    close_all()
    done = in_this_process("campaign", file, "-o", "s3://bucket/map")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    close_all()
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)


@pytest.mark.long  # 1,600 requests to a server in this process
def test_two_workers_go_on_after_a_bucket_was_out_of_reach(
    bucket: s3fs.S3FileSystem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, endpoint: str
) -> None:
    home, write = "s3://bucket/map", ObjectPath.write_bytes

    def failing(path: ObjectPath, content: bytes) -> None:
        if path.name == "shard-000002.json":
            monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
            close_all()
        write(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(ObjectPath, "write_bytes", failing)
        with pytest.raises(CampaignError, match="s3://bucket/map") as gone:
            campaign_here(monkeypatch, MAP, home)
    assert "\n" not in str(gone.value)
    close_all()
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    report = run_campaign(
        parse_scene(MAP, "test.toml"), home, workers=2, runner="support.busy_runner:SceneRunner"
    )
    assert (report.workers, report.resumed, report.runs) == (2, 16, 20)
    campaign_here(monkeypatch, MAP, tmp_path / "file")
    assert_same_datasets(home, tmp_path / "file")
