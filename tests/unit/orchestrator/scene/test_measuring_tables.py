"""Tables of a measuring chain: accepted values, dependencies between tables, and sweeps of their numbers."""

from __future__ import annotations

import pytest
from support.scenes import problems_of

from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.keys import CHAIN_TABLES
from vibroimpact.orchestrator.scene.sweep import expand

BODY = """\
[body]
mass = 1.0
stiffness = 1000.0
[forcing]
amplitude = 3.0
frequency = 5.0
[[stop]]
position = 0.01
restitution = 0.7
"""
RECORD = "[record]\nrecorded_periods = 8\n"
SERIES = RECORD + "time_series = {{ {} }}\n"
YIELDS = BODY.replace("restitution = 0.7", 'law = "hertz"\nstiffness = 1e6')
BARE = '[scene]\nunits = "nondimensional"\n' + BODY.replace("frequency", "angular_frequency")
CELL = "[load_cell]\nsensitivity = 0.01\ncontact_duration = 1e-3\n"
EXCITER = "[exciter]\ngain = 1.5\n"
DAQ = "[daq]\nrate = 2000\nbits = 12\nrange = 5.0\n"
CHAIN = '[body]\nkind = "chain"\nmasses = [1.0]\nstiffnesses = 1.0\n[record]\nrecorded_time = 1\n'
REPLAY = (
    BODY.replace("[forcing]\namplitude = 3.0\nfrequency = 5.0\n", "")
    + '[replay]\ndrive = "force"\nfrom = "u"\n'
)


def scene(*tables: str) -> Scene:
    return parse_scene("".join(tables), "s.toml")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            BODY + RECORD + "[load_cell]\nsensitivity = 1\n",
            "load_cell.contact_duration: expected a number > 0 of a rigid stop",
        ),
        (YIELDS + RECORD + CELL, "load_cell.contact_duration: expected none of a hertz stop, got 0.001."),
        (BODY + RECORD + CELL + "stop = 2\n", "load_cell.stop: expected a stop of the scene, 1 to 1, got 2."),
        (BODY.split("[[stop]]")[0] + RECORD + CELL, "load_cell.stop: expected a scene with [[stop]], got 1."),
        (
            BODY + RECORD + CELL.replace("1e-3", "0"),
            "load_cell.contact_duration: expected a number > 0, got 0.",
        ),
        (BODY + RECORD + EXCITER + "distance = 0.1\n", "exciter.distance: expected [daq] beside it"),
        (
            BODY + RECORD + EXCITER + 'side = "left"\n',
            'exciter.side: expected "lower" or "upper", got "left".',
        ),
        (
            BODY.replace("[forcing]", '[forcing]\nkind = "base_acceleration"') + RECORD + EXCITER,
            'forcing.kind: expected "force" beside [exciter], got "base_acceleration".',
        ),
        (BODY + RECORD + "[noise]\nload_cell = 1\n", "noise.load_cell: expected [load_cell] beside it"),
        (BODY + RECORD + "[noise]\ndrive = 1\n", "noise.drive: expected [exciter] beside it"),
        (BODY + RECORD + "[noise]\nseed = -1\n", "noise.seed: expected a whole number from 0 to"),
        (BODY + RECORD + "[daq]\nrate = 10\nbits = 12\n", "daq.range: expected a number > 0, got nothing."),
        (BODY + RECORD + DAQ.replace("12", "33"), "daq.bits: expected a whole number from 2 to 32, got 33."),
        (BODY + RECORD + DAQ + "clock_error = 2e5\n", "daq.clock_error: expected parts per million"),
        (BODY + RECORD + "[sensor]\nrange = -1\n", "sensor.range: expected a number >= 0, got -1."),
        (
            BODY + SERIES.format('rate = 10, variables = ["load_cell"]'),
            'record.time_series.variables[1]: expected [load_cell] beside "load_cell", got a scene without it.',
        ),
        (
            BODY + EXCITER + SERIES.format('rate = 10, variables = ["forcing"]'),
            'record.time_series.variables[1]: expected "drive" beside [exciter], got "forcing".',
        ),
        (
            BODY + EXCITER + SERIES.format('variables = ["drive"]'),
            "record.time_series.rate: expected a number > 0, got nothing.",
        ),
        (
            BODY + EXCITER + DAQ + SERIES.format('rate = 10, variables = ["drive"]'),
            "record.time_series.rate: expected daq.rate, 2000, got 10.",
        ),
        (
            BODY
            + EXCITER
            + CELL
            + DAQ
            + "skew = 6e-4\n"
            + SERIES.format('variables = ["drive", "load_cell"]'),
            "daq.skew: expected 2 channels, one after the other, within a sample of 0.0005 s, got 0.0006 between two.",
        ),
        (
            BODY + CELL + "natural_frequency = 1e6\n" + DAQ + SERIES.format('variables = ["load_cell"]'),
            "load_cell.natural_frequency: expected at most 166667 Hz at this rate, got 1000000.0.",
        ),
        (
            BODY + RECORD + CELL + "natural_frequency = 2e-311\n",
            "load_cell.natural_frequency: expected 1e-09 to 1e+07, got 2e-311.",
        ),
        (
            BODY + RECORD + CELL + "damping_ratio = 1e4\n",
            "load_cell.damping_ratio: expected 0 to 1000, got 10000.0.",
        ),
        (
            BODY + EXCITER + DAQ.replace("2000", "2e9") + SERIES.format('variables = ["drive"]'),
            "daq.rate: expected at most",
        ),
        (CHAIN + DAQ, "daq: expected a measuring chain of an oscillator or a beam, got one beside a chain."),
        (
            CHAIN + "[sensor]\nrange = 1\n",
            "sensor.range: expected a measuring chain of an oscillator or a beam",
        ),
        (
            '[scene]\nunits = "nondimensional"\n'
            + BODY.replace("frequency", "angular_frequency")
            + RECORD
            + DAQ,
            "daq: expected a scene in SI units",
        ),
        (
            BODY + RECORD + DAQ + '[execution]\nhow = "coupled"\n',
            'daq: expected how = "fused" beside it, got "coupled".',
        ),
        (REPLAY + CELL, "load_cell: expected none beside [replay], got one."),
        (
            REPLAY + DAQ + EXCITER + "distance = 1\n",
            "exciter.distance: expected none beside [replay], got 1.0.",
        ),
        (
            REPLAY.replace('"force"', '"base_acceleration"') + EXCITER,
            'exciter: expected drive = "force" beside it in [replay]',
        ),
    ],
)
def test_what_does_not_fit_is_told_in_one_line(text: str, problem: str) -> None:
    assert any(line.startswith(problem) for line in problems_of(text)), problems_of(text)


