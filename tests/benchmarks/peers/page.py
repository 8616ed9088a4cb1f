"""The goals, met or missed, and the table of docs/accuracy.md, all from the record of the measurement."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

BEGIN, END = "<!-- measured beside other solvers -->\n", "<!-- end of measured -->"
GOAL_ERROR, GOAL_RATIO = 1e-6, 100.0

Rows = Sequence[Mapping[str, Any]]


def with_measurement(text: str, record: Mapping[str, Any]) -> str:
    """Return a page whose text between the two markers is made anew from the record.

    Raises
    ------
    ValueError
        The page has no such markers.
    """
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    if not pattern.search(text):
        raise ValueError(f"docs/accuracy.md: expected the markers {BEGIN.strip()} and {END}, got neither.")
    return pattern.sub(lambda _: BEGIN + measurement(record) + END, text)


def measurement(record: Mapping[str, Any]) -> str:
    """Return machine, goals, references and table in Markdown."""
    host = "; ".join(f"{key} {value}" for key, value in record["machine"].items())
    parts = [
        f"Measured on {record['date']}.\nMachine and versions:\n{host}.",
        _goals(record),
        _references(record),
        _growth(record),
        _table(record),
    ]
    return "\n\n".join(parts) + "\n"


def _of(record: Mapping[str, Any], case: Mapping[str, Any]) -> tuple[Mapping[str, Any], Rows]:
    rows = [row for row in record["rows"] if row["case"] == case["key"]]
    return rows[0], rows


def _goals(record: Mapping[str, Any]) -> str:
    """Return both goals, met or missed."""
    lines = [
        f"**Goal**: at errors below {GOAL_ERROR:g} the fused FMU costs {GOAL_RATIO:g} times less than any peer.",
        "",
        "| problem | goal | cheapest peer at such errors | cost over ours | cheapest single motion | cost over ours |",
        "|---|---|---|---|---|---|",
    ]
    lines += [_goal(record, case) for case in record["cases"]]
    grazes, rungs = _of(record, next(case for case in record["cases"] if case["key"] == "grazes"))
    rest, _ = _of(record, next(case for case in record["cases"] if case["key"] == "chatter"))
    full = sorted({row["way"] for row in rungs if not row["ours"] and not row["failure"]})
    found = "met" if not grazes["failure"] and rest["rest_error"] is not None else "missed"
    lines += [
        "",
        f"**Goal**: the fused FMU finds all grazes and the end of chatter: **{found}**.",
        f"It finds {grazes['impacts_seen']} of 11 grazes, and hits no stop out of reach.",
        f"The end of chatter is right to {rest['rest_error']:.0e} of a period.",
        f"Peers that find all grazes at one setting or more: {', '.join(full) or 'none'}.",
        "",
        f"A fused run of one period costs {record['one_period'] * 1e6:.0f} µs through the runner of `vi.run`, "
        "whatever it simulates.",
        "That is a large part of the cost of these short motions. A longer motion pays it once.",
    ]
    return "\n".join(lines)


def _goal(record: Mapping[str, Any], case: Mapping[str, Any]) -> str:
    """Return the row of a problem: whether the goal is met, and the cheapest peers below the goal's error."""
    own, rows = _of(record, case)
    near = [
        row
        for row in rows
        if not row["ours"] and not row["failure"] and row["cost"] and row["error"] is not None
        if row["error"] < GOAL_ERROR
    ]
    if not near:
        return f"| {case['title']} | **met** | none | - | none | - |"
    best = min(near, key=lambda row: float(row["cost"]))
    single = min((r for r in near if "vmapped" not in r["way"]), key=lambda r: float(r["cost"]), default=best)
    word = "met" if best["cost"] / own["cost"] >= GOAL_RATIO else "missed"
    peers = (f"{row['way']}, {_setting(row)} | {_ratio(row, own)}" for row in (best, single))
    return f"| {case['title']} | **{word}** | {' | '.join(peers)} |"


def _references(record: Mapping[str, Any]) -> str:
    """Return the largest difference between the reference and an independent one, by problem."""
    cells = [
        f"| {case['title']} | {case['second_road']:.0e} |"
        for case in record["cases"]
        if case["second_road"] is not None
    ]
    lines = [
        "A second computation checks the reference with no code of this package:",
        "DOP853 at 1e-13, and for grazes the flow in 40 digits.",
        "The table has their largest difference, with the errors of both:",
        "",
        "| problem | largest error |",
        "|---|---|",
    ]
    return "\n".join([*lines, *cells])


def _growth(record: Mapping[str, Any]) -> str:
    """Return the error of chaotic motion from impact to impact, of each way at its finest setting."""
    finest = {row["way"]: row for row in record["rows"] if row["growth"] and not row["failure"]}
    most = max((len(row["growth"]) for row in finest.values()), default=0)
    lines = [
        "The growth of errors in chaos: relative error of the velocity of the first impacts.",
        "Each way has its finest setting that misses no impact:",
        "",
        "| way | setting | " + " | ".join(str(place + 1) for place in range(most)) + " |",
        "|---|---|" + "---|" * most,
    ]
    for way, row in finest.items():
        cells = [f"{error:.0e}" if error else "0" for error in row["growth"]]
        lines.append(f"| {' | '.join([way, _setting(row), *cells])} |".replace("|  |", "| |"))
    return "\n".join(lines)


def _table(record: Mapping[str, Any]) -> str:
    lines = ["| problem | way | setting | error | µs a period | times fused |", "|---|---|---|---|---|---|"]
    for case in record["cases"]:
        own, rows = _of(record, case)
        for row in rows:
            error = row["failure"] or _error(row["error"], case["estimate"])
            cost = "-" if row["cost"] is None else f"{row['cost'] * 1e6:.3g}"
            cells = (case["title"], row["way"], _setting(row), error, cost, _ratio(row, own))
            lines.append(f"| {' | '.join(cells)} |".replace("|  |", "| |"))
    return "\n".join(lines)


def _error(error: float, known: float) -> str:
    """Return an error as text, or "<" and the error of the reference where that is larger."""
    return f"{error:.0e}" if error > known else f"< {known:.0e}"


def _setting(row: Mapping[str, Any]) -> str:
    return "" if row["setting"] is None else f"{row['knob']} {row['setting']:g}"


def _ratio(row: Mapping[str, Any], own: Mapping[str, Any]) -> str:
    return "-" if row["cost"] is None else f"{row['cost'] / own['cost']:.2g}"
