"""Messages on a wrong scene file: one clear line for each mistake, all of them at once."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from support.scenes import FORCED, SOURCE, changed, problems_of, swept

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import load_scene, parse_scene

# Messages on single mistakes.


def test_corners_of_a_sweep_are_checked_where_the_axes_alone_are_fine() -> None:
    start, position = (
        '"body.displacement_start" = { values = [0.0, 0.8] }',
        '"stop[1].position" = { values = [1.0, 0.5] }',
    )
    assert parse_scene(swept(FORCED, start), SOURCE)
    assert parse_scene(swept(FORCED, position), SOURCE)
    (problem,) = problems_of(swept(FORCED, start, position))
    assert "displacement <= 0.5), got 0.8 (the worst of the swept values)" in problem


def test_a_sweep_carries_its_state_along_one_key_only() -> None:
    (problem,) = problems_of(
        swept(
            FORCED,
            '"body.mass" = { values = [1], path = "up" }',
            '"body.stiffness" = { values = [1], path = "down" }',
        )
    )
    assert problem.startswith(
        "sweep: expected at most one key with a path up, down or up-down, got body.mass, body.stiffness."
    )


def test_a_sweep_has_at_most_a_thousand_million_points() -> None:
    ten_thousand = "{ start = 1, stop = 2, points = 10_000 }"
    hundred_thousand = "{ start = 1, stop = 2, points = 100_000 }"
    assert parse_scene(
        swept(FORCED, f'"body.mass" = {ten_thousand}', f'"body.stiffness" = {hundred_thousand}'), SOURCE
    )
    longer = "{ start = 1, stop = 2, points = 100_001 }"
    (problem,) = problems_of(swept(FORCED, f'"body.mass" = {ten_thousand}', f'"body.stiffness" = {longer}'))
    assert problem.startswith("sweep: expected at most 1000000000 points in all, got 1000010000.")


@pytest.mark.parametrize(
    ("stop", "problem"),
    [
        (
            'position = 2\nrestitution = 1\nside = "lower"',
            "stop[1].position: expected the upper stop[1] above the lower stop[2]",
        ),
        (
            'position = 1\nrestitution = 1\nside = "lower"',
            "stop[1].position: expected the upper stop[1] above the lower stop[2]",
        ),
        (
            "position = 2\nrestitution = 1",
            "stop[2].side: expected one upper and one lower stop, got two upper stops.",
        ),
        (
            "position = 2\nrestitution = 1\n[[stop]]\nposition = 3\nrestitution = 1",
            "stop: expected at most 2 stops, got 3.",
        ),
    ],
)
def test_two_stops_leave_room_between_them(stop: str, problem: str) -> None:
    assert any(line.startswith(problem) for line in problems_of(FORCED + f"[[stop]]\n{stop}\n"))


def test_an_execution_of_a_later_version_is_refused_by_name() -> None:
    (problem,) = problems_of(FORCED + '[execution]\nhow = "batch"\n')
    assert (
        problem == 'execution.how: expected "auto", "coupled" or "fused", got "batch". '
        '"batch" is not available in this version.'
    )


@pytest.mark.parametrize("text", ["", '[scene]\ntitle = "empty"\n'])
def test_a_scene_without_a_body_says_so(text: str) -> None:
    assert problems_of(text) == [
        "body: expected one [body] table, got nothing. Add [body] with mass, stiffness and damping."
    ]


def test_all_problems_are_reported_at_once() -> None:
    text = changed(FORCED, "mass = 1.0", "mass = -1").replace(
        "damping = 0.1", "damping = 0.1\ndamping_ratio = 0.1"
    )
    text = text.replace("restitution = 0.7", "restitution = 1.2").replace(
        "recorded_periods", "recordd_periods"
    )
    text += '[sweep]\n"body.mas" = { values = [1] }\n[extra]\n'
    keys = [problem.split(": ")[0] for problem in problems_of(text)]
    assert sorted(keys) == sorted(
        [
            "extra",
            "body.mass",
            "body.damping",
            "stop[1].restitution",
            "record.recordd_periods",
            "record.recorded_periods",
            'sweep."body.mas"',
        ]
    )


# Messages on a file that is no scene.


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[body]\nmass = 0,5\n", 'line 2, column 9: expected valid TOML, got "mass = 0,5".'),
        ("[body]\nmass = 1\nmass = 2\n", 'line 3, column 9: expected valid TOML, got "mass = 2".'),
        ("[body", 'end of file: expected valid TOML, got "[body".'),
        ("[sweep]\nstop[1].position = { values = [1] }\n", "line 2, column 5: expected valid TOML"),
        ("x = " + "[" * 50_000, "expected shallow tables and arrays, got nesting too deep to read."),
        ("x = " + "9" * 5_000, "expected numbers of a usual length, got one of thousands of digits."),
    ],
)
def test_text_that_is_not_toml_is_reported_with_its_line(text: str, problem: str) -> None:
    (line,) = problems_of(text)
    assert line.startswith(problem)


@pytest.mark.parametrize(
    "text",
    [
        "{}a = 1",
        "[{}a]",
        "[[{}a]]",
        "x = {{ {}a = 1 }}",
        "x = [{{ y = 1, {}a = 1 }}]",
        "[body]\nb = 1\n{}a = 1",
    ],
)
@pytest.mark.parametrize("part", ["a.", '"a" .', "'a'. "])
def test_a_key_of_thousands_of_parts_is_refused_with_its_line_before_it_is_parsed(
    text: str, part: str
) -> None:
    # with 200,000 parts the parser would take hours and all memory
    (problem,) = problems_of(FORCED + text.format(part * 200_000))
    line = FORCED.count("\n") + text.count("\n") + 1
    assert problem.startswith(
        f"line {line}: expected shallow tables and arrays, got nesting too deep to read."
    )


@pytest.mark.parametrize(
    "text", ["x = " + "{a=" * 50_000, "x = " + "[" * 2000 + "]" * 2000, "x=" + "[{a=" * 9999]
)
def test_deep_nesting_is_refused_however_it_is_written(text: str) -> None:
    assert "expected shallow tables and arrays, got nesting too deep to read" in problems_of(text)[0]


def many(pattern: str, count: int) -> str:
    return "".join(pattern.format(number) for number in range(count))


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (changed(FORCED, "[forcing]", many("key{} = 1\n", 20_000) + "[forcing]"), 20_000),
        (FORCED + many("[table{}]\n", 5000), 5000),
        (swept(FORCED, *(f'"body.mas{k}" = {{ values = [1] }}' for k in range(3000))), 3000),
        (FORCED + "[record.time_series]\nrate = 1\nvariables = [" + many('"v{}", ', 5000) + "]", 5000),
    ],
)
def test_of_very_many_problems_some_are_told_and_how_many_more_there_are(text: str, count: int) -> None:
    problems = problems_of(text)
    assert len(problems) == 51
    assert problems[-1] == f"and {count - 50} more problems."
    assert sum(map(len, problems)) < 20_000


def test_a_problem_with_a_key_of_a_million_letters_is_one_short_line() -> None:
    (problem,) = problems_of(changed(FORCED, "[forcing]", "k" * 10**6 + " = 1\n[forcing]"))
    assert len(problem) < 500
    assert "kkk..." in problem


def load_problem(path: Path) -> str:
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{path}: ")
    return problem.removeprefix(f"{path}: ")


def test_a_missing_file_is_told_with_the_nearest_name(tmp_path: Path) -> None:
    (tmp_path / "bifurcation.toml").write_text(FORCED)
    hint = f"Did you mean {tmp_path / 'bifurcation.toml'}?"
    assert (
        load_problem(tmp_path / "bifurcaton.toml")
        == f"expected a scene file, got no file of this name. {hint}"
    )
    assert f"There is no folder {tmp_path / 'no'}" in load_problem(tmp_path / "no" / "scene.toml")


def test_a_folder_or_a_device_is_not_a_scene(tmp_path: Path) -> None:
    assert "got a folder" in load_problem(tmp_path)
    os.mkfifo(tmp_path / "pipe.toml")
    assert "not a regular file" in load_problem(tmp_path / "pipe.toml")


def test_a_file_that_is_not_utf_8_is_told_with_the_line(tmp_path: Path) -> None:
    path = tmp_path / "latin.toml"
    path.write_bytes(b'[scene]\ntitle = "D\xe4mpfer"\n')
    assert load_problem(path) == "line 2: expected UTF-8 text, got the byte 0xe4. Save the file as UTF-8."


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (b"PK\x03\x04" + bytes(2**21), "an archive. An FMU runs as a component of a scene"),
        (b"\x89HDF\r\n\x1a\n", "a NetCDF or HDF5 file. `vibroimpact describe` says what it holds."),
        (b"\x7fELF\x02\0", "a file that is no text. Name a .toml file."),
    ],
    ids=["FMU", "dataset", "program"],
)
def test_a_file_of_another_kind_is_told_by_what_it_is(tmp_path: Path, content: bytes, kind: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_bytes(content)
    assert load_problem(path).startswith(f"expected a scene file (TOML), got {kind}")


def test_a_system_that_is_read_as_a_scene_says_how_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "rig.SSP"
    path.write_bytes(b"PK\x03\x04")
    assert load_problem(path) == (
        "expected a scene file (TOML), got a system (SSP). `vibroimpact.import_ssp` makes a scene of it."
    )


def test_a_huge_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.toml"
    with path.open("wb") as file:
        file.write(b" " * 2**20)
        file.truncate(2**34)
    assert "expected a scene file of at most 1 MiB" in load_problem(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read every file")
def test_an_unreadable_file_is_told_with_the_reason(tmp_path: Path) -> None:
    path = tmp_path / "secret.toml"
    path.write_text(FORCED)
    path.chmod(0)
    assert "Permission denied" in load_problem(path)


def test_bad_scenes_exit_with_code_2() -> None:
    assert SceneError.exit_code == 2
