"""The runner of the C tests: it reports failures, and never compiles the same program twice."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import pytest
from native import run_sanitized
from support.kept import digest, kept, remove_unused

HEADER = "int twice(int x);\n"
CORE = '#include "twice.h"\nint twice(int x) { return 2 * x; }\n'
TEST = '#include "twice.h"\nint main(void) { return twice(2) - %d; }\n'


@pytest.fixture
def native(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a core of one function and two tests, one of them failing."""
    core, tests = tmp_path / "fmus" / "core", tmp_path / "tests"
    for folder in (core, tests, core.parent / "adapters"):
        folder.mkdir(parents=True)
    (core / "twice.h").write_text(HEADER)
    (core / "twice.c").write_text(CORE)
    (tests / "right.c").write_text(TEST % 4)
    (tests / "wrong.c").write_text(TEST % 5)
    monkeypatch.setattr(run_sanitized, "NATIVE", core.parent)
    monkeypatch.setattr(run_sanitized, "HERE", tests)
    monkeypatch.setattr(run_sanitized, "KEPT", tmp_path / "kept")
    kind_of = partial(run_sanitized.CoreKind, (core / "twice.c",))
    monkeypatch.setattr(run_sanitized, "core_of", lambda folder: kind_of((f"-DCORE_OF={folder}",)))
    # no compiler is asked for its sanitizers here
    monkeypatch.setattr(run_sanitized, "supported", lambda compiler, sanitizers: False)
    return tmp_path


def compiled(native: Path) -> dict[str, int]:
    """Return the inode of each cached file by its name."""
    return {path.name: path.stat().st_ino for path in (native / "kept").iterdir()}


def test_a_program_that_fails_ends_the_run_with_1_and_what_is_the_same_is_not_compiled_again(
    native: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_sanitized.main(["--jobs", "1"]) == 1
    first, said = compiled(native), capsys.readouterr().out
    assert "right.c (no sanitizer): passed\n" in said
    assert "wrong.c (no sanitizer): FAILED: exit code 255\n" in said
    (native / "tests" / "wrong.c").write_text(TEST % 4)
    assert run_sanitized.main(["--jobs", "2"]) == 0
    second = compiled(native)
    assert len(second.items() - first.items()) == 1
    (native / "fmus" / "core" / "twice.h").write_text(f"{HEADER}/* edited */\n")
    assert run_sanitized.main([]) == 0
    # both programs, and an object for each kind of core
    assert len(compiled(native).items() - second.items()) == 5


def test_a_core_that_does_not_compile_ends_the_run_with_1_in_the_compilers_words(
    native: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (native / "fmus" / "core" / "twice.c").write_text("int twice(int x) { return y; }\n")
    assert run_sanitized.main(["--jobs", "1"]) == 1
    said = capsys.readouterr().out
    assert "FAILED: the core does not compile" in said
    assert "undeclared" in said
    assert compiled(native) == {}


def test_a_file_is_made_once_and_one_that_fails_leaves_nothing(tmp_path: Path) -> None:
    made: list[Path] = []

    def make(path: Path) -> None:
        made.append(path)
        path.write_text("half")
        if len(made) == 1:
            raise OSError("the disk is full")

    with pytest.raises(OSError, match="full"):
        kept("a.o", digest("source"), make, tmp_path)
    assert list(tmp_path.iterdir()) == []
    paths = {kept("a.o", digest("source"), make, tmp_path) for _ in range(3)}
    assert len(made) == 2
    assert [path.read_text() for path in paths] == ["half"]


def test_what_no_run_has_asked_for_in_an_hour_goes_and_so_does_what_a_killed_run_left(tmp_path: Path) -> None:
    def make(path: Path) -> None:
        path.write_text("whole")

    old, used = (kept(f"{name}.o", digest(name), make, tmp_path) for name in ("old", "used"))
    half = tmp_path / "1234-half.o"
    half.write_text("ha")
    for path in (old, used, half):
        os.utime(path, (0.0, 0.0))
    kept("used.o", digest("used"), make, tmp_path)
    remove_unused(tmp_path)
    assert list(tmp_path.iterdir()) == [used]


def test_the_parts_of_a_key_are_told_apart() -> None:
    assert digest("ab", "c") != digest("a", "bc")
    assert digest("a") == digest(b"a")
