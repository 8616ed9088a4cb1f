"""Scenes with other numbers: the rest of the text stays as it was written."""

from __future__ import annotations

import tomllib

import pytest

from vibroimpact.orchestrator.scene.changes import text_with_values


@pytest.mark.parametrize(
    ("text", "values", "expected"),
    [
        # comments, blanks, and a number in another notation
        ("[body] # b\nmass   = 0x10  # kg\n", {"body.mass": 2.5}, "[body] # b\nmass   = 2.5  # kg\n"),
        # dotted keys, quoted keys
        ("body.mass = 1\nx.y = 2\n", {"body.mass": 1e-7}, "body.mass = 1e-07\nx.y = 2\n"),
        ("\"body\".'mass' = 1 # kg\n", {"body.mass": 2.5}, "\"body\".'mass' = 2.5 # kg\n"),
        # an inline table, and an inline table with a new key
        ("body = { mass = 1, stiffness = 4 } # b\n", {"body.mass": 2.5}, "body = { mass = 2.5, stiffness = 4 } # b\n"),
        ("sensor = {gain = 1.0}\n", {"sensor.offset": 2.5}, "sensor = {gain = 1.0,offset = 2.5}\n"),
        # arrays of tables in both notations
        (
            "[[stop]]\nposition = 1\n\n[[stop]]\nposition = 2 # second\n",
            {"stop[2].position": 3.5},
            "[[stop]]\nposition = 1\n\n[[stop]]\nposition = 3.5 # second\n",
        ),
        (
            "stop = [{position = 1},\n  # second\n  {position = 2}]\n",
            {"stop[2].position": 3.5},
            "stop = [{position = 1},\n  # second\n  {position = 3.5}]\n",
        ),
        # one element of an array
        (
            "[body]\ndamping_ratio = [\n  0.1, # first\n  0.2, # second\n]\n",
            {"body.damping_ratio[2]": 0.25},
            "[body]\ndamping_ratio = [\n  0.1, # first\n  0.25, # second\n]\n",
        ),
        # a new key goes after the last key of its table, before the comment of the next table
        (
            "[sensor]\ngain = 1.0\n\n# what drives\n[replay]\n",
            {"sensor.offset": 2.5},
            "[sensor]\ngain = 1.0\noffset = 2.5\n\n# what drives\n[replay]\n",
        ),
        # a table in two places
        (
            "[body.rayleigh]\nmass = 1\n[scene]\n[body]\nlength = 2 # m\n",
            {"body.length": 2.5},
            "[body.rayleigh]\nmass = 1\n[scene]\n[body]\nlength = 2.5 # m\n",
        ),
        # the damping ratio would override the damping
        ("[body]\ndamping_ratio = 0.1\nmass = 1\n", {"body.damping": 2.5}, "[body]\nmass = 1\ndamping = 2.5\n"),
    ],
)  # fmt: skip
def test_a_new_number_changes_nothing_else_of_the_text(
    text: str, values: dict[str, float], expected: str
) -> None:
    assert text_with_values(text, values) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "[replay] # r\nlag = 1 # s\n\n# where\n[sensor]\n",
            "[replay] # r\nlag = 1 # s\nrecordings = {}\n\n# where\n[sensor]\n",
        ),
        ("replay = { lag = 1 } # r\n", "replay = { lag = 1, recordings = {}} # r\n"),
        ("replay.lag = 1\n[sensor]\n", "replay.lag = 1\nreplay.recordings = {}\n[sensor]\n"),
        ("[replay]\nrecordings = ['a.nc', # first\n 'b.nc']\n", "[replay]\nrecordings = [{}, # first\n {}]\n"),
    ],
)  # fmt: skip
def test_recordings_are_named_in_whatever_way_the_table_is_written(text: str, expected: str) -> None:
    names = ['/data/a "1".nc', "/data/\N{GREEK SMALL LETTER OMEGA}\\.nc"]
    shown = [r'"/data/a \"1\".nc"', '"/data/\N{GREEK SMALL LETTER OMEGA}\\\\.nc"']
    filled = expected.replace("{}", "[{}, {}]") if expected.count("{}") == 1 else expected
    for name in shown:
        filled = filled.replace("{}", name, 1)
    assert text_with_values(text, {}, names) == filled
    assert tomllib.loads(filled)["replay"]["recordings"] == names


def test_every_digit_of_a_number_is_kept() -> None:
    for value in (1.0 / 3.0, -5e-324, 1.7976931348623157e308, 1e22):
        assert tomllib.loads(text_with_values("body.mass = 1", {"body.mass": value}))["body"]["mass"] == value


def test_a_text_written_back_wrong_is_the_same_scene_without_its_comments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import tomlkit

    text = "[body]\nmass = 1 # kg\n"
    plain = tomlkit.dumps
    monkeypatch.setattr(
        tomlkit, "parse", lambda given: tomllib.loads(given.replace("[body]", "[lost.body]\n[body]"))
    )
    assert text_with_values(text, {"body.mass": 2.5}) == plain({"body": {"mass": 2.5}})
