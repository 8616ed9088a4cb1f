"""The page on other people's solvers has exactly the measured results."""

from __future__ import annotations

import json
import sys

import pytest
from support.places import ROOT

sys.path.append(str(ROOT / "tests" / "benchmarks"))

from peers.page import GOAL_ERROR, measurement, with_measurement

PAGE = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
RECORD = json.loads((ROOT / "docs" / "accuracy" / "peers.json").read_text(encoding="utf-8"))


def test_the_page_is_made_of_the_record() -> None:
    assert with_measurement(PAGE, RECORD) == PAGE


def test_every_row_has_an_error_or_says_what_failed() -> None:
    assert {row["case"] for row in RECORD["rows"]} == {case["key"] for case in RECORD["cases"]}
    assert [row for row in RECORD["rows"] if row["failure"] == "" and row["error"] is None] == []


def test_a_cheaper_peer_makes_the_goal_missed() -> None:
    rows = [dict(row) for row in RECORD["rows"]]
    row = next(r for r in rows if r["way"] == "solve_ivp DOP853" and r["case"] == "orbit")
    row |= {"error": 0.1 * GOAL_ERROR, "cost": rows[0]["cost"]}
    said = measurement(RECORD | {"rows": rows})
    assert "| P(1,1) orbit | **missed** | solve_ivp DOP853, rtol 0.001 | 1 |" in said


def test_a_page_without_markers_is_refused() -> None:
    with pytest.raises(ValueError, match="expected the markers"):
        with_measurement("# nothing", RECORD)
