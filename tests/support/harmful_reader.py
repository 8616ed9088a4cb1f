"""A reader of matrices that crashes, fails, writes, or answers with facts that do not fit its arrays."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vibroimpact.orchestrator.structures.readers import child


def read(path: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """Read a matrix in the way that the options name."""
    if options["way"] == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if options["way"] == "memory":
        raise MemoryError
    if options["way"] == "error":
        raise KeyError("what no reader foresaw")
    if options["way"] == "write":
        Path(path).write_text("other")
    facts, buffers = child.read(path, {"names": {"stiffness": ""}, "optional": []})
    return {**facts, **options.get("facts", {})}, buffers
