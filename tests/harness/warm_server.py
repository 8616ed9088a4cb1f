"""A process that has imported the package and forks: each copy runs a program as `python -u -c` would.

It has no threads. A copy takes over folder, environment, streams and process group from the request. Then it continues
at the end of this file, like a Python that has just started.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import io
import json
import os
import selectors
import signal
import socket
import sys
import tempfile
import threading
import time
import warnings
from typing import Any, NoReturn

import dask.config

from harness.warm import refuse_threads

MOST_BYTES = 1 << 20
"""Longest request, bytes."""


def import_all() -> None:
    """Import every module of the package, and the late imports of its commands."""
    import importlib
    import pkgutil

    import vibroimpact

    names = [module.name for module in pkgutil.walk_packages(vibroimpact.__path__, "vibroimpact.")]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in (*names, *LATE):
            if not name.startswith(PROGRAMS):
                importlib.import_module(name)
    refuse_threads()


PROGRAMS = ("vibroimpact.fmus.python",)
"""Modules that only run in processes of their own."""
LATE = (
    "matplotlib.backends.backend_agg",
    "matplotlib.pyplot",
    "distributed",
    "dask.__main__",
    "uvicorn",
    "grpc",
)


class _Server:
    """Takes requests at a socket, one connection each, and answers with process number and end of each copy."""

    def __init__(self, path: str) -> None:
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(path)
        self._listener.listen(64)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._connections: dict[int, socket.socket] = {}
        read, write = os.pipe()
        for end in (read, write):
            os.set_blocking(end, False)
        self._child_ended, self._wakes = read, write
        signal.set_wakeup_fd(write)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        self._selector.register(read, selectors.EVENT_READ)
        # the starter of this process holds the other end of its standard input
        self._selector.register(0, selectors.EVENT_READ)

    def serve(self) -> str:
        """Return the program, in a copy; end this process when its standard input ends."""
        while True:
            for key, _ in self._selector.select():
                if key.fileobj is self._listener:
                    program = self._accept()
                    if program is not None:
                        return program
                elif key.fd == self._child_ended:
                    os.read(self._child_ended, 4096)
                elif not os.read(0, 1):
                    self._end()
            self._reap()

    def _end(self) -> NoReturn:
        """End this process and the copies left by killed tests."""
        for pid in self._connections:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGKILL)
        os._exit(0)

    def _accept(self) -> str | None:
        connection, _ = self._listener.accept()
        data, streams, _, _ = socket.recv_fds(connection, MOST_BYTES, 3)
        if not data:
            connection.close()
            return None
        while not data.endswith(b"\n"):
            data += connection.recv(MOST_BYTES)
        request = json.loads(data)
        has_become, says_so = os.pipe()
        pid = os.fork()
        if not pid:
            self._leave(connection)
            os.close(has_become)
            become(request, streams)
            os.close(says_so)
            return str(request["program"])
        for stream in (says_so, *streams):
            os.close(stream)
        # only now can the copy be killed by its process group
        os.read(has_become, 1)
        os.close(has_become)
        connection.sendall(f"{pid}\n".encode())
        self._connections[pid] = connection
        return None

    def _leave(self, connection: socket.socket) -> None:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        self._selector.close()
        for one in (self._listener, connection, *self._connections.values()):
            one.close()
        os.close(self._child_ended)
        os.close(self._wakes)

    def _reap(self) -> None:
        while self._connections:
            pid, status, used = os.wait4(-1, os.WNOHANG)
            if not pid:
                return
            if pid in self._connections:
                with self._connections.pop(pid) as connection:
                    answer = {
                        "code": os.waitstatus_to_exitcode(status),
                        "seconds": used.ru_utime + used.ru_stime,
                    }
                    try:
                        connection.sendall(json.dumps(answer).encode() + b"\n")
                    except BrokenPipeError:
                        continue  # nobody waits for it any more


def become(request: dict[str, Any], streams: list[int]) -> None:
    """Turn this copy into the requested Python, as if just started."""
    if request["session"]:
        os.setsid()
    else:
        os.setpgid(0, 0)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.argv = ["-c", *request["arguments"]]
    more = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    sys.path[:0] = [folder for folder in more if folder not in sys.path]
    for stream in (sys.stdout, sys.stderr):
        assert isinstance(stream, io.TextIOWrapper)
        stream.reconfigure(write_through=True)
    # decisions that depend on the environment are made anew
    tempfile.tempdir = None
    time.tzset()
    dask.config.refresh()


def main() -> NoReturn:
    """Import the package and serve; in each copy, run its program."""
    import_all()
    gc.collect()
    gc.freeze()
    server = _Server(sys.argv[1])
    print("ready", flush=True)
    run(server.serve())


def run(program: str) -> NoReturn:
    """Run a program as `python -c` does, and end this process without freeing its memory object by object."""
    code = 1
    try:
        exec(compile(program, "<string>", "exec"), vars(sys.modules["__main__"]))
        code = 0
    except SystemExit as left:
        code = _exit_code(left.code)
    except KeyboardInterrupt:
        sys.excepthook(*sys.exc_info())
        code = -signal.SIGINT
    except BaseException:
        sys.excepthook(*sys.exc_info())
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.flush()
    try:
        sys.stdout.flush()
    except OSError as error:
        print(f"Exception ignored in: <stdout>\n{error}", file=sys.stderr, flush=True)
        code = 120
    if code < 0:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    os._exit(code)


def _exit_code(given: object) -> int:
    if given is None or isinstance(given, int):
        return (given or 0) & 0xFF
    print(given, file=sys.stderr)
    return 1
