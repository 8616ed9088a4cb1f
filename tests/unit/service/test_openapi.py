"""What clients of the service may ask, and what they are answered, is what it was: `openapi.json` has it."""

from __future__ import annotations

from support.openapi import openapi
from support.public_names import OPENAPI


def test_the_service_describes_itself_as_it_did() -> None:
    assert openapi() == OPENAPI.read_text(encoding="utf-8"), "run python -P tests/support/public_names.py"
