"""`vibroimpact fmu` as a person uses it: its lists, and its messages for misuse."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.command_line import in_this_process

from vibroimpact.fmus import components


def test_the_list_names_every_component_in_both_versions_of_fmi() -> None:
    done = in_this_process("fmu", "list")
    assert done.returncode == 0
    for name in components():
        assert sum(name in line.split() for line in done.stdout.splitlines()) >= 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("export user-contact-law", "--law: expected the Python file of your law, got nothing."),
        ("export beam --law my_law.py", "--law: expected the component user-contact-law with it, got beam."),
        (
            "export user-contact-law --law my_law.py --modes 2",
            "--modes: a contact law has none of its own",
        ),
        ("export beem", "component: expected one of"),
        ("build --output FILE", "--output: expected a folder to fill"),
    ],
)
def test_misuse_leaves_with_2_and_one_line(arguments: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = in_this_process("fmu", *arguments.replace("FILE", str(tmp_path / "file")).split())
    assert done.returncode == 2
    assert done.stderr.startswith(message)
    assert len(done.stderr.splitlines()) == 1
