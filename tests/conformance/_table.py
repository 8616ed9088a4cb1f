"""The table of the outcomes of NI's tests, file by file."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from conformance._reasons import NOT_RUN, reason_not_met

HEADING = "## NI's own tests"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of a test.

    Attributes
    ----------
    test : str
        Name of the test for pytest, with the path of its file.
    outcome : str
        `passed`, `failed`, `skipped` (by NI: it needs another device), or `refused` (the rig does not model it).
    said : str
        The first line of the error.
    """

    test: str
    outcome: str
    said: str = ""

    @property
    def file(self) -> str:
        """File of the test, below the folder of component tests."""
        return self.test.split("::")[0].removeprefix("tests/component/")


def one_for_each(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Return the worst outcome of each test: set-up, call and end have one outcome each."""
    worst = ("failed", "refused", "skipped", "passed")
    found: dict[str, Outcome] = {}
    for outcome in outcomes:
        known = found.get(outcome.test)
        if known is None or worst.index(outcome.outcome) < worst.index(known.outcome):
            found[outcome.test] = outcome
    return list(found.values())


def failures(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Return the tests that fail without being allowed to."""
    return [each for each in outcomes if each.outcome == "failed" and reason_not_met(each.test) is None]


def section(outcomes: Iterable[Outcome], client: str, commit: str) -> str:
    """Return the section of docs/rig.md.

    Parameters
    ----------
    outcomes : iterable of Outcome
    client, commit : str
        Version of nidaqmx, commit of the checkout.
    """
    numbers: dict[str, Counter[str]] = defaultdict(Counter)
    reasons: Counter[str] = Counter()
    for each in outcomes:
        why = reason_not_met(each.test) if each.outcome == "failed" else None
        numbers[each.file]["not met" if why else each.outcome] += 1
        if why:
            reasons[why] += 1
    total = sum(numbers.values(), Counter())
    head = [
        "`make conformance NI_TESTS=...` runs `tests/component` of a checkout of ni/nidaqmx-python on the virtual rig,",
        f"unmodified, through NI's client. Last run: their commit {commit}, nidaqmx {client}.",
        "",
        "| outcome | tests |",
        "|---|---|",
        f"| pass | {total['passed']} |",
        f"| refused with -200452 (the rig has no model of the call) | {total['refused']} |",
        f"| skipped by NI's own fixtures (they look for another device) | {total['skipped']} |",
        f"| do not apply (below) | {total['not met']} |",
        f"| fail | {total['failed']} |",
    ]
    columns = ("passed", "refused", "skipped", "not met", "failed")
    rows = [
        f"| `{file}` | " + " | ".join(str(count[name] or "") for name in columns) + " |"
        for file, count in sorted(numbers.items())
    ]
    table = [
        "| file | pass | refused | other device | do not apply | fail |",
        "|---|---|---|---|---|---|",
        *rows,
    ]
    why = [f"- {count}: {reason}." for reason, count in sorted(reasons.items())]
    left_out = [f"- {reason}." for reason in dict.fromkeys(NOT_RUN.values())]
    parts = [HEADING, "", *head, "", *table, "", "Do not apply:", "", *why, "", "Files that are not run:", ""]
    return "\n".join([*parts, *left_out]) + "\n"


def write_section(page: Path, text: str) -> None:
    """Replace the section in a page."""
    whole = page.read_text(encoding="utf-8")
    before, there, rest = whole.partition(HEADING)
    _, following, after = rest.partition("\n## ")
    if not there:
        before, following, after = whole.rstrip() + "\n\n", "", ""
    page.write_text(before + text + (f"\n## {after}" if following else ""), encoding="utf-8")
