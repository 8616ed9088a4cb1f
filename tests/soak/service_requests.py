"""Random requests of every route (schemathesis): each answer follows the OpenAPI document of the service."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from support.served import Served

CASES = 10
SAMPLE = 1
SECONDS = 400.0
EXAMPLES = 3
"""Random requests of each route, on top of those from its description: some 200 in a case."""
FEWEST = 100
REQUEST_SECONDS = 60
"""Time after which a request counts as unanswered, on a machine that is busy with other cases too, s."""
CHECKS = (
    *("not_a_server_error", "status_code_conformance", "content_type_conformance"),
    *("response_headers_conformance", "response_schema_conformance", "unsupported_method"),
)
"""Checks of an answer. Acceptance of all input that fits the schema is no check: TOML is a text to JSON schema."""


def check(seed: int) -> str | None:
    """Send the requests to a service that belongs to the case."""
    served = Served(Path("service").absolute(), "--allow-fmu-upload")
    try:
        token = (served.folder / "token").read_text(encoding="utf-8").strip()
        found = subprocess.run(
            [
                *(sys.executable, "-m", "schemathesis.cli", "run", f"{served.url}/api/v1/openapi.json"),
                *("--header", f"Authorization: Bearer {token}", "--checks", ",".join(CHECKS)),
                *("--max-examples", str(EXAMPLES), "--seed", str(seed), "--no-color"),
                *("--phases", "coverage,fuzzing", "--generation-database=none"),
                *("--request-timeout", str(REQUEST_SECONDS)),
            ],
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        served.stop()
    if found.returncode:
        said = re.split(r"=+ WARNINGS =+", found.stdout + found.stderr)[0]
        return said[-2000:]
    cases = re.search(r"(\d+) generated", found.stdout)
    if cases is None or int(cases[1]) < FEWEST:
        return f"expected {FEWEST} requests or more, got {cases and cases[1]}"
    return None
