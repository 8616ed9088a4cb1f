"""One service for all tests that do not kill it: its start takes seconds."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest
from support.served import SHORT, Served, scene_file

from vibroimpact.service.client import RemoteJob


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    service = Served(tmp_path_factory.mktemp("served") / "service")
    yield service
    service.stop()


@pytest.fixture(scope="session")
def finished(served: Served, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RemoteJob]:
    """Yield a short finished campaign."""
    with served.client() as service:
        yield service.submit(scene_file(tmp_path_factory.mktemp("finished"), SHORT), workers=1).wait()


@pytest.fixture
def raw(served: Served) -> Iterator[httpx.Client]:
    token = (served.folder / "token").read_text(encoding="utf-8").strip()
    headers = {"Authorization": f"Bearer {token}"}
    with httpx.Client(base_url=f"{served.url}/api/v1", headers=headers, timeout=30.0) as client:
        yield client
