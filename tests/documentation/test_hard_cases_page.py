"""The page on hard cases has the list of the command."""

from __future__ import annotations

from runpy import run_path

from support.places import ROOT

from vibroimpact.orchestrator.hard_cases import CASES

PAGE = ROOT / "docs" / "hard_cases.md"


def test_the_table_of_the_page_is_that_of_the_cases() -> None:
    with_case_table = run_path(str(ROOT / "docs" / "site" / "case_table.py"))["with_case_table"]
    page = PAGE.read_text(encoding="utf-8")
    assert with_case_table(page) == page, "Run `python docs/site/case_table.py docs/hard_cases.md`."
    assert all(f"| `{case.name}` |" in page for case in CASES)
