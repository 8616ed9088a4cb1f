"""Files that crash, delay or deceive the libraries which read them: one line, and no process is left."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import netCDF4
import numpy as np
import psutil
import pytest
from harness import warm
from support.command_line import in_this_process
from support.dataset_examples import up_down

from vibroimpact.analysis import open_dataset, write_dataset
from vibroimpact.analysis.dataset import open_measured, read_flat, read_part
from vibroimpact.analysis.files import probing
from vibroimpact.analysis.files.fingerprints import LINE_LENGTH
from vibroimpact.analysis.files.opening import file_attributes
from vibroimpact.analysis.files.probing import UnsoundFileError, check_sound
from vibroimpact.analysis.recording import (
    Channel,
    Recording,
    TimeAxis,
    is_recording,
    open_recording,
    open_signals,
    write_recording,
)
from vibroimpact.fmus import reader_process
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.reader_process import Answer, Order, ReaderServer

DOORS = (open_dataset, open_measured, read_flat, read_part, open_recording, open_signals)
CHILD = """
import os, signal, sys, time
from vibroimpact.analysis.files import netcdf_values
from vibroimpact.fmus import reader_child
def read(path, options):
    if b"damaged" in open(path, "rb").read():
        {what}
    return None, ()
netcdf_values.read = read
reader_child.main()
"""


@pytest.fixture(autouse=True)
def probes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Use a server and a cache of the test's own; yield the names of the files that it was to read."""
    server, asked = ReaderServer(), []
    original = server.ask

    def ask(order: Order) -> Answer:
        asked.append(Path(order.path).name)
        return original(order)

    monkeypatch.setattr(server, "ask", ask)
    monkeypatch.setattr(reader_process, "_server", server)
    monkeypatch.setattr(reader_process, "FORKS", False)
    monkeypatch.setattr(probing, "_of_files", {})
    monkeypatch.setattr(probing, "_of_contents", {})
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))
    yield asked
    server.close()


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Return a function that lets damaged files do something to the process that reads them."""

    def set_up(what: str) -> None:
        child = tmp_path / "child.py"
        child.write_text(CHILD.format(what=what))
        monkeypatch.setattr(reader_process, "_CHILD", child)

    return set_up


def old_dataset(path: Path) -> Path:
    """Write a dataset as version 0.1 did, without its hash."""
    write_dataset(up_down(), path)
    os.truncate(path, path.stat().st_size - LINE_LENGTH)
    return path


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget all verdicts, as in a new process."""
    monkeypatch.setattr(probing, "_of_files", {})
    monkeypatch.setattr(probing, "_of_contents", {})


def recording() -> Recording:
    axis = TimeAxis(np.arange(5) / 10, 0.1)
    return Recording({"a": Channel("a", np.ones(5), "m", axis, np.zeros(5, np.uint8))}, {}, {})


def test_what_ends_with_its_hash_is_opened_directly(tmp_path: Path, probes: list[str]) -> None:
    write_dataset(up_down(), tmp_path / "runs.nc")
    write_recording(recording(), tmp_path / "recording.nc")
    with open_dataset(tmp_path / "runs.nc"):
        assert is_recording(tmp_path / "recording.nc")
    assert open_recording(tmp_path / "recording.nc").channels.keys() == {"a"}
    assert probes == []


def test_a_file_of_version_0_1_is_read_by_a_process_of_its_own_once_for_all_processes(
    tmp_path: Path, probes: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = old_dataset(tmp_path / "runs.nc")
    for _ in range(3):
        read_flat(path)
        assert "results_kind" not in file_attributes(path)
    assert probes == ["runs.nc"]
    forget(monkeypatch)
    read_part(path.rename(tmp_path / "copy.nc"))
    assert probes == ["runs.nc"]


def test_other_content_under_an_old_name_is_looked_at_again(tmp_path: Path, probes: list[str]) -> None:
    path = old_dataset(tmp_path / "runs.nc")
    read_flat(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2 :] = bytes(len(content) - len(content) // 2)
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=r"runs\.nc: expected a readable NetCDF dataset"):
        read_flat(path)
    assert probes == ["runs.nc", "runs.nc"]


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", r"crashes the library which reads it \(SIGSEGV\)"),
        ("os._exit(0)", "crashes the library"),
        ("os._exit(1)", "crashes the library"),
        ("raise KeyError('x')", "got KeyError: 'x'"),
        ("raise SystemExit(0)", "got SystemExit: 0"),
        ("[0] * 10**12", "got MemoryError"),
        ('print(\'{"verdict": "read"}\', flush=True); os.abort()', "crashes the library"),
    ],
)
def test_whatever_a_file_does_to_its_reader_is_one_line(
    tmp_path: Path, reader: Callable[[str], None], what: str, said: str
) -> None:
    reader(what)
    path = tmp_path / "file.nc"
    path.write_bytes(b"a damaged file")
    for door in DOORS[:3]:
        with pytest.raises(DatasetError, match=said) as caught:
            door(path)
        assert str(caught.value).startswith(f"{path}: expected a readable NetCDF dataset")
        assert "\n" not in str(caught.value)
    (tmp_path / "other.nc").write_bytes(b"whole")
    check_sound(tmp_path / "other.nc")


