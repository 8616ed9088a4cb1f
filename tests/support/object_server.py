"""An object store as a process of its own, which outlives the programs that are killed beside it.

It prints its address, and ends with its standard input. While the file of its first argument is there, half of the
requests fail.
"""

from __future__ import annotations

import logging
import os
import random
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import WSGIRequestHandler, make_server

PROGRAM = "from support.object_server import main; main()"
FAILING = 0.5
"""Share of the requests that fail."""


class _Quiet(WSGIRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_request(self, *_: object) -> None:
        """Print nothing."""


def main() -> None:
    """Serve until the standard input ends."""
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    switch, chance = Path(sys.argv[1]), random.Random(1)
    store = DomainDispatcherApplication(create_backend_app)

    def answer(environ: dict[str, Any], begin: Callable[..., Any]) -> Iterable[bytes]:
        if switch.exists() and chance.random() < FAILING:
            environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
            begin("503 Slow Down", [("Content-Length", "0")])
            return [b""]
        found: Iterable[bytes] = store(environ, begin)
        return found

    server = make_server("127.0.0.1", 0, answer, threaded=True, request_handler=_Quiet)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(f"http://127.0.0.1:{server.server_address[1]}", flush=True)
    sys.stdin.read()


@contextmanager
def served_apart(switch: Path) -> Iterator[str]:
    """Serve S3 in a process of its own, and yield the URL of the server."""
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", PROGRAM, str(switch.absolute())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.stdin.close()
