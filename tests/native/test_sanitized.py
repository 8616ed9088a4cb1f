"""The C tests under the sanitizers, as part of all tests; `make sanitize` runs them alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_every_c_test_passes_under_the_sanitizers() -> None:
    # one at a time, since other tests use the other processors
    command = [sys.executable, str(Path(__file__).with_name("run_sanitized.py")), "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(": passed") == len(list(Path(__file__).parent.glob("*.c")))