def test_all_problems_are_told_at_once() -> None:
    text = (
        BODY
        + RECORD
        + "[load_cell]\nsensitivty = 1\n[exciter]\ngain = true\n[noise]\nsensor = -1\n[daq]\nbits = 1.5\n"
    )
    keys = {line.split(": ")[0] for line in problems_of(text)}
    assert keys == {
        *("load_cell.sensitivty", "exciter.gain", "noise.sensor"),
        *("daq.rate", "daq.bits", "daq.range"),
    }


def test_the_numbers_of_each_table_can_be_swept() -> None:
    keys = ("load_cell.sensitivity", "exciter.gain", "noise.load_cell", "daq.rate", "sensor.range")
    axes = "".join(f'"{key}" = {{ values = [1.0, 2.0] }}\n' for key in keys)
    swept = scene(BODY, "[sensor]\n", CELL, EXCITER, "[noise]\n", DAQ, RECORD, "[sweep]\n", axes)
    assert swept.runs == 32
    (branch, *_) = expand(swept)
    last = swept.at(list(branch.points)[-1].values if len(branch.points) == 32 else dict.fromkeys(keys, 2.0))
    assert last.exciter is not None
    assert (last.value("daq.rate"), last.exciter.gain, last.value("noise.load_cell")) == (2.0, 2.0, 2.0)
    assert swept.sweep_coordinate_name("noise.load_cell") == "noise_load_cell"


@pytest.mark.parametrize("table", CHAIN_TABLES)
def test_a_scene_of_components_has_components_for_it(table: str) -> None:
    text = f'[component.a]\nfmu = "Oscillator"\n[record]\nrecorded_time = 1\n[{table}]\n'
    assert any(
        line.startswith(f"{table}: expected [{table}] in a scene with [body]") for line in problems_of(text)
    )


def test_a_scene_without_these_tables_is_the_same_as_before_there_were_any() -> None:
    # earlier campaigns go on: their scenes keep the same keys
    from vibroimpact.orchestrator.campaign.manifest import flat_scene

    keys = flat_scene(scene(BODY, RECORD, "[sensor]\n"))
    assert not [key for key in keys if key.startswith(CHAIN_TABLES) or key == "sensor.range"]
