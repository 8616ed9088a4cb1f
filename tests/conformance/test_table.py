"""The table of NI's tests: the category of each outcome."""

from __future__ import annotations

from pathlib import Path

from conformance._reasons import reason_not_run
from conformance._table import HEADING, Outcome, failures, one_for_each, section, write_section

FILE = "tests/component/task/test_timing.py"
OUTCOMES = [
    Outcome(f"{FILE}::one", "passed"),
    Outcome(f"{FILE}::two", "passed"),
    Outcome(f"{FILE}::two", "failed", "at its end"),
    Outcome(f"{FILE}::three", "refused", "not modelled"),
    Outcome("tests/component/test_interpreter.py::hardcoded_error_message", "failed", "other words"),
]


def test_a_test_counts_once_with_its_worst_outcome_and_fails_unless_a_reason_is_known() -> None:
    found = one_for_each(OUTCOMES)
    assert [each.outcome for each in found] == ["passed", "failed", "refused", "failed"]
    assert [each.test for each in failures(found)] == [f"{FILE}::two"]
    text = section(found, "1.7.0", "abc")
    assert "| `task/test_timing.py` | 1 | 1 |  |  | 1 |" in text
    assert "| `test_interpreter.py` |  |  |  | 1 |  |" in text


def test_a_section_takes_the_place_of_the_last_one(tmp_path: Path) -> None:
    page = tmp_path / "rig.md"
    page.write_text("# Rigs\n\nText.\n", encoding="utf-8")
    write_section(page, f"{HEADING}\n\nold\n")
    page.write_text(page.read_text(encoding="utf-8") + "\n## More\n\nleft\n", encoding="utf-8")
    write_section(page, f"{HEADING}\n\nnew\n")
    assert page.read_text(encoding="utf-8") == f"# Rigs\n\nText.\n\n{HEADING}\n\nnew\n\n## More\n\nleft\n"


def test_files_of_other_kinds_of_channels_are_not_run() -> None:
    assert reason_not_run(FILE) is None
    for name in ("test_stream_readers_ci.py", "stream_readers/test_digital_multi_channel_reader.py"):
        assert reason_not_run(f"tests/component/{name}")
