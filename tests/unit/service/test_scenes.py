"""Lines and columns of the problems of a submitted scene."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import pytest

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene.file import parse_scene_toml
from vibroimpact.service.fmus import FmuStore
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.scenes import Shelf, located, taken_scene


@pytest.mark.parametrize(
    ("key", "text", "line", "column"),
    [
        ("body.mass", "body.mass = -1", 1, 1),
        ("body.mass", "body = { stiffness = 1, mass = -1 }", 1, 25),
        ("body.mass", "[body]\r\nmass = -1\r\n", 2, 1),
        ("body.mass", "\ufeff[body]\nmass = -1", 2, 1),
        ("body.mass", '["body"]\n"mass" = -1', 2, 1),
        ("body.mass", "[ body ] # [other]\n  mass = -1", 2, 3),
        ("body.mass", "[body] # says nothing\nstiffness = 1", 1, 1),
        ("sweep.body.mass", '[sweep]\n"body.mass" = 3', 2, 1),
        ("stop[2].position", "[[stop]]\nposition = 1\n[[stop]]\nposition = 2", 4, 1),
        ("stop[2].position", "stop = [{ position = 1 }, { position = 2 }]", 1, 29),
        ("body.mass", '# """\nt = """\n[body]\nmass = 3\n"""\n[body]\nmass = -1', 7, 1),
        ("body.mass", "t = '''\n[body]\nmass = 3\n'''\n[body]\nmass = -1", 6, 1),
        ("body.mass", "[scene]\ntitle = 'a\u2028b\x85c'\n[body]\nmass = -1", 4, 1),
        ("body.mass", "x = ['''a'''', '#']\n[body]\nmass = -1", 3, 1),
        ("body.mass", 'x = """a"""""\ny = """b\\"""\n[body]\nmass = 3\n"""\n[body]\nmass = -1', 7, 1),
    ],
)
def test_a_problem_is_where_its_key_is_written(key: str, text: str, line: int, column: int) -> None:
    (found,) = located([f"scene: {key}: expected a number > 0, got -1."], text)
    assert (found["line"], found["column"]) == (line, column)


HEADER = "\n[body]\nmass = -1\n"
HOSTILE = {
    "quotes after a text that four quotes end": lambda n: "x = ['''a'''', '" + '\\"' * (n // 2) + "']",
    "a comment of quotes": lambda n: "# " + '"""\\' * (n // 4),
    "texts that do not end": lambda n: "'" + '"""' + "\\'" * (n // 2),
    "brackets and blanks": lambda n: "x = [\n[" + " " * n + "\n]",
    "brackets, text and blanks": lambda n: "x = [\n[1" + " " * n + "1]]",
    "blanks before a key": lambda n: " " * n + "y = 1",
    "blanks after a key": lambda n: "body.y" + " " * n + "\n",
    "many keys": lambda n: "".join(f"k{number} = 1\n" for number in range(n // 9)),
    "many tables": lambda n: "".join(f"[[t{number}]]\n" for number in range(n // 9)),
}


def processor_time(call: Callable[[], object]) -> float:
    """Return the least processor time of three calls, s."""
    times = []
    for _ in range(3):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return min(times)


@pytest.mark.parametrize("kind", HOSTILE)
def test_fifty_problems_are_placed_in_time_that_grows_with_the_text(kind: str) -> None:
    problems = ["scene: body.mass: expected a number > 0, got -1."] * 50

    def seconds(length: int) -> float:
        text = HOSTILE[kind](length) + HEADER
        assert located(problems, text)[49]["line"] == text.count("\n")
        return processor_time(lambda: located(problems, text))

    short, long = seconds(2**17), seconds(2**19)
    assert long < max(4.0**1.5 * short, 0.02), "4 for work that grows with the text, 16 with its square"


@pytest.mark.parametrize("key", ["a", " ", "a ", '\\"'])
def test_a_key_of_64_kb_that_is_given_twice_is_refused_at_once(key: str) -> None:
    line = f'["{key * (65_000 // len(key))}"]\n'
    began = time.process_time()
    with pytest.raises(SceneError, match="expected valid TOML"):
        parse_scene_toml(line * 2, "scene")
    assert time.process_time() - began < 0.5


def test_no_answer_repeats_more_than_fifty_problems_or_a_megabyte_of_a_key() -> None:
    found = located([f"scene: {'k' * 1_000_000}: unknown key."] * 1000, "")
    assert len(found) == 51
    assert found[50]["message"] == "and 950 more problems."
    assert max(len(one["message"]) for one in found) <= 1000


@pytest.mark.parametrize("head", ["[forcing]", "[[forcing]]"])
def test_a_table_of_a_force_may_name_no_file(head: str, tmp_path: Path) -> None:
    # once the error of the scene quoted a line of any file of the machine
    (tmp_path / "secret").write_text("password, 1\n", encoding="utf-8")
    text = f"[body]\nmass = 1.0\nstiffness = 1.0\n{head}\nsignal = 'table'\nfile = '{tmp_path / 'secret'}'"
    shelf = Shelf(Mock(spec=RecordingStore), Mock(spec=FmuStore, folder=tmp_path, names=lambda: ()))
    with pytest.raises(SceneError) as caught:
        taken_scene(text, shelf)
    (problem,) = caught.value.problems
    assert "forcing.file: expected times and values in the scene, got a file." in problem
    assert "password" not in problem
