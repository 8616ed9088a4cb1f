"""Untrusted text on the terminal: escapes are shown, not obeyed."""

from __future__ import annotations

import io
import unicodedata
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from rich.table import Table
from support.command_line import in_this_process

from vibroimpact.fmus.printable import printable
from vibroimpact.fmus.terminal import Terminal

HOSTILE = "a\x1b[31mb\x1b]0;title\x07\u202ecd\u2066\x9be\x00[bold]f[/bold]"
SHOWN = r"a\x1b[31mb\x1b]0;title\x07\u202ecd\u2066\x9be\x00[bold]f[/bold]"


def is_harmless(text: str) -> bool:
    return all(c in "\n\t" or unicodedata.category(c) not in ("Cc", "Cf", "Cs", "Zl", "Zp") for c in text)


@given(st.text())
def test_any_text_is_harmless_when_it_is_printed_and_plain_text_is_as_it_was(text: str) -> None:
    shown = printable(text)
    assert is_harmless(shown)
    shown.encode()  # a terminal accepts no lone surrogates
    if is_harmless(text):
        assert shown == text


def test_names_in_tables_and_lines_are_shown_as_they_are_written() -> None:
    console = Terminal(file=io.StringIO(), width=400)
    table = Table(HOSTILE, title=HOSTILE)
    table.add_row(HOSTILE)
    console.print(table)
    console.print(HOSTILE, soft_wrap=True)
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert text.count(SHOWN) == 4
    assert is_harmless(text)


def headings(folder: Path) -> list[str]:
    path = folder / "record.txt"
    heading = HOSTILE.replace("\x00", "")
    rows = "".join(f"{k / 10}\t{k % 7}\t{heading}\n" for k in range(40))
    path.write_text(f"t\t{heading} (m\x1b[2J)\tb\n{rows}")
    return ["import", str(path), "-o", str(folder / "a.nc")]


def tdms(folder: Path) -> list[str]:
    path = folder / "record.tdms"
    with TdmsWriter(path) as writer:
        values = np.sin(np.arange(100.0))
        writer.write_segment(
            [ChannelObject("run", HOSTILE, values, {"wf_increment": 0.1, "unit_string": HOSTILE})]
        )
    return ["import", str(path), "-o", str(folder / "a.nc")]


def scene(folder: Path) -> list[str]:
    path = folder / "s.toml"
    path.write_text(
        '[body]\nmass = "\\u202e1\\u001b[31m"\n"k\\u001b[2J\\u202e" = 1\n[record]\n', encoding="utf-8"
    )
    return ["run", str(path), "-o", str(folder / "a.nc")]


def wrong_toml(folder: Path) -> list[str]:
    path = folder / "s.toml"
    path.write_text("a = \u202e\x1b[31m\n", encoding="utf-8")
    return ["run", str(path), "-o", str(folder / "a.nc")]


def name(folder: Path) -> list[str]:
    return ["run", str(folder / "s\x1b[31m\u202e.toml"), "-o", str(folder / "a.nc")]


@pytest.mark.parametrize("make", [headings, tdms, scene, wrong_toml, name])
def test_no_control_character_of_a_file_reaches_the_terminal(
    make: Callable[[Path], list[str]], tmp_path: Path
) -> None:
    done = in_this_process(*make(tmp_path))
    assert done.returncode in (0, 2)
    assert is_harmless(done.stdout + done.stderr)
    assert "1b[" in done.stdout + done.stderr
