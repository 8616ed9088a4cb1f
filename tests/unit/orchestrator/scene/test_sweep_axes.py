"""Axes that move together, drawn axes and refined axes: their values and their problems."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.designs import drawn, log_uniform, normal, uniform, unit_design
from vibroimpact.orchestrator.scene.sweep import SweepAxis, expand

TEXT = """
[body]
mass = 1
stiffness = 4
damping = 0.1
[[stop]]
position = 1
restitution = 0.7
[record]
recorded_time = 5
[sweep]
"""


def swept(*lines: str) -> Scene:
    return parse_scene(TEXT + "\n".join(lines), "scene.toml")


def read(*lines: str) -> tuple[tuple[SweepAxis, ...], list[str]]:
    """Return the axes of a sweep, or its problems."""
    try:
        return swept(*lines).sweep, []
    except SceneError as problem:
        return (), str(problem).splitlines()


def problems(*lines: str) -> list[str]:
    with pytest.raises(SceneError) as caught:
        swept(*lines)
    return str(caught.value).splitlines()


def test_keys_with_one_zip_move_together_and_other_keys_span_them() -> None:
    scene = swept(
        '"body.mass" = { values = [1, 2, 3], zip = "size" }',
        '"body.damping" = { values = [0, 0.5] }',
        '"body.stiffness" = { values = [4, 5, 6], zip = "size" }',
    )
    (branch,) = expand(scene)
    keys = ("body.mass", "body.stiffness", "body.damping")
    points = [tuple(point.values[key] for key in keys) for point in branch.points]
    assert scene.runs == 6
    assert points == [(1, 4, 0), (1, 4, 0.5), (2, 5, 0), (2, 5, 0.5), (3, 6, 0), (3, 6, 0.5)]


def test_a_zipped_value_may_repeat_while_its_points_differ() -> None:
    zipped = (
        '"body.mass" = { values = [1, 1], zip = "size" }',
        '"body.stiffness" = { values = [4, %d], zip = "size" }',
    )
    assert swept(zipped[0], zipped[1] % 5).runs == 2
    assert "got 1.0, 4.0 2 times" in problems(zipped[0], zipped[1] % 4)[0]


@given(
    st.sampled_from(["random", "sobol", "saltelli"]), st.integers(0, 6), st.integers(1, 5), st.integers(0, 99)
)
def test_a_larger_design_begins_with_the_smaller_one(design: str, power: int, keys: int, seed: int) -> None:
    small, large = (unit_design(design, 2**p, keys, seed) for p in (power, power + 1))  # type: ignore[arg-type]
    assert (large[: len(small)] == small).all()
    assert ((large >= 0) & (large < 1)).all()


@given(st.floats(1e-3, 1e3), st.floats(1.001, 1e3), st.floats(0, 1, exclude_max=True))
def test_no_drawn_value_lies_outside_its_ends(low: float, ratio: float, share: float) -> None:
    high = low * ratio
    spread = normal(0.5 * (low + high), high - low, low, high)
    for quantile in (uniform(low, high), log_uniform(low, high), spread):
        (value,) = drawn(np.array([share]), quantile, low, high)
        assert low <= value <= high


def test_drawn_values_have_the_moments_of_their_distribution() -> None:
    shares = unit_design("sobol", 4096, 1, 2)[:, 0]
    flat = np.array(drawn(shares, uniform(2.0, 5.0), 2.0, 5.0))
    bell = np.array(drawn(shares, normal(3.0, 0.5), -math.inf, math.inf))
    decades = np.log10(drawn(shares, log_uniform(1.0, 1e4), 1.0, 1e4))
    assert (flat.mean(), flat.std()) == pytest.approx((3.5, 3.0 / math.sqrt(12.0)), rel=1e-3)
    assert (bell.mean(), bell.std()) == pytest.approx((3.0, 0.5), rel=2e-3)
    assert (decades.mean(), decades.std()) == pytest.approx((2.0, 4.0 / math.sqrt(12.0)), rel=1e-3)


def test_a_saltelli_design_changes_one_column_at_a_time() -> None:
    a, b, first, second = unit_design("saltelli", 1, 2, 0)
    assert first.tolist() == [b[0], a[1]]
    assert second.tolist() == [a[0], b[1]]


UNIFORM = '"body.mass" = { distribution = "uniform", low = %s, high = %s }'
SOBOL = 'sample = { design = "sobol", points = 8 }'
BAD = {
    "expected low < high, got low = 2.0 and high = 1.0": [SOBOL, UNIFORM % (2, 1)],
    "expected a number > 0, got -": [SOBOL, UNIFORM % (-1, 1)],
    "expected sample beside a distribution, got none": [UNIFORM % (1, 2)],
    "expected a power of 2 of a sobol design, got 100. Use 64 or 128": [
        SOBOL.replace("8", "100"),
        UNIFORM % (1, 2),
    ],
    "expected keys that are drawn, got none": [SOBOL, '"body.mass" = { values = [1, 2] }'],
    "expected mean and deviation of a normal distribution, got mean": [
        SOBOL,
        '"body.mass" = { distribution = "normal", mean = 1 }',
    ],
    "expected low > 0 of a log-uniform distribution": [
        SOBOL,
        (UNIFORM % (-1, 1)).replace("uniform", "log-uniform"),
    ],
    "expected low and high around the mean": [
        SOBOL,
        '"body.mass" = { distribution = "normal", mean = 1, deviation = 0.1, low = 5 }',
    ],
    "expected ends whose ratio is a number": [
        SOBOL,
        '"body.stiffness" = { distribution = "log-uniform", low = 1e-300, high = 1e300 }',
    ],
    "expected ends whose distance is a number, got low = -1.7e+308": [
        SOBOL,
        '"body.velocity_start" = { distribution = "uniform", low = -1.7e308, high = 1.7e308 }',
    ],
    "expected a deviation whose multiples are numbers, got 1e+308": [
        SOBOL,
        '"body.velocity_start" = { distribution = "normal", mean = 0, deviation = 1e308 }',
    ],
    "Drawn values have 12 digits: widen the distribution": [SOBOL, UNIFORM % (1, 1.0000000000000002)],
    'sweep.sample: expected a table, got "sobol". Write sample = {': ['sample = "sobol"', UNIFORM % (1, 2)],
    "expected two drawn keys or more beside saltelli, got body.mass": [
        SOBOL.replace("sobol", "saltelli"),
        UNIFORM % (1, 2),
    ],
    "expected at most 131072 points of a saltelli design, got 262144, which is 1048576 runs of 2 keys": [
        SOBOL.replace('sobol", points = 8', 'saltelli", points = 262144'),
        UNIFORM % (1, 2),
        (UNIFORM % (1, 2)).replace("mass", "stiffness"),
    ],
    'expected at most 1000000 values of a range with spacing = "log"': [
        '"body.mass" = { start = 1, stop = 2, points = 1000001, spacing = "log" }'
    ],
    "expected values that differ from each other": [
        '"body.mass" = { start = 1, stop = 1.0000000000000002, points = 1000001 }'
    ],
    "expected a distribution beside them, got low": [
        '"body.mass" = { start = 1, stop = 2, points = 3, low = 0 }'
    ],
    "got 2 of body.mass and 3 of body.stiffness": [
        '"body.mass" = { values = [1, 2], zip = "size" }',
        '"body.stiffness" = { values = [1, 2, 3], zip = "size" }',
    ],
    'expected "independent" beside zip': ['"body.mass" = { values = [1, 2], zip = "size", path = "up" }'],
    "expected a name that datasets do not use themselves": ['"body.mass" = { values = [1, 2], zip = "run" }'],
    'expected a name that datasets do not use themselves, got "point"': [
        '"body.mass" = { values = [1, 2], zip = "point" }'
    ],
    "expected a zip that is no name of a swept key": ['"body.mass" = { values = [1, 2], zip = "mass" }'],
}


@pytest.mark.parametrize("text", BAD)
def test_a_wrong_axis_is_one_line_that_says_what_to_do(text: str) -> None:
    (problem,) = problems(*BAD[text])
    assert text in problem


RANGE = "start = 1, stop = 2, points = 5"
BAD_ADAPTIVE = {
    "expected at most 1000000 values of an adaptive axis, got 1000001": [
        '"body.mass" = { start = 1, stop = 2, points = 1000001, adaptive = { tolerance = 1e-9, at_most = 90 } }'
    ],
    "expected a tolerance >= 1.78e-15, got 1e-16": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-16, at_most = 90 }} }}'
    ],
    "expected a tolerance < 0.25": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 0.3, at_most = 90 }} }}'
    ],
    "expected more than 5 points, got 5": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 5 }} }}'
    ],
    "expected a number > 0 and <= 1, got 0.": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 90, jump = 0 }} }}'
    ],
    'expected a number > 0, got "1e-3". Write the number alone, without quotes.': [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = "1e-3", at_most = 90 }} }}'
    ],
    "expected a number > 0, got nan": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = nan, at_most = 90 }} }}'
    ],
    "expected a whole number from 2 to 1000000, got 90.0": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 90.0 }} }}'
    ],
    "expected a table with tolerance and at_most, got true": [
        f'"body.mass" = {{ {RANGE}, adaptive = true }}'
    ],
    "expected more than 5 points, got 2": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 2 }} }}'
    ],
    "expected two values or more of an adaptive axis, got 1": [
        '"body.mass" = { values = [1], adaptive = { tolerance = 1e-3, at_most = 9 } }'
    ],
    "expected ends whose distance is a number, got -1.7e+308 and 1.7e+308": [
        '"body.velocity_start" = { values = [-1.7e308, 1.7e308], adaptive = { tolerance = 1e300, at_most = 9 } }'
    ],
    "expected no adaptive beside zip": [
        '"body.mass" = { values = [1, 2], zip = "size", adaptive = { tolerance = 1e-3, at_most = 9 } }'
    ],
    "expected the most points of the sweep, got nothing": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3 }} }}'
    ],
    'got the unknown key "at_mos". Did you mean at_most?': [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_mos = 9 }} }}'
    ],
    "expected one or two adaptive axes": [
        f'"{key}" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 900 }} }}'
        for key in ("body.mass", "body.stiffness", "body.damping")
    ],
    'expected "independent" of two adaptive axes': [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 900 }} }}',
        f'"body.damping" = {{ {RANGE}, path = "up", adaptive = {{ tolerance = 1e-3 }} }}',
    ],
    'expected "independent" beside an adaptive axis': [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 900 }} }}',
        '"body.stiffness" = { values = [1, 2], path = "up" }',
    ],
    "expected no axis beside two adaptive ones": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 900 }} }}',
        f'"body.damping" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3 }} }}',
        '"body.stiffness" = { values = [1, 2] }',
    ],
    "expected one number of points for the whole sweep, got 800 and 900": [
        f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 900 }} }}',
        f'"body.damping" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 800 }} }}',
    ],
}


@pytest.mark.parametrize("text", BAD_ADAPTIVE)
def test_a_wrong_adaptive_axis_is_one_line_that_says_what_to_do(text: str) -> None:
    (problem,) = problems(*BAD_ADAPTIVE[text])
    assert text in problem


def test_a_whole_number_is_not_adaptive() -> None:
    text = TEXT.replace("mass = 1", 'kind = "chain"\nmasses = [1, 1, 1, 1]').replace(
        "stiffness = 4", "stiffnesses = [1, 1, 1, 1]"
    )
    text = text.replace("damping = 0.1\n", "")
    line = '"body.modes" = { values = [1, 4], adaptive = { tolerance = 1, at_most = 9 } }'
    with pytest.raises(SceneError, match="expected a key between whose values there are others"):
        parse_scene(text + line, "scene.toml")


sizes = st.floats(-300.0, 300.0).map(lambda power: 10.0**power)


@given(start=sizes, stop=sizes, points=st.integers(2, 50), sign=st.sampled_from([-1.0, 1.0]))
def test_a_log_axis_has_its_ends_one_sign_and_one_ratio(
    start: float, stop: float, points: int, sign: float
) -> None:
    ends = f"start = {sign * start}, stop = {sign * stop}, points = {points}"
    axes, refused = read(f'"body.velocity_start" = {{ {ends}, spacing = "log" }}')
    if refused:
        assert "values that differ from each other" in refused[0]
        assert start == pytest.approx(stop, rel=1e-12)
        return
    (axis,) = axes
    assert (axis.values[0], axis.values[-1]) == (sign * start, sign * stop)
    assert all(value * sign > 0.0 for value in axis.values)
    steps = np.diff(np.log(np.abs(axis.values)))
    assert steps == pytest.approx(np.full(points - 1, steps.mean()), abs=1e-12, rel=1e-9)


@given(
    st.lists(st.lists(st.integers(0, 3), min_size=1, max_size=3), min_size=1, max_size=3),
    st.sampled_from(["independent", "up-down"]),
)
def test_the_points_of_zipped_axes_are_one_of_each_group(groups: list[list[int]], path: str) -> None:
    """The keys of a group move together, one for each number; its first number plus 1 is their number of values."""
    free = iter(
        ["body.mass", "body.stiffness", "body.damping", "body.displacement_start", "body.velocity_start"]
    )
    lines, lengths = [], []
    for number, group in enumerate(groups):
        keys = [key for key, _ in zip(free, group, strict=False)]
        count = group[0] + 1
        values = [round(0.1 + 0.1 * place, 1) for place in range(count)]
        lines += [f'"{key}" = {{ values = {values}, zip = "group_{number}" }}' for key in keys]
        lengths += [count] if keys else []
    lines.append(f'"stop[1].position" = {{ values = [1.0, 2.0], path = "{path}" }}')
    scene = swept(*lines)
    points = [point for branch in expand(scene) for point in branch.points]
    ways = 2 if path == "up-down" else 1
    assert len(points) == scene.runs == math.prod(lengths) * 2 * ways
    assert [point.index for point in points] == list(range(scene.runs))
    assert len({tuple(sorted(point.values.items())) for point in points}) == scene.runs // ways


@given(
    design=st.sampled_from(["random", "sobol", "saltelli"]),
    power=st.integers(0, 5),
    kind=st.sampled_from(["uniform", "log-uniform", "normal"]),
    low=sizes,
    ratio=st.floats(1.0, 1e12),
)
def test_any_distribution_gives_sound_values_or_problems(
    design: str, power: int, kind: str, low: float, ratio: float
) -> None:
    high = min(low * ratio, 1e300)
    moments = f", mean = {low}, deviation = {0.1 * high}" if kind == "normal" else ""
    lines = [
        f'sample = {{ design = "{design}", points = {2**power} }}',
        f'"body.stiffness" = {{ distribution = "{kind}", low = {low}, high = {high}{moments} }}',
        UNIFORM % (1, 2),
    ]
    axes, refused = read(*lines)
    if refused:
        assert all(": expected " in problem and ", got " in problem for problem in refused)
        return
    first, second = axes
    assert len(first.values) == len(second.values) == 2**power * (4 if design == "saltelli" else 1)
    assert all(low <= value <= high for value in first.values)


def test_a_drawn_frequency_in_hertz_is_the_motion_of_one_in_radians() -> None:
    text = TEXT.replace("recorded_time = 5", "recorded_periods = 5")
    tables = "[forcing]\namplitude = 1\n%s = 1\n[[stop]]"
    drawn_text = text.replace("[[stop]]", tables % "frequency") + SOBOL
    line = '"forcing.frequency" = { distribution = "uniform", low = 0.1, high = 0.4 }'
    scene = parse_scene(f"{drawn_text}\n{line}", "scene.toml")
    hertz = np.array(scene.sweep[0].values)
    listed_text = text.replace("[[stop]]", tables % "angular_frequency")
    radians = f'"forcing.angular_frequency" = {{ values = {(2.0 * math.pi * hertz).tolist()} }}'
    one, other = (
        vi.run(each, progress=False) for each in (scene, parse_scene(listed_text + radians, "s.toml"))
    )
    assert one.frequency.attrs["units"] == "Hz"
    assert one.frequency.values.tolist() == hertz.tolist()
    other = other.isel(angular_frequency=np.argsort(np.argsort(hertz)))
    np.testing.assert_allclose(one.displacement_range, other.displacement_range, rtol=1e-9)


@pytest.mark.parametrize(
    ("record", "text"),
    [
        ("each_period = false", "record.each_period: expected true beside an adaptive axis, got false."),
        (
            "extrema = false\nstrobe = false\nimpacts = false",
            "record: expected impacts, or the extrema or strobe of periods, beside an adaptive axis, got none of them.",
        ),
        ("extrema = false\nstrobe = false\neach_period = false", ""),
    ],
)
def test_an_adaptive_axis_needs_what_tells_motions_apart(record: str, text: str) -> None:
    forced = TEXT.replace("[[stop]]", "[forcing]\namplitude = 1\nangular_frequency = 1\n[[stop]]")
    forced = forced.replace("recorded_time = 5", f"recorded_periods = 5\n{record}")
    line = f'"body.mass" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 90 }} }}'
    if not text:
        assert parse_scene(forced + line, "scene.toml").runs == 5
        return
    with pytest.raises(SceneError) as caught:
        parse_scene(forced + line, "scene.toml")
    (problem,) = str(caught.value).splitlines()
    assert text in problem


def test_an_adaptive_axis_of_components_needs_their_events() -> None:
    text = (ROOT / "examples" / "two_oscillators.toml").read_text()
    line = f'[sweep]\n"connection[1].gain" = {{ {RANGE}, adaptive = {{ tolerance = 1e-3, at_most = 90 }} }}'
    assert parse_scene(f"{text}\n{line}", "scene.toml").runs == 5
    silent = text.replace("rate = 20", "rate = 20\nevents = false")
    with pytest.raises(SceneError, match=r"record\.events: expected true beside an adaptive axis, got false"):
        parse_scene(f"{silent}\n{line}", "scene.toml")
