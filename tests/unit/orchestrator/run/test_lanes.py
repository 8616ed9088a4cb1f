"""Scenes whose points run many at once in lanes, and scenes whose points do not."""

from __future__ import annotations

import pytest

import vibroimpact as vi
from vibroimpact.orchestrator.run.limits import goes_by_lanes
from vibroimpact.orchestrator.run.many_points import lanes_samples
from vibroimpact.orchestrator.scene import parse_scene

OSCILLATOR = "[body]\nmass = 1.0\nstiffness = 1.0\n"
CHAIN = '[body]\nkind = "chain"\nmasses = [1.0, 1.0]\nstiffnesses = 1.0\n'
BEAM = '[body]\nkind = "beam"\nlength = 1.0\nmass_per_length = 1.0\nfrequency = 1.0\nmodes = {modes}\n'
FORCING = "[forcing]\nangular_frequency = 1.0\namplitude = {amplitude}\n"
STOP = "[[stop]]\nposition = 1.0\nrestitution = 0.5\n"
RECORD = "[record]\nrecorded_periods = 1\n"
SWEEP = '[sweep]\n"stop[1].position" = { values = [1.0, 2.0] }\n'
PATH = '"forcing.angular_frequency" = { values = [1.0, 2.0], path = "up" }\n'


def scene(body: str = OSCILLATOR, *, stop: str = STOP, record: str = RECORD, rest: str = SWEEP) -> str:
    amplitude = "[1.0, 0.0]" if "chain" in body else "1.0"
    return body + FORCING.format(amplitude=amplitude) + stop + record + rest


SERIES = "time_series = { rate = 10 }\n"
OF_FORCE = 'time_series = { rate = 10, variables = ["contact_force", "contact_velocity[1]"] }\n'
VOIGT = '[[stop]]\nposition = 1.0\nlaw = "kelvin_voigt"\nstiffness = 10.0\n'
TWO = STOP + '[[stop]]\nposition = -1.0\nside = "lower"\nrestitution = 0.5\n'
ALONG = [
    f'[[stop]]\nposition = {sign}1.0\nside = "{side}"\nlocation = {place}\nrestitution = 0.5\n'
    for place in (0.6, 0.8, 1.0)
    for sign, side in (("", "upper"), ("-", "lower"))
]
"""Stops of a beam."""
FOUR = TWO + TWO.replace("restitution", "mass = 1\nrestitution")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (scene(), True),
        (scene(stop=TWO), True),
        (scene(CHAIN), True),
        (scene(CHAIN, stop=FOUR), True),
        (scene(BEAM.format(modes=2), stop="".join(ALONG[:4])), True),
        (scene(BEAM.format(modes=2), stop="".join(ALONG[:5])), False),
        (scene(BEAM.format(modes=1), stop="".join(ALONG[:4])), True),
        (scene(BEAM.format(modes=1), stop="".join(ALONG[:5])), False),
        (scene(BEAM.format(modes=8)), True),
        (scene(rest=SWEEP + PATH), True),
        (scene(BEAM.format(modes=2), rest=SWEEP + PATH), True),
        (scene(CHAIN, rest=SWEEP + PATH), False),
        (scene(rest="[sweep]\n" + PATH), False),
        (scene(rest=""), False),
        (scene(BEAM.format(modes=9)), False),
        (scene(BEAM.format(modes=2) + 'impact_projection = "collocation"\n'), False),
        (scene(BEAM.format(modes=2), rest=SWEEP + '"body.modes" = { values = [1, 2] }\n'), False),
        (scene(stop='[[stop]]\nposition = 1.0\nlaw = "hertz"\nstiffness = 10.0\n'), False),
        (scene(stop=VOIGT), True),
        (scene(CHAIN + "modes = 1\n", stop=VOIGT), True),
        (scene(CHAIN, stop=VOIGT), False),
        (scene(BEAM.format(modes=1), stop=VOIGT), True),
        (scene(stop=TWO.replace(STOP, VOIGT)), True),
        (scene(stop=VOIGT + "relaxation_time = 0.1\n"), False),
        (scene(stop=VOIGT, rest=SWEEP + '"stop[1].relaxation_time" = { values = [0.0, 0.1] }\n'), False),
        (scene(rest='[execution]\nhow = "fused"\n' + SWEEP), False),
        (scene(rest="[execution]\ndeadline = 1.0\n" + SWEEP), False),
        (scene(record=RECORD + SERIES), True),
        (scene(BEAM.format(modes=1), record=RECORD + SERIES), True),
        (scene(BEAM.format(modes=8), record=RECORD + SERIES), True),
        (scene(CHAIN, record=RECORD + OF_FORCE), True),
        (scene(BEAM.format(modes=9), record=RECORD + SERIES), False),
        (scene(stop=VOIGT, record=RECORD + SERIES), True),
        (scene(record=RECORD + OF_FORCE), True),
        (scene(stop=VOIGT, record=RECORD + OF_FORCE), False),
        (scene(record=RECORD + 'time_series = { rate = 10, variables = ["acceleration"] }\n'), False),
        (scene(OSCILLATOR + "frequency_slope = 0.1\n"), False),
    ],
)
def test_lanes_take_few_modes_between_rigid_stops_or_one_on_stops_that_yield(
    text: str, *, expected: bool
) -> None:
    assert goes_by_lanes(parse_scene(text, "scene.toml")) is expected


def test_the_choice_does_not_depend_on_the_number_of_points() -> None:
    for values in ("[1.0]", "[1.0, 2.0, 3.0]"):
        assert goes_by_lanes(parse_scene(scene(rest=SWEEP.replace("[1.0, 2.0]", values)), "scene.toml"))


def test_points_with_many_samples_run_by_several_calls_with_the_same_rows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = scene(record=RECORD + SERIES, rest=SWEEP + PATH)
    whole = vi.run(parse_scene(text, "scene.toml"), progress=False)
    assert whole.attrs["execution"] == "lanes"
    monkeypatch.setattr(lanes_samples, "MOST_BYTES", 1)
    cut = vi.run(parse_scene(text, "scene.toml"), progress=False)
    assert whole.drop_vars("point_seconds").identical(cut.drop_vars("point_seconds"))
