"""What pyproject.toml asks for has two bounds, a reason beside them, and no version with a hole that is known."""

import re
import tomllib
from collections.abc import Iterator

import pytest
from packaging.requirements import Requirement
from packaging.version import Version
from support.places import ROOT

OWN = "vibroimpact"
LAST_WITH_A_HOLE = {"starlette": "0.49.0", "h11": "0.15.0", "fastapi": "0.120.0", "cryptography": "44.0.0"}
"""The last version with a known hole, or that keeps another package at such a version."""


OF_DEVELOPERS = ("bench", "peers", "lint", "docs", "dev", "audit")
"""Extras that nobody installs who uses the package; one reason stands above all of them."""


def requirements() -> Iterator[Requirement]:
    """Yield every requirement of pyproject.toml on packages of others."""
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
