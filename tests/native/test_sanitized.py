"""The C tests under the sanitizers, beside all other tests: `make sanitize` runs the same alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_every_c_test_passes_under_the_sanitizers() -> None:
    # one at a time: the other processors have tests of their own
    command = [sys.executable, str(Path(__file__).with_name("run_sanitized.py")), "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(": passed") == len(list(Path(__file__).parent.glob("*.c")))
