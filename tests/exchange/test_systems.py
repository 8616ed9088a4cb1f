"""A scene of components as an SSP archive in other tools: our own run to 1e-9, with nothing set and nothing edited.

If a gain is a component and a tool exchanges values once a step, the springs answer one step late. The reference is
then a motion with such springs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from exchange._cases import difference
from exchange._systems import COUNT, NAMES, PAIRS, STEP, made
from exchange._tools import Tool, run_system

HERE = [pair for pair in PAIRS if pair[0].package or not pair[0].missing()]


@pytest.mark.parametrize(
    ("tool", "fmi", "gains"), HERE, ids=[f"{tool.name}, FMI {fmi}, {gains}" for tool, fmi, gains in HERE]
)
def test_a_system_in_another_tool_is_our_own_run(tmp_path: Path, tool: Tool, fmi: str, gains: str) -> None:
    if reason := tool.missing():
        pytest.skip(reason)
    system, expected = made(tmp_path, tool, fmi, gains)
    rows = np.array(run_system(tool, system, NAMES, STEP, COUNT, tmp_path).rows)
    assert rows.shape == expected.shape == (COUNT, len(NAMES))
    assert np.ptp(expected[:, NAMES.index("b.displacement")]) > 0.9
    assert difference(rows, expected) <= 1e-9
