"""Every lean FMU in every tool that speaks its version is our own run to 1e-9, with nothing set and nothing edited."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from exchange._cases import COUNT, NAMES, RATE, difference, made, outputs
from exchange._tools import TOOLS, Tool, values

# programs that are not here are named by `make exchange` alone
PAIRS = [(tool, fmi) for tool in TOOLS for fmi in tool.versions if tool.package or not tool.missing()]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("tool", "fmi"), PAIRS, ids=[f"{tool.name}, FMI {fmi}" for tool, fmi in PAIRS])
def test_an_export_in_another_tool_is_our_own_run(tmp_path: Path, tool: Tool, fmi: str, name: str) -> None:
    if reason := tool.missing():
        pytest.skip(reason)
    path, expected = made(name, fmi, tmp_path)
    rows = np.array(values(tool, path, outputs(name), 1.0 / RATE, COUNT, tmp_path))
    assert rows.shape == expected.shape
    assert np.ptp(expected[:, 0]) > 0.0 or name == "impact stop"
    assert difference(rows, expected) <= 1e-9
