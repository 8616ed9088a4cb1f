"""FMPy as this package imports it."""

from __future__ import annotations

import subprocess
import sys

import pytest

IMPORTS = """
import ctypes.util, sys
find_library, started = ctypes.util.find_library, []
sys.addaudithook(lambda event, given: started.append(given[0]) if event == "subprocess.Popen" else None)
from vibroimpact.fmus.packaging import fmpy_door
import fmpy
assert ctypes.util.find_library is find_library
assert fmpy.calloc(1, 8)
print(started)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no process is started to find a library")
def test_fmpy_is_imported_without_starting_a_process() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORTS], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("[]\n", "")
