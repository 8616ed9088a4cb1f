"""The origin of a dataset, and the cost of finding it."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

from vibroimpact.analysis.dataset import provenance


def test_git_is_asked_once_in_a_process(monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[list[str]] = []
    run = subprocess.run

    def noted(command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        commands.append(command)
        return run(command, **options)

    monkeypatch.setattr(subprocess, "run", noted)
    provenance.git_commit.cache_clear()
    commits = {provenance.git_commit() for _ in range(3)}
    assert len(commits) == 1
    assert [command[0] for command in commands] == ["git"]
