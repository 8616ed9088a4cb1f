"""Units of FMUs, scenes and recorded channels are compared by their meaning, never by their names."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.units import (
    BASE_UNITS,
    Unit,
    agree,
    declared_unit,
    gain_unit_between,
    parse_unit,
    product_agrees,
    si_unit,
)


def unit(text: str) -> Unit:
    parsed = parse_unit(text)
    assert parsed is not None, text
    return parsed


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("N", "kg.m/s2"),
        ("J", "N.m"),
        ("W", "J/s"),
        ("Pa", "N/m2"),
        ("N.s/m", "kg/s"),
        ("kg.m2/s2", "J"),
        ("V.A", "W"),
        ("1/s", "Hz"),
        ("s-1", "Hz"),
        ("m.s-2", "m/s2"),
        ("W/(m2.K)", "kg/(s3.K)"),
        ("J/kg/K", "m2/(s2.K)"),
        ("1", "m/m"),
        ("kN", "kg.km/s2"),
        ("MPa", "N/mm2"),
        ("C", "A.s"),
        ("Ohm", "V/A"),
    ],
)
def test_a_unit_is_the_product_that_defines_it(text: str, same: str) -> None:
    assert agree(unit(text), unit(same))


@pytest.mark.parametrize(
    ("text", "factor"),
    [("g", 1e-3), ("mm", 1e-3), ("kN", 1e3), ("deg", math.pi / 180), ("min", 60), ("1", 1)],
)
def test_prefixes_and_units_of_another_size_have_their_factor(text: str, factor: float) -> None:
    assert unit(text).factor == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "N m", "N*m", "m^2", "N/m.s", "N/(m/s)", "N//m", "/s", "N/", ".m", "m.", "inch", "2", "m0",
        "m1.5", "kkg", "mmin", "11", "m\n", "Nm2x", "()", "N/()", "\N{MICRO SIGN}m", "m" * 200, "degC",
    ],
)  # fmt: skip
def test_what_is_not_a_product_of_symbols_is_not_guessed(text: str) -> None:
    assert parse_unit(text) is None


def test_angles_are_not_plain_numbers() -> None:
    assert not agree(unit("rad/s"), unit("1/s"))
    assert not agree(unit("Hz"), unit("rad/s"))


def test_units_of_another_size_do_not_agree() -> None:
    assert not agree(unit("mm"), unit("m"))
    assert product_agrees(unit("mm"), unit("m/mm"), unit("m"))


def test_a_spring_turns_displacement_into_force() -> None:
    assert product_agrees(unit("m"), unit("N/m"), unit("N"))
    assert not product_agrees(unit("m"), unit("N.s/m"), unit("N"))


def test_a_factor_written_in_decimals_agrees_with_the_exact_one() -> None:
    described = declared_unit("degree", {"rad": 1}, 0.0174532925199)
    assert agree(described, unit("deg"))


def test_a_unit_whose_zero_is_elsewhere_agrees_with_itself_only() -> None:
    celsius, kelvin = declared_unit("degC", {"K": 1}, 1.0, 273.15), unit("K")
    assert agree(celsius, celsius)
    assert not agree(celsius, kelvin)
    assert not product_agrees(celsius, unit("1"), celsius)


@pytest.mark.parametrize(
    ("source", "target", "gain"),
    [
        ("m", "N", "N/m"),
        ("mm", "m", "m/mm"),
        ("m/s", "N", "kg/s"),
        ("1", "rad", "rad/1"),
        ("N.m", "J", "J/(N.m)"),
    ],
)
def test_a_gain_unit_is_suggested_that_fits(source: str, target: str, gain: str) -> None:
    assert gain_unit_between(unit(source), unit(target)) == gain


def test_no_gain_unit_is_suggested_where_none_can_be_written() -> None:
    inch = declared_unit("inch", {"m": 1}, 0.0254)
    celsius = declared_unit("degC", {"K": 1}, 1.0, 273.15)
    assert gain_unit_between(inch, unit("m")) is None
    assert gain_unit_between(celsius, unit("K")) is None


exponents = st.dictionaries(st.sampled_from(BASE_UNITS), st.integers(-4, 4), max_size=4)


@given(source=exponents, target=exponents)
def test_a_suggested_gain_unit_always_fits(source: dict[str, int], target: dict[str, int]) -> None:
    one, other = declared_unit("one", source), declared_unit("other", target)
    suggested = gain_unit_between(one, other)
    assert suggested is not None
    assert product_agrees(one, unit(suggested), other)


@given(text=st.text("kgmsNradHz./()-0123456789 ", max_size=20))
def test_any_text_is_a_unit_or_none(text: str) -> None:
    parsed = parse_unit(text)
    assert parsed is None or parsed.factor > 0.0


@pytest.mark.parametrize("text", ["g", "mV", "deg", "furlong", "m s-", "0 m", "m/s/", "N m-1)", "."])
def test_what_is_not_si_is_refused_in_a_recording(text: str) -> None:
    with pytest.raises(UsageError, match="expected a product of kg, m, s"):
        si_unit(text)


@pytest.mark.parametrize(
    ("text", "cf", "fmi"),
    [
        ("m s-2", "m s-2", "m/s2"),
        ("W/(m2.K)", "W m-2 K-1", "W/(m2.K)"),
        ("/s", "s-1", "1/s"),
        ("0.001 V", "0.001 V", "0.001 V"),
        ("", "1", ""),
    ],
)
def test_a_unit_is_written_as_cf_and_as_fmi_want_it(text: str, cf: str, fmi: str) -> None:
    assert (si_unit(text).cf, si_unit(text).name) == (cf, fmi)
