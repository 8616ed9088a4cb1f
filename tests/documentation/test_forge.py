"""Files for a forge and pre-commit are valid, and name existing targets, programs and versions."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.places import ROOT

FORGE = ROOT / ".github"
FORMS = sorted(path for path in (FORGE / "ISSUE_TEMPLATE").glob("*.yml") if path.stem != "config")
WORKFLOW = FORGE / "workflows" / "ci.yml"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TARGETS = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def steps() -> list[dict[str, Any]]:
    return [step for job in read(WORKFLOW)["jobs"].values() for step in job["steps"]]


def test_the_workflow_calls_targets_of_the_makefile_and_extras_that_are_there() -> None:
    commands = [step["run"] for step in steps() if "run" in step]
    made = {target for command in commands for target in re.findall(r"^make (\w+)$", command, re.MULTILINE)}
    assert made == {"test", "oldest", "lint", "docs", "soak", "audit"}
    assert made <= TARGETS
    for command in commands:
        for extra in re.findall(r"\.\[(\w+)\]", command):
            assert extra in PROJECT["optional-dependencies"]


def test_the_workflow_asks_for_pythons_that_the_package_allows_the_oldest_among_them() -> None:
    jobs = read(WORKFLOW)["jobs"]
    stated = {step["with"]["python-version"] for step in steps() if "python-version" in step.get("with", {})}
    stated |= set(jobs["linux"]["strategy"]["matrix"]["python"])
    stated |= {one["python"] for one in jobs["untried"]["strategy"]["matrix"]["include"]}
    versions = {tuple(map(int, version.split("."))) for version in stated if "{" not in version}
    assert min(versions) == (3, 11)
    assert PROJECT["requires-python"] == ">=3.11"
    assert {f"3.{minor}" for minor in range(11, 15)} <= stated
    assert jobs["untried"]["continue-on-error"] is True


def test_long_series_run_each_week_and_no_push_waits_for_them() -> None:
    workflow = read(WORKFLOW)
    # YAML reads the key `on` as true
    assert workflow[True]["schedule"] == [{"cron": "17 2 * * 6"}]
    assert workflow["jobs"]["soak"]["if"] == "github.event_name == 'schedule'"
    assert {"run": "make soak", "env": {"MINUTES": 240}} in workflow["jobs"]["soak"]["steps"]


def test_advisories_are_asked_for_each_week_for_they_come_without_a_push() -> None:
    job = read(WORKFLOW)["jobs"]["audit"]
    assert job["if"] == "github.event_name == 'schedule'"
    assert {"run": "make audit"} in job["steps"]


def test_the_workflow_may_read_only() -> None:
    assert read(WORKFLOW)["permissions"] == {"contents": "read"}


@pytest.mark.parametrize("form", FORMS, ids=lambda path: path.stem)
def test_an_issue_form_asks_questions_each_with_a_name_of_its_own(form: Path) -> None:
    content = read(form)
    assert content["name"]
    assert content["description"]
    ids = [question["id"] for question in content["body"]]
    assert len(set(ids)) == len(ids) > 2
    assert all(question["attributes"]["label"] for question in content["body"])


@pytest.mark.parametrize("name", ["bug", "wrong_number"])
def test_who_reports_a_fault_says_the_version_and_the_scene(name: str) -> None:
    questions = {one["id"]: one for one in read(FORGE / "ISSUE_TEMPLATE" / f"{name}.yml")["body"]}
    assert "`vibroimpact --version`" in questions["version"]["attributes"]["description"]
    for key in ("version", "scene"):
        assert questions[key]["validations"]["required"] is True


def test_pre_commit_runs_programs_of_the_lint_extra_and_those_of_make_lint() -> None:
    hooks = [hook for repo in read(ROOT / ".pre-commit-config.yaml")["repos"] for hook in repo["hooks"]]
    programs = {hook["entry"].split()[0].removeprefix(".venv/bin/") for hook in hooks}
    linted = set(
        re.findall(r"^\t\$\(BIN\)/(ruff|mypy|lint-imports)\b", (ROOT / "Makefile").read_text(), re.M)
    )
    assert programs == linted | {"git-clang-format"}
    packages = " ".join(PROJECT["optional-dependencies"]["lint"])
    for package in ("ruff", "mypy", "import-linter", "clang-format"):
        assert package in packages


def test_clang_format_has_the_columns_and_indent_of_the_c_code() -> None:
    style = read(ROOT / ".clang-format")
    assert (style["ColumnLimit"], style["IndentWidth"]) == (120, 4)
