"""Bodies of requests are made from declared operations: their keys, limits and descriptions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from vibroimpact.analysis.operations.estimate_impacts import EstimateImpacts
from vibroimpact.service import requests

ESTIMATE: TypeAdapter[BaseModel] = TypeAdapter(requests.Estimate)


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "decay", "unknown": 1},
        {"kind": "nonsense"},
        {"kind": "impacts", "mass": 0.0},
        {"kind": "impacts", "phase": math.nan},
        {"kind": "impacts", "forcing_frequency": -1.0},
        {"kind": "response", "estimator": "h3"},
        {"kind": "response", "band": [1.0, 0.0]},
        {"kind": "response", "segment": 15},
        {"kind": "spikes", "channel": ""},
        {"kind": "spikes", "method": "threshold"},
        {"kind": "decay", "output": "/etc/passwd"},
    ],
)
def test_a_body_that_breaks_the_declaration_is_refused(body: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ESTIMATE.validate_python(body)


def test_keys_have_the_words_of_the_arguments() -> None:
    schema = requests.body_of("impacts", EstimateImpacts).model_json_schema()
    words = {field.name: field.words.help for field in EstimateImpacts.fields()}
    assert schema["properties"]["stop"]["description"] == words["stop_time"]
    assert schema["properties"]["stop_position"]["description"] == words["stop"]
    assert not {"data", "output", "figure", "force"} & schema["properties"].keys()


def test_a_job_carries_out_the_operation_that_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[EstimateImpacts] = []
    monkeypatch.setattr(EstimateImpacts, "carry_out", lambda body, spelling: done.append(body))
    body = {"kind": "impacts", "stop": 2.0, "stop_position": 0.5, "mass": 3.0}
    requests.estimate(tmp_path, {"data": "a.nc", "asked": body})
    place = {"data": tmp_path / "a.nc", "output": tmp_path / requests.OUTPUT, "force": True}
    assert done == [EstimateImpacts(**place, stop_time=2.0, stop=0.5, mass=3.0)]
