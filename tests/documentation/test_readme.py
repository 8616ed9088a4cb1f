"""The README is true and short: its Python prints the output that stands there, and its commands run."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from support.command_line import in_this_process
from support.places import EXAMPLES, ROOT
from support.still_clock import stop_the_clock

from vibroimpact.orchestrator.hard_cases import CASES

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
COMMANDS = [
    line for language, block in BLOCKS for line in block.splitlines() if line.startswith("vibroimpact ")
]
MOST_LINES, MOST_WORDS, MOST_ROWS = 90, 350, 20


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "examples").symlink_to(EXAMPLES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_python_of_the_readme_prints_what_stands_below_it(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = next(place for place, (language, _) in enumerate(BLOCKS) if language == "python")
    code, shown = BLOCKS[place][1], BLOCKS[place + 1][1]
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert capsys.readouterr().out == shown
    assert names["figure"]


def test_the_commands_of_the_readme_run_and_leave_their_files(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_the_clock(monkeypatch)
    assert len(COMMANDS) == 9
    for command in COMMANDS:
        words = shlex.split(command, comments=True)[1:]
        done = in_this_process(*words)
        assert done.returncode == 0, done.stderr
        if "-o" in words:
            assert (folder / words[words.index("-o") + 1]).exists()


def test_the_readme_counts_hard_cases_and_scenes_of_the_thesis() -> None:
    assert f"\n- {len(CASES)} [hard cases](docs/hard_cases.md)" in TEXT
    assert f"\n- {len(list((EXAMPLES / 'thesis').glob('*.toml')))} [scenes of a thesis]" in TEXT


def test_every_command_in_the_tables_of_the_readme_has_a_help() -> None:
    rows = [line.split("|")[2] for line in TEXT.splitlines() if line.startswith("|")]
    commands = {name for row in rows for name in re.findall(r"`([a-z -]+)`", row)} - {"make help"}
    assert len(commands) > 20
    for command in commands:
        name, _, option = command.partition(" --")
        done = in_this_process(*name.split(), "--help")
        assert done.returncode == 0, done.stderr
        assert f"--{option.partition(' ')[0]}" in done.stdout


def test_the_readme_is_a_screen_and_a_half() -> None:
    rows = [line for line in TEXT.splitlines() if line.startswith("|")]
    prose = re.sub(r"^```.*?^```$|^\|.*?$", "", TEXT, flags=re.MULTILINE | re.DOTALL)
    assert len(TEXT.splitlines()) <= MOST_LINES
    assert len(prose.split()) <= MOST_WORDS
    assert len(rows) - 2 <= MOST_ROWS
