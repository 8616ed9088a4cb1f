"""Uploads that a killed service has left behind are removed at the next start; other files in the folder stay."""

from __future__ import annotations

from pathlib import Path

from vibroimpact.service.routes.uploads import Uploads


def test_uploads_of_a_killed_service_are_removed(tmp_path: Path) -> None:
    left, kept = tmp_path / ".upload-0123abcd", tmp_path / "recordings"
    for folder in (left, kept):
        folder.mkdir()
        (folder / "tip.csv").write_text("1,2\n")
    Uploads(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["recordings"]
    assert (kept / "tip.csv").read_text() == "1,2\n"
