"""Commands of the service where its packages are not installed."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.service.operations import packages
from vibroimpact.service.operations.cancel import Cancel
from vibroimpact.service.operations.fetch import Fetch
from vibroimpact.service.operations.packages import ServiceOperation
from vibroimpact.service.operations.serve import Serve
from vibroimpact.service.operations.status import Status
from vibroimpact.service.operations.submit import Submit

OPERATIONS = (
    (Cancel(name="0"), "httpx"),
    (Fetch(name="0", output=Path("fetched.nc")), "httpx"),
    (Serve(data=Path("served")), "fastapi, uvicorn, prometheus_client"),
    (Status(), "httpx"),
    (Submit(scene=Path("absent.toml")), "httpx"),
)


@pytest.mark.parametrize(("operation", "names"), OPERATIONS, ids=lambda value: type(value).__name__)
def test_what_to_install_is_said_before_anything_of_the_service_is_imported(
    operation: ServiceOperation, names: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(packages, "find_spec", lambda name: None)
    place = f"vibroimpact.{operation.runs.partition(':')[0]}"
    monkeypatch.delitem(sys.modules, place, raising=False)
    with pytest.raises(UsageError, match=rf"got none of {names}\. .*pip install 'vibroimpact\[service\]'"):
        operation.carry_out()
    assert place not in sys.modules
