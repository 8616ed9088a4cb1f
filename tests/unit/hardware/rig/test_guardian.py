"""The guardian of an output ends the driving program, also one that ends by itself at that moment."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from typing import cast

import pytest

from vibroimpact.hardware.rig.guardian import Watch
from vibroimpact.hardware.rig.guarding import Order
from vibroimpact.hardware.rig.memory import SharedSamples

ORDER = Order("Dev1/ao0", 1e4, 3.0, 500.0, "vibroimpact", "", False, 0, 0, 0)


def test_a_program_that_is_gone_before_the_signal_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    program = subprocess.Popen([sys.executable, "-c", ""])
    program.wait()  # from here on its id names no process
    parents = iter([program.pid, os.getpid()])
    monkeypatch.setattr(os, "getppid", lambda: next(parents))
    memory = cast("SharedSamples", None)  # the end of a program needs none
    Watch(replace(ORDER, program=program.pid), memory, lambda: True).end_program()
    assert list(parents) == []
