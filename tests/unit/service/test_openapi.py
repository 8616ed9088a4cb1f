"""The service's requests and answers are unchanged: `openapi.json` describes them."""

from __future__ import annotations

from support.openapi import openapi
from support.public_names import OPENAPI


def test_the_service_describes_itself_as_it_did() -> None:
    assert openapi() == OPENAPI.read_text(encoding="utf-8"), "run python -P tests/support/public_names.py"
