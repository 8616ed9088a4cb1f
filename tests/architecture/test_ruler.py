"""Neither the size of the code nor the part that a use runs grows: `ruler.toml` has the ceilings, which only fall."""

from __future__ import annotations

import pytest
from architecture import ruler
from architecture.uses import executed

from vibroimpact.orchestrator.scene.fields import listed

WHAT_TO_DO = "PYTHONPATH=tests python -m architecture.ruler"


def ceilings() -> dict[str, float]:
    return dict(ruler.kept()["ceilings"])


@pytest.fixture(scope="module")
def figures() -> dict[str, float]:
    return ruler.figures_of_text()


def test_no_figure_of_the_text_is_above_its_ceiling(figures: dict[str, float]) -> None:
    above = {
        name: (figure, ceilings()[name]) for name, figure in figures.items() if figure > ceilings()[name]
    }
    assert above == {}


def test_ceilings_follow_the_figures_of_the_text_down(figures: dict[str, float]) -> None:
    assert ruler.behind(figures, ceilings()) == {}, f"the code became smaller; run {WHAT_TO_DO} --write"


def test_no_use_runs_more_than_its_ceiling(figures: dict[str, float]) -> None:
    counts = ruler.figures_of_uses()
    above = {name: (count, ceilings()[name]) for name, count in counts.items() if count > ceilings()[name]}
    assert above == {}
    assert set(ceilings()) == set(figures) | set(counts)


def test_a_name_that_is_gone_is_nowhere_in_the_package() -> None:
    there = {name: places for name in ruler.kept()["gone"] if (places := ruler.places_of(name))}
    assert there == {}


def test_the_ruler_sees_what_is_there() -> None:
    assert len(ruler.places_of("OscillatorBody")) > 1
    assert executed(ruler.lines_of_c) == (0, 0)
    assert executed(lambda: listed(["a", "b"], "or")) == (2, 1), "the function and its generator"
    kept = '"lines" = 900\n"files" = 300\n'
    lower = ruler.behind({"lines": 880, "files": 299}, {"lines": 900, "files": 300})
    assert ruler.with_ceilings(kept, lower) == '"lines" = 880\n"files" = 300\n'
