"""Every command of the pages of orbits and of the thesis's figures runs; its output and its figure are counted."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from matplotlib.figure import Figure
from support.command_line import in_this_process
from support.places import EXAMPLES, ROOT

PAGES = ("thesis_figures", "orbits")
BIFURCATION, CHAIN = "examples/bifurcation.toml", "examples/thesis/figure_6_13.toml"
TORUS = (
    f'run {CHAIN} --set "body.dampings=[0.063,0.063]" --set "forcing.amplitude=[0.42,0.0]" '
    '--set forcing.angular_frequency=0.875 --set "stop[1].position=0.327" --set "stop[1].restitution=0.77" '
    '--set "record={transient_periods=4000,recorded_periods=1000}" -o torus.nc'
)
FREQUENCY = "--parameter forcing.angular_frequency"
ALONE = "--doublings 0 --grazes 0 "
SECOND = "--second forcing.amplitude --second-from 0.02 --second-to 1.2 --impacts 1 --doublings 0 --grazes 0"


class Shown(NamedTuple):
    """Output of a command, and the largest numbers of points of the artists of its figure."""

    says: tuple[str, ...]
    draws: tuple[int, ...] = ()
    is_long: bool = False


COMMANDS = {
    f"run {CHAIN} -o figure_6_13.nc": Shown(("1 run in",)),
    "plot figure_6_13.nc --kind portrait -o figure_6_13.png": Shown((), (2793, 2793, 2793, 2793)),
    "maps examples/thesis/figure_2_12.toml --kind discontinuity --figure figure_2_12.png": Shown(
        ("200 impacts of a run.", "S has 1499 points, W 1499, of 1500 grazes."), (1499, 1497, 200)
    ),
    "maps examples/thesis/figure_2_12.toml --kind discontinuity --figure sets.png": Shown(
        (), (1499, 1497, 200)
    ),
    "maps examples/thesis/figure_2_18.toml --kind nordmark --figure figure_2_18.png": Shown(
        ("period 6 from", "period 5 from", "period 4 from", "period 3 from"), (300_000,)
    ),
    "maps --kind square-root --slope 0.25 --figure figure_2_19.png": Shown(("period 2 from",), (300_000,)),
    f'run {BIFURCATION} --set "stop=[]" -o resonance.nc': Shown(("802 runs in",)),
    f"follow {BIFURCATION} {FREQUENCY} --from 0.8 --to 0.96 --periods 2": Shown(("0.83786319", "0.94577617")),
    f'orbit {BIFURCATION} --set "sweep={{}}" --set forcing.angular_frequency=0.81 --impacts 1 --periods 2 '
    "--penetrating": Shown(("penetrates stop 1 by 0.223", "No physical orbit P(1,2).")),
    f"follow {BIFURCATION} {FREQUENCY} --from 0.6 --to 1.6 -o branches.nc": Shown(
        ("0.71068736909", "0.93649312074", "1.5166110861", "1.2185743569", "0.9363626913", "0.94577617591")
    ),
    f'orbit {BIFURCATION} --set "sweep={{}}" --set forcing.angular_frequency=0.93': Shown(
        ("P(1,1)   unstable", "P(1,2)   stable", "2 physical orbits.")
    ),
    f"follow {BIFURCATION} {FREQUENCY} --from 0.4 --to 1.6 --second forcing.amplitude --second-from 0.02 "
    "--second-to 0.8 --impacts 1 --doublings 0 --grazes 0 --figure figure_3_5a.png": Shown(
        ("fold: 0.66583281185, 0.56063456", "fold and graze: 0.49937460889, 0.752284281"),
        (424, 222, 166, 111),
        is_long=True,
    ),
    f'follow {BIFURCATION} {FREQUENCY} --from 0.4 --to 1.6 --second "stop[1].position" --second-from 0.5 '
    "--second-to 5.5 --impacts 1 --doublings 0 --grazes 0 --figure figure_3_5b.png": Shown(
        ("fold: 0.66583281185, 0.89184655", "fold: 0.49937460889, 0.66464235"),
        (400, 219, 167, 131, 120),
        is_long=True,
    ),
    f"follow {BIFURCATION} --set forcing.amplitude=0.55 {FREQUENCY} --from 0.6 --to 0.75 --second forcing.amplitude "
    "--second-from 0.5 --second-to 0.65 --impacts 1 --doublings 0 --grazes 0 --figure figure_3_10.png": Shown(
        ("graze and period doubling: 0.66583281185, 0.56063456", "graze and fold: 0.66583281185, 0.56063456"),
        (133, 82, 79),
        is_long=True,
    ),
    **{
        f"diagram {BIFURCATION} --set forcing.amplitude={amplitude} {FREQUENCY} {span} --parts sweep,branches "
        "--impacts 1 "
        f"{alone}--figure figure_3_{name}.png": Shown(says, is_long=name != "11a")
        for name, amplitude, span, alone, says in (
            ("11a", "0.565", "--from 0.66 --to 0.665", "", ("0.66249338975", "0.66214571411")),
            ("11b", "0.560634561", "--from 0.664 --to 0.669", ALONE, ("0.66583281193",)),
            ("11c", "0.555", "--from 0.668 --to 0.673", "", ("0.67011972282", "0.67028496114", "chaos")),
            (
                "12",
                "0.560634561",
                "--from 0.5 --to 1.8",
                ALONE,
                ("0.56760845439", "1.5486395306", "ends: closed."),
            ),
            ("13", "0.6", "--from 0.5 --to 1.8", "", ("0.63511486615", "0.54529693896", "1.5674598785")),
        )
    },
    "energies examples/thesis/figure_6_15.toml": Shown(("0.630961", "0.859039", "0.760263")),
    'run examples/thesis/figure_6_4.toml --set "stop=[]" -o free.nc': Shown(("922 runs in",)),
    f"maps {CHAIN} --set forcing.angular_frequency=1.76 --set record.recorded_periods=4000 "
    "--figure figure_6_7.png": Shown(("2752 impacts of a run.",), (2752,)),
    f"follow {CHAIN} {FREQUENCY} --from 0.8 --to 0.9": Shown(("0.85643437", "0.179984+0.530856i")),
    f"run {CHAIN} --set forcing.angular_frequency=0.82 -o figure_6_10.nc": Shown(("1 run in",)),
    f'orbit {BIFURCATION} --set "sweep={{}}" --set forcing.angular_frequency=1.4 --figure orbits.png': Shown(
        ("0.9286574832", "2.620714454", "2 physical orbits."), (401, 401)
    ),
    'orbit examples/ball_on_table.toml --set "sweep={}"': Shown(("4.188790205",)),
    'follow examples/ball_on_table.toml --parameter "stop[1].motion_amplitude" --from 1.1 --to 1.6': Shown(
        ("1.5268237005", "4.1887902")
    ),
    'follow examples/self_excited.toml --parameter "stop[2].position" --from -1.8 --to -0.4 '
    "--figure self_excited.png": Shown(("-1.5213650415", "-0.65730444222", "P(2,1) (32), P(1,1) (18)")),
    "orbit examples/yielding_stop.toml": Shown(("0.2475857134", "1.606526485", "1 physical orbit.")),
    "follow examples/yielding_stop.toml --parameter forcing.angular_frequency --from 0.6 --to 1.6 "
    "--figure yielding.png": Shown(("0.90210579988", "1.4585050166", "0.90330839648"), is_long=True),
    f"campaign {BIFURCATION} -o sweep": Shown(("802 points computed",)),
    "plot branches.nc --over sweep -o both.png": Shown((), (16_040, 9688, 313)),
    f"follow {BIFURCATION} {FREQUENCY} --from 0.3 --to 2.2 {SECOND} -o loci.nc --figure loci.png": Shown(
        ("0.99874921777, 0.0999062060", "0.66583281185, 0.56063456"), (424, 402, 212), is_long=True
    ),
    f"follow {BIFURCATION} {FREQUENCY} --from 0.5 --to 1.6 --second forcing.amplitude --second-from 0.5 "
    "--second-to 0.65 --impacts 1 --doublings 0 --grazes 0 --figure isola.png": Shown(
        (
            "crossing of branches: 0.643768459",
            "isola centre: 0.5870291457",
            "P(1,1) at forcing.amplitude = 0.563125",
            "shrinks to a point at 0.58702915, 0.55207595; meets another branch at 0.64376846, 0.57407286.",
        ),
        is_long=True,
    ),
    f"follow {BIFURCATION} "
    '--set "sweep={}" --set "stop=[{position=1.0,restitution=0.7},{side=\'lower\',position=-1.0,restitution=0.7}]" '
    f"{FREQUENCY} --from 0.6 --to 1.1 --second forcing.amplitude --second-from 0.05 --second-to 1 --impacts 2 "
    "--seed 0.1:1,3.24:2 --step 0.05 --doublings 0 --grazes 0 --figure pitchforks.png": Shown(
        ("pitchfork and graze: 0.99874921777, 0.0999062060", "degenerate pitchfork: 0.878204605"),
        is_long=True,
    ),
    "plot loci.nc --over map -o loci_map.png": Shown((), (424, 424, 402), is_long=True),
    "classify campaign -o classes.nc --figure classes.png": Shown(("P(1,1)", "P(1,2)"), (6840, 5500)),
    "lyapunov campaign -o exponents.nc --figure exponents.png": Shown(
        ("508 runs have exponents",), (314, 194)
    ),
    "basins examples/basins.toml --points 500 --x=-5:1 --y=-6:6 -o basins.nc --figure basins.png": Shown(
        ("87.23 %", "12.77 %", "1.132 +- 0.025")
    ),
    TORUS: Shown(("1 run in",)),
    "classify torus.nc": Shown(("rotation number 0.17404",)),
    "plot torus.nc --kind strobe -o torus.png": Shown((), (1000,)),
    "basins examples/two_frequencies.toml --points 60 --x=-0.8:0.8 --y=-1.5:1.5 --figure two_frequencies.png": Shown(
        ("quasi-periodic, rotation number 0.4142135624", "no impacts"), is_long=True
    ),
    "basins examples/basins.toml --parameter forcing.angular_frequency --from 0.9 --to 1.6 --values 36 --points 40 "
    "--x=-2:1 --y=-3:3 --figure shares.png": Shown(("24.88 %", "0.19 % of the plane"), is_long=True),
    f"diagram {BIFURCATION} -o diagram.nc --figure diagram.png": Shown(
        ("0.93649312074", "526 runs have exponents, of 15 the largest is positive."), is_long=True
    ),
    f"diagram {BIFURCATION} {FREQUENCY} --from 0.4 --to 1.6 --second forcing.amplitude --second-from 0.02 "
    "--second-to 0.8 --impacts 1 --doublings 0 --grazes 0 --figure diagram_map.png": Shown(
        ("fold: 0.66583281185, 0.56063456", "P(1,1)"), is_long=True
    ),
    f"control {BIFURCATION} --from 1 --to 0.7 -o kept.nc --keep parts": Shown(
        ("Kept to 0.7107: kept to the end of the plan.", "1.3e-05 away"), is_long=True
    ),
    "plot kept.nc --over sweep -o kept.png": Shown((), (9688, 6683, 6683, 2258), is_long=True),
    "energies examples/thesis/figure_6_15.toml --figure energies.png": Shown(("0.630961",), (200,)),
    "energies campaign -o energies.nc --figure energies.png": Shown(
        ("275 without: no impacts.",), (509, 314)
    ),
    "resonances examples/thesis/figure_6_4.toml -o peaks.nc --figure resonances.png": Shown(
        ("Natural frequencies: 0.618034, 1.61803.",), (461, 461), is_long=True
    ),
    f"follow {CHAIN} {FREQUENCY} --from 0.3 --to 2.2 --impacts 1 --doublings 2 --grazes 0": Shown(
        ("0.85643437", "1.6130454", "1.724739", "1.716343"), is_long=True
    ),
}
"""The commands of the pages, without their first word."""
MAP = """[sweep]
"forcing.angular_frequency" = { start = 0.4, stop = 2.1, points = 12 }
"forcing.amplitude" = { start = 0.1, stop = 1.1, points = 8 }
"""


def commands_of(page: str) -> list[str]:
    """Return the commands in the blocks and sentences of a page, except commands with a word for any file."""
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    spans = re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))
    lines = [*"\n".join(blocks).splitlines(), *(" ".join(span.split()) for span in spans)]
    found = [
        re.fullmatch(r"vibroimpact (\S+ .+)", line) for line in lines if not re.search(r" [A-Z]{4,}", line)
    ]
    return [one[1] for one in found if one]


def test_every_command_of_the_pages_is_run() -> None:
    assert {command for page in PAGES for command in commands_of(page)} == set(COMMANDS)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, cluster: str) -> Callable[[str], tuple[str, list[int]]]:
    """Return a function that runs a command after the commands that make its files, once each."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "examples").symlink_to(EXAMPLES)
    # a campaign of any scene, and a map of both numbers
    (folder / "campaign").symlink_to("sweep")
    (folder / "map.toml").write_text(
        (EXAMPLES / "bifurcation.toml").read_text().partition("[sweep]")[0] + MAP
    )
    outputs = {
        words[words.index("-o") + 1]: command for command in COMMANDS if "-o" in (words := command.split())
    }
    makers = outputs | {"campaign": outputs["sweep"], "map": "campaign map.toml -o map"}
    ended: dict[str, tuple[str, list[int]]] = {}

    def runner(command: str) -> tuple[str, list[int]]:
        if command not in ended:
            words = shlex.split(command)
            for word in words[1:]:
                if makers.get(word, command) != command:
                    runner(makers[word])
            elsewhere = ("--scheduler", cluster) if words[0] == "campaign" else ()
            ended[command] = _ran(folder, *words, *elsewhere)
        return ended[command]

    return runner


