"""The pages of recordings, their scenes and their import settings contain only what the program understands.

References: the files themselves. The command line's own parser parses the commands of a page without running them.
Only imports are run, if the recordings are next to the checkout.
"""

from __future__ import annotations

import re
import shlex
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer
from support.places import ROOT
from support.real_data import recording_folder

from vibroimpact.hardware.recordings import import_recording, read_settings
from vibroimpact.orchestrator.commands.cli import app, load_commands
from vibroimpact.orchestrator.scene import load_scene

SCENES = sorted((ROOT / "examples" / "recordings").glob("*.toml"))
SETTINGS = sorted((ROOT / "examples" / "recordings" / "import").glob("*.toml"))
PAGES = sorted((ROOT / "docs" / "recordings").glob("*.md"))
TOPICS = [
    ROOT / "docs" / f"{name}.md"
    for name in ("replay", "spikes", "intervals", "damping", "recordings", "estimation")
]
IMPORTS = {  # settings file: (folder, files, channels or event trains that it makes)
    "board2": ("pcb_repeated_shock", ["dataset2_Test_001.lvm"], ["base", "board"]),
    "package": ("smd_repeated_5kg", ["board3.4_00.lvm"], ["base", "board"]),
    "shaker": (
        "shaker_vibration_plus_shock",
        ["amp7_impact0.3_vib0.5.lvm"],
        ["vibration", "shock", "composite", "base", "board"],
    ),
    "retina": ("retina_spikes", ["08_spikes-1.mat"], ["spikeslow", "spikeshigh"]),
    "bounces": ("ttd_bounces", ["ttd-world-record_beats.csv"], ["bounces"]),
    "acc_base_a0.txt": ("pcb_repeated_shock", ["acc_base_a0.txt"], ["base"]),
    "acc_pcb_a0.txt": ("pcb_repeated_shock", ["acc_pcb_a0.txt"], ["board"]),
}


def commands_of(page: Path) -> list[str]:
    """Return the vibroimpact commands in the code blocks of a page, or in the comments of a TOML file."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".toml":
        lines = "\n".join(line.removeprefix("# ") for line in text.splitlines() if line.startswith("#"))
    else:
        lines = "\n".join(re.findall(r"^```(?:sh)?\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL))
    joined = re.sub(r"\\\n\s*", "", lines)
    return [line for line in joined.splitlines() if line.startswith("vibroimpact ")]


@cache
def command_line() -> Any:
    """Return the tree of all commands."""
    load_commands()
    return typer.main.get_command(app)


def parsed(command: str) -> Any:
    """Parse a command without running it."""
    group = command_line()
    _, name, *arguments = shlex.split(command)
    while hasattr(group.commands[name], "commands"):
        group, (name, *arguments) = group.commands[name], arguments
    return group.commands[name].make_context(name, arguments)


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_scene_of_a_recording_loads_and_says_how_it_is_replayed(scene: Path) -> None:
    assert load_scene(scene).replay is not None
    assert any(f"examples/recordings/{scene.name}" in command for command in commands_of(scene))


@pytest.mark.parametrize(
    "page", [*PAGES, *TOPICS, *SCENES, *SETTINGS], ids=lambda path: f"{path.parent.name}-{path.stem}"
)
def test_commands_of_a_page_are_understood_and_their_project_files_exist(page: Path) -> None:
    for command in commands_of(page):
        parsed(command)
        for name in re.findall(r"examples/recordings/\S+\.toml", command):
            assert (ROOT / name).is_file(), command


def test_a_command_with_an_unknown_option_is_not_understood() -> None:
    with pytest.raises(Exception, match="--chanel"):
        parsed("vibroimpact spikes a.nc --chanel base")


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_links_and_figures_of_a_page_exist(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8"))
    assert links
    for link in links:
        assert (page.parent / link).resolve().exists(), link


def test_each_recording_has_a_page_with_question_answer_and_doubt() -> None:
    index = (ROOT / "docs" / "recordings" / "README.md").read_text(encoding="utf-8")
    for page in PAGES:
        if page.name == "README.md":
            continue
        text = page.read_text(encoding="utf-8")
        assert f"({page.name})" in index, page.name
        for part in ("**Recording", "**Asked**", "**Answer", "**Doubt**"):
            assert part in text, (page.name, part)
        assert commands_of(page), page.name


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda path: path.stem)
def test_settings_give_the_channels_of_the_pages(settings: Path) -> None:
    given = read_settings(settings)
    folder, files, names = IMPORTS[settings.stem]
    recording = import_recording([recording_folder(folder) / file for file in files], common=given)
    assert [*recording.channels, *recording.events] == names
