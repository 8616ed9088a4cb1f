"""A scene with new settings keeps its comments and its order, and names the reason of the settings."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.study.accuracy.tuned import tuned_text

BODY = "# a rig\n[body]\nmass = 1.0  # kg\n"


@pytest.mark.parametrize(
    "execution",
    [
        "",
        '\n[execution]\nhow = "coupled" # as FMUs\ndeadline = 3\n',
        '\n[execution]\n# why\nhow="auto"\n\n[record]\nrecorded_time = 1.0\n',
        "\nexecution = { deadline = 2.0 }\n",
        "\n[execution]\ncontact_tolerance = 1e-3",
        '\n[ execution ]\n"how" = "fused"\n',
    ],
)
def test_settings_are_put_in_and_all_else_stays(execution: str) -> None:
    text = execution + BODY if execution.startswith("\nexecution") else BODY + execution
    found = tuned_text(text, {"how": "fused", "contact_tolerance": 1e-8}, "the cheapest")
    before = parse_toml(text)
    expected = {
        **before,
        "execution": {**before.get("execution", {}), "how": "fused", "contact_tolerance": 1e-8},
    }
    assert parse_toml(found) == expected
    assert "# the cheapest" in found


def test_comments_stay() -> None:
    found = tuned_text(BODY + '[execution]\ndeadline = 3 # s\nhow = "auto"\n', {"how": "fused"}, "why")
    assert found == BODY + '[execution]\n# why\nhow = "fused"\ndeadline = 3 # s\n'


@given(st.dictionaries(st.sampled_from(["how", "macro_step", "guard"]), st.floats(0.1, 9.0) | st.booleans()))
def test_any_table_of_execution_is_kept_but_for_what_is_set(own: dict[str, float]) -> None:
    lines = "".join(f"{key} = {str(value).lower()}\n" for key, value in own.items())
    found = tuned_text(f"{BODY}\n[execution]\n{lines}\n[record]\n", {"macro_step": 0.5}, "why")
    assert parse_toml(found) == {"body": {"mass": 1.0}, "record": {}, "execution": {**own, "macro_step": 0.5}}
