"""Twelve short records of `make coverage`: eight plain ones and one of each spoiled kind."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from interval_coverage._asked import journal_line
from interval_coverage._records import KNOWN, REGIONS, SPOILS, record
from interval_coverage._table import FEWEST, HELD, HELD_IN_REGION, Share, shares, thin_cells

SEED = 1
PLAIN = (0, 2, 14, 16, 20, 24, 30, 34)
SPOILED = {11: "second mode", 35: "dry friction", 95: "speed-dependent restitution", 71: "second stop"}


@cache
def line(case):
    return journal_line((case, 0), SEED)


@pytest.mark.parametrize("case", SPOILED)
def test_nothing_is_sure_of_a_spoiled_record(case):
    assert line(case)["spoil"] == SPOILED[case]
    assert not line(case)["sure"]
    assert line(case)["verdict"].startswith(("not sure, because ", "refused: "))


def test_intervals_of_plain_records_hold_the_truth():
    lines = [line(case) for case in PLAIN]
    assert sum({"weak_form", "trajectory"} <= set(one["sure"]) for one in lines) >= 7
    held = [share for share in shares(lines) if share.low == HELD[0]]
    hits, total = sum(share.hits for share in held), sum(share.total for share in held)
    # intervals of one record are correlated: those of about two records may miss at once
    assert total > 80
    assert hits > 0.85 * total


def test_a_record_is_the_same_for_the_same_case_and_seed():
    one, other = record(24, SEED), record(24, SEED)
    assert one.truth == other.truth
    assert (one.values == other.values).all()
    assert record(24, SEED + 1).truth != one.truth
    again = record(24, SEED, 1)
    assert again.truth == one.truth
    assert np.std(again.values - one.values) == pytest.approx(
        np.sqrt(2.0) * one.noise * np.max(np.abs(one.values - one.truth["offset"])), rel=0.1
    )
    assert set(SPOILED.values()) == set(SPOILS)


def test_regions_are_drawn_evenly_with_all_that_may_be_known():
    drawn = [record(case, SEED) for case in range(12)]
    pairs = {(one.region, one.known) for one in drawn}
    assert len(pairs) == len(REGIONS) * len(KNOWN)
    for one in drawn:
        ratio = one.truth["angular_frequency"] / one.truth["natural_frequency"]
        hard = {REGIONS[1]: one.per_period == 50, REGIONS[2]: one.noise == 0.05, REGIONS[3]: ratio <= 0.8}
        assert hard.get(one.region, True)


def test_coverage_is_told_by_region_with_the_error_that_records_leave():
    held, missed = ([0.0, 1.0, -1.0, 1.0, truth] for truth in (0.5, 2.0))

    def line(region, *intervals):
        values = {str(k): one for k, one in enumerate(intervals)}
        return {
            "spoil": "",
            "known": "stop",
            "noise": 0.01,
            "flight_samples": 50.0,
            "region": region,
            "sure": {"weak_form": values},
        }

    lines = [line(REGIONS[1], *[held] * 6)] * 8 + [line(REGIONS[1], *[missed] * 6)] * 2
    found = {share.what: share for share in shares(lines)}
    one = found[f"{REGIONS[1]}: intervals"]
    assert (one.hits, one.total, one.low, one.high) == (48, 60, *HELD_IN_REGION)
    # all intervals of a record miss at once: ten records, not sixty intervals
    assert one.error == pytest.approx(math.sqrt(0.8 * 0.2 / 10))
    assert not one.missed
    assert replace(one, error=0.02).missed
    assert found[f"{REGIONS[1]}: records of which something is sure"].hits == 10
    assert f"{REGIONS[0]}: intervals" not in found


@pytest.mark.parametrize(
    ("hits", "missed"), [(95, False), (92, False), (99, False), (84, True), (100, False), (60, True)]
)
def test_a_share_misses_its_target_only_beyond_chance(hits, missed):
    assert Share("intervals", hits, 100, *HELD).missed is missed


def test_cells_of_few_intervals_are_asked_again_and_told_apart():
    sure = {"weak_form": {"phase": [0.0, 1.0, -1.0, 1.0, 0.5]}}
    many = [{"case": case, "draw": 0, "spoil": "", "sure": sure} for case in range(FEWEST)]
    assert thin_cells(many) == {}
    assert thin_cells(many[1:]) == {("weak_form", "phase"): list(range(1, FEWEST))}


def test_intervals_that_hold_too_often_miss_their_target_too():
    assert Share("intervals", 400, 400, *HELD).missed
