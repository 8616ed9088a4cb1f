"""The requirements of pyproject.toml have two bounds, a reason next to them, and no version with a known hole."""

import json
import re
import subprocess
import tomllib
from collections.abc import Iterator

import pytest
from packaging.requirements import Requirement
from packaging.version import Version
from support import audit
from support.places import ROOT

OWN = "vibroimpact"
LAST_WITH_A_HOLE = {"starlette": "0.49.0", "h11": "0.15.0", "fastapi": "0.120.0", "cryptography": "44.0.0"}
"""The last version of a package with a known hole, or with a requirement of such a version of another package."""


OF_DEVELOPERS = ("bench", "peers", "lint", "docs", "dev", "audit")
"""Extras that no user of the package installs; one reason stands above all of them."""


def requirements() -> Iterator[Requirement]:
    """Yield every requirement of pyproject.toml, except for the package itself."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text())
    project = document["project"]
    lists = [document["build-system"]["requires"], project["dependencies"]]
    for each in [*lists, *project["optional-dependencies"].values()]:
        yield from (one for one in map(Requirement, each) if one.name != OWN)


@pytest.mark.parametrize("requirement", [*requirements()], ids=str)
def test_each_dependency_has_a_bound_below_and_one_above(requirement: Requirement) -> None:
    kinds = {bound.operator for bound in requirement.specifier}
    assert kinds in ({">=", "<"}, {"=="})


@pytest.mark.parametrize("requirement", [*requirements()], ids=str)
def test_a_version_that_is_a_date_is_bounded_two_years_on(requirement: Requirement) -> None:
    bounds = {bound.operator: Version(bound.version) for bound in requirement.specifier}
    if bounds.get(">=", Version("0")).major < 2000:
        return
    first, last = bounds[">="], bounds["<"]
    assert (last.major - first.major, last.minor) == (2, first.minor)


@pytest.mark.parametrize("name", [*LAST_WITH_A_HOLE])
def test_no_version_with_a_known_hole_is_let_in(name: str) -> None:
    found = [one for one in requirements() if one.name == name]
    assert found
    assert not any(one.specifier.contains(LAST_WITH_A_HOLE[name]) for one in found)


def lines_with_bounds() -> Iterator[str]:
    """Yield the lines of pyproject.toml that bound what users and tests install."""
    text = (ROOT / "pyproject.toml").read_text()
    _, _, project = text.partition("\ndependencies = [")
    extra = ""
    for line in project.partition("\n[project.scripts]")[0].splitlines():
        key = re.match(r"([\w-]+) = \[", line)
        extra = key[1] if key else extra
        if '"' in line and extra not in OF_DEVELOPERS and f'"{OWN}[' not in line:
            yield line.strip()


@pytest.mark.parametrize("line", [*lines_with_bounds()])
def test_the_reason_of_a_bound_stands_beside_it(line: str) -> None:
    _, _, reason = line.rpartition('"')
    assert "# " in reason


def test_the_lowest_versions_are_those_that_are_audited() -> None:
    lowest = dict(line.split("==") for line in audit.lowest())
    assert lowest["h11"] == "0.16"
    assert lowest["nolds"] == "0.6.2"
    here = {one.name for one in requirements() if one.marker is None or one.marker.evaluate()}
    assert here - {"hatchling", "FMPy"} == lowest.keys() - {"hatchling", "FMPy"}


KNOWN = {"name": "h11", "version": "0.14.0", "vulns": [{"id": "CVE-2025-43859"}]}
SOUND = {"name": "h11", "version": "0.16.0", "vulns": []}
UNKNOWN = {"name": "h11", "skip_reason": "Dependency not found on PyPI and could not be audited: h11 (0.16)"}


@pytest.mark.parametrize(
    ("dependencies", "said", "expected"),
    [
        ([SOUND, UNKNOWN], "", 0),
        ([SOUND, KNOWN], "Found 1 known vulnerability in 1 package", 1),
        ([UNKNOWN], "No known vulnerabilities found", 0),
        (None, "requests.exceptions.ConnectionError: HTTPSConnectionPool: Max retries exceeded", 0),
        (None, "ERROR:pip_audit._cli: no such file", 1),
    ],
)
def test_a_hole_fails_and_a_database_out_of_reach_is_said_and_does_not(
    dependencies: list[dict[str, object]] | None,
    said: str,
    expected: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = "" if dependencies is None else json.dumps({"dependencies": dependencies, "fixes": []})
    answer = subprocess.CompletedProcess([], expected, stdout=out, stderr=said)
    monkeypatch.setattr(audit.subprocess, "run", lambda *_, **__: answer)
    assert audit.audited("the lowest versions") == expected
    output = capsys.readouterr()
    answered = any("vulns" in one for one in dependencies or [])
    assert ("could not be reached" in output.err) == (not answered and not expected)
    assert ("CVE-2025-43859" in output.out) == bool(expected and dependencies)