def _ran(folder: Path, *words: str) -> tuple[str, list[int]]:
    """Run a command; return its output, and the numbers of points of its artists, the largest first."""
    figures: list[Figure] = []
    save = Figure.savefig

    def saved(figure: Figure, *given: object, **more: object) -> None:
        figures.append(figure)
        save(figure, *given, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(Figure, "savefig", saved)
        done = in_this_process(*words)
    assert done.returncode == 0, done.stderr
    axes = [one for figure in figures for one in figure.axes]
    lines = [np.asarray(line.get_xydata(), dtype=float) for one in axes for line in one.lines]
    sizes = [int(np.isfinite(points).all(axis=1).sum()) for points in lines]
    sizes += [len(np.asarray(dots.get_offsets())) for one in axes for dots in one.collections]
    return done.stdout, sorted(sizes, reverse=True)


@pytest.mark.parametrize(
    "command",
    [pytest.param(name, marks=[pytest.mark.long] if row.is_long else []) for name, row in COMMANDS.items()],
)
def test_a_command_says_and_draws_what_its_page_tells(
    command: str, run: Callable[[str], tuple[str, list[int]]]
) -> None:
    shown = COMMANDS[command]
    said, drawn = run(command)
    for words in shown.says:
        assert words in said
    counts = drawn[: len(shown.draws)]
    # steps along a branch depend on rounding: they differ between versions of numpy
    assert counts == (pytest.approx(shown.draws, rel=0.2) if "branches" in command else [*shown.draws])