def test_a_file_whose_reading_does_not_end_is_given_up(
    tmp_path: Path, reader: Callable[[str], None], probes: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    reader(
        "signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}); (lambda: [None for _ in iter(int, 1)])()"
    )
    monkeypatch.setattr(probing, "PROBE_SECONDS", 0.3)
    path = tmp_path / "file.nc"
    path.write_bytes(b"a damaged file")
    done = in_this_process("plot", path, "-o", tmp_path / "figure.png")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert (
        f"{path}: expected a readable NetCDF dataset, got one that the library had not read after"
        in done.stderr
    )
    assert probes == ["file.nc"]
    assert not (tmp_path / "figure.png").exists()


def test_a_killed_program_leaves_no_process_that_reads(tmp_path: Path, reader: Callable[[str], None]) -> None:
    reader("time.sleep(60)")
    path = tmp_path / "file.nc"
    path.write_bytes(b"a damaged file")
    code = (
        "import sys; from pathlib import Path; from vibroimpact.analysis import open_dataset\n"
        "from vibroimpact.fmus import reader_process\n"
        "reader_process.FORKS = False; reader_process._CHILD = Path(sys.argv[1]); open_dataset(sys.argv[2])"
    )
    program = warm.start(code, reader_process._CHILD, path, stdout=None, stderr=None)
    _wait_until(lambda: len(_readers(program.pid)) == 2)
    below = _readers(program.pid)
    program.kill()
    program.wait()
    _wait_until(lambda: not any(process.is_running() and process.status() != "zombie" for process in below))


def _readers(process: int) -> list[psutil.Process]:
    """Return the process below another that reads files, and the process that it has made for the file it reads."""
    return psutil.Process(process).children(recursive=True)


def _wait_until(happened: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Let this process receive SIGINT: a shell that starts tests in the background makes them ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_during_the_look_ends_it_and_the_next_file_is_read(
    tmp_path: Path, reader: Callable[[str], None]
) -> None:
    reader("time.sleep(60)")
    path = tmp_path / "file.nc"
    path.write_text("a damaged file")
    server = reader_process._server

    def interrupt() -> None:
        _wait_until(lambda: server._process is not None and len(_readers(server._process.pid)) == 1)
        os.kill(os.getpid(), signal.SIGINT)

    meanwhile = threading.Thread(target=interrupt)
    meanwhile.start()
    with pytest.raises(KeyboardInterrupt):
        check_sound(path)
    meanwhile.join()
    (tmp_path / "other.nc").write_bytes(b"whole")
    check_sound(tmp_path / "other.nc")


def test_a_process_that_ended_for_want_of_work_is_started_again(
    tmp_path: Path, probes: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    read_flat(old_dataset(tmp_path / "runs.nc"))
    process = reader_process._server._process
    assert process is not None
    process.kill()
    process.wait()
    with netCDF4.Dataset(tmp_path / "other.nc", "w") as file:
        file.title = "another"
    check_sound(tmp_path / "other.nc")
    assert probes == ["runs.nc", "other.nc"]


def test_a_file_that_changes_between_look_and_opening_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = old_dataset(tmp_path / "runs.nc")

    def ask(order: Order) -> Answer:
        path.write_bytes(path.read_bytes() + b"more")
        return Answer("read")

    monkeypatch.setattr(reader_process._server, "ask", ask)
    with pytest.raises(DatasetError, match="changed while it was being opened"):
        read_flat(path)


@pytest.mark.parametrize("door", DOORS)
def test_a_pipe_a_folder_or_a_device_is_no_file(tmp_path: Path, door: Callable[[Path], object]) -> None:
    os.mkfifo(tmp_path / "pipe.nc")
    for path in (tmp_path / "pipe.nc", Path("/dev/zero")):
        with pytest.raises(DatasetError, match="no regular file"):
            door(path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(DatasetError):
        door(tmp_path / "folder")


def test_a_file_that_promises_more_than_it_can_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("run", 10**9)
        file.createVariable("run_index", "i4", ("run",), chunksizes=(1000,))
    with pytest.raises(DatasetError, match="promises 4000000000 bytes of values"):
        read_flat(path)


def test_only_so_many_contents_are_remembered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(probing, "MOST_REMEMBERED", 4)
    for number in range(7):
        with netCDF4.Dataset(tmp_path / "file.nc", "w") as file:
            file.number = number
        check_sound(tmp_path / "file.nc")
    remembered = probing._memory()
    assert 2 <= len(remembered.read_text().splitlines()) <= 4
    assert remembered.parent.stat().st_mode & 0o777 == 0o700


def test_a_cache_that_others_may_write_is_not_believed(
    tmp_path: Path, probes: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = old_dataset(tmp_path / "runs.nc")
    read_flat(path)
    (tmp_path / "cache").chmod(0o777)
    forget(monkeypatch)
    read_flat(path)
    assert probes == ["runs.nc", "runs.nc"]


def test_a_process_made_by_fork_has_a_server_of_its_own(tmp_path: Path) -> None:
    code = (
        "import os, sys; from vibroimpact.analysis.files.probing import check_sound\n"
        "from vibroimpact.fmus import reader_process; _server = reader_process._server\n"
        "reader_process.FORKS = False\n"
        "check_sound(sys.argv[1]); child = os.fork()\n"
        "if child == 0:\n    check_sound(sys.argv[2]); _server.close(); os._exit(7)\n"
        "assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7; check_sound(sys.argv[3])"
    )
    paths = [tmp_path / f"{number}.nc" for number in range(3)]
    for path in paths:
        with netCDF4.Dataset(path, "w") as file:
            file.title = path.name
    done = warm.run("import warnings; warnings.simplefilter('ignore')\n" + code, *paths)
    assert done.returncode == 0, done.stderr


def test_an_unsound_file_says_what_the_library_raised(tmp_path: Path) -> None:
    (tmp_path / "file.nc").write_bytes(b"no file of any kind")
    with pytest.raises(UnsoundFileError) as caught:
        check_sound(tmp_path / "file.nc")
    assert caught.value.raised == "OSError"
    assert signal.getsignal(signal.SIGALRM) == signal.SIG_DFL
