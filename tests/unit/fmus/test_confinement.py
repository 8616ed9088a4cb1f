"""Limits of a process that reads untrusted files, whatever a file has made of the process."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from vibroimpact.fmus.confinement import forbid_writing_and_network
from vibroimpact.fmus.processes.python_child import python_command

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="nothing is limited there")

TRIES = """
import errno, json, os, resource, socket, sys
from vibroimpact.fmus import confinement
folder, port, landlock = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "landlock"
if not landlock:
    confinement.forbid_writing_and_network = lambda: 0
confinement.confine(20.0, 1 << 30)

def write(path, mode):
    with open(path, mode) as file:
        file.write("text")

def connect(port):
    socket.create_connection(("127.0.0.1", port), 5.0).close()

tries = {
    "read": lambda: open(f"{folder}/old").read(),
    "make": lambda: write(f"{folder}/new", "w"),
    "change": lambda: write(f"{folder}/old", "r+"),
    "empty": lambda: os.truncate(f"{folder}/old", 0),
    "remove": lambda: os.unlink(f"{folder}/old"),
    "rename": lambda: os.rename(f"{folder}/old", f"{folder}/other"),
    "folder": lambda: os.mkdir(f"{folder}/more"),
    "link": lambda: os.symlink("old", f"{folder}/link"),
    "connect": lambda: connect(port),
    "kill": lambda: os.kill(os.getppid(), 0),
    "memory": lambda: bytearray(1 << 31),
    "limit": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1, 1)),
    "start": lambda: os.execv("/bin/true", ["true"]),
}
found = {}
for name, attempt in tries.items():
    try:
        attempt()
        found[name] = ""
    except OSError as error:
        found[name] = errno.errorcode[error.errno]
    except Exception as error:
        found[name] = type(error).__name__
print(json.dumps(found))
"""


def tried(folder: Path, landlock: bool) -> dict[str, str]:
    """Return the error of each attempt of a confined process; empty for an attempt that succeeded."""
    (folder / "old").write_text("kept")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
        how = "landlock" if landlock else "without"
        command = python_command("-c", TRIES, str(folder), port, how)
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    if not done.stdout:  # it was replaced by the program that it started
        assert not landlock, done.stderr
        return {"start": ""}
    found: dict[str, str] = json.loads(done.stdout)
    return found


def landlock_version() -> int:
    """Return the version of landlock on this machine, found in a separate process."""
    code = "from vibroimpact.fmus.confinement import *; print(forbid_writing_and_network())"
    done = subprocess.run(python_command("-c", code), capture_output=True, text=True, timeout=120, check=True)
    return int(done.stdout)


def test_it_reads_and_changes_nothing_and_reaches_nobody(tmp_path: Path) -> None:
    version = landlock_version()
    if version < 6:
        pytest.skip(f"landlock of version {version} leaves out some of it")
    found = tried(tmp_path, landlock=True)
    assert found.pop("read") == ""
    assert found.pop("memory") == "MemoryError"
    assert found.pop("limit") in ("ValueError", "")  # the superuser may raise it, and landlock stays
    assert set(found.values()) == {"EACCES", "EPERM"}
    assert found["kill"] == "EPERM"
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    assert (tmp_path / "old").read_text() == "kept"


def test_without_landlock_no_file_grows(tmp_path: Path) -> None:
    code = TRIES.replace('    "start": lambda: os.execv("/bin/true", ["true"]),\n', "")
    code = code.replace('    "empty": lambda: os.truncate(f"{folder}/old", 0),\n', "")
    (tmp_path / "old").write_text("kept")
    command = python_command("-c", code, str(tmp_path), "1", "without")
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = json.loads(done.stdout)
    assert (found["read"], found["make"], found["change"]) == ("", "EFBIG", "EFBIG")


@pytest.mark.parametrize("work", ["while True: pass", "import time; time.sleep(60)"])
def test_time_ends_what_computes_and_what_waits(work: str) -> None:
    code = f"from vibroimpact.fmus.confinement import confine; confine(0.1, 1 << 40)\n{work}"
    done = subprocess.run(python_command("-c", code), capture_output=True, timeout=120, check=False)
    assert -done.returncode in (14, 27)  # SIGALRM, SIGPROF


def test_a_kernel_without_landlock_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vibroimpact.fmus.confinement._CREATE_RULESET", 10**6)  # no system call
    assert forbid_writing_and_network() == 0
