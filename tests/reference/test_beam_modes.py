"""Beam modes against 120 digits, the thesis's tables 7.1 to 7.6, and exact statics: equations.md 6."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import eigh
from scipy.optimize import brentq
from support.exact_modes import beam_root, beam_shape
from support.modes import collocation, frequency_error, natural_frequencies, static_stiffness
from support.tolerance import EPSILON, PRINTED_12, ROUNDING

from vibroimpact.fmus.core import beam_modes
from vibroimpact.fmus.core.modes import BOUNDARIES, Array, residual_vectors

ENDS = sorted(BOUNDARIES)
MODES = 64
#: Ends and middle, places with easy and with hard reduction of the argument, and just inside of both ends.
POINTS = [0.0, 1e-3, 0.1, 0.25, 0.3, 0.5, 0.61803398874989, 0.7, 0.9, 0.97, 0.999, 1.0]
#: Error of a table with 8 decimals.
PRINTED_8 = 5.1e-9
#: Error of a sum of 400 terms for an integral that is exactly 0 or 1: the weights have some 1e-14 each.
QUADRATURE = 2e-13


def gauss() -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(400)
    return (nodes + 1.0) / 2.0, weights / 2.0


@pytest.mark.parametrize("boundary", ENDS)
def test_eigenvalues_of_64_modes_are_the_doubles_nearest_to_the_roots(boundary: Any) -> None:
    # the nearest double errs by up to EPSILON / 2; roots: the textbook's equation in 120 digits
    eigenvalues = beam_modes(boundary, MODES).eigenvalues
    errors = [abs(x / beam_root(boundary, j) - 1) for j, x in enumerate(eigenvalues, 1)]
    assert max(errors) <= 0.6 * EPSILON


@pytest.mark.parametrize("boundary", ENDS)
@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_shapes_of_64_modes_keep_their_digits(boundary: Any, derivative: int) -> None:
    # reference: cosh - cos - sigma (sinh - sin) in 120 digits, of which 87 cancel for mode 64. The project requires
    # 1e-13; the argument xi s is reduced without rounding, so that only a few roundings are left
    modes = beam_modes(boundary, MODES)
    scaled = modes.shapes(POINTS, derivative) / modes.eigenvalues**derivative
    errors = [
        abs(scaled[k, j - 1] - beam_shape(boundary, j, s, derivative))
        for k, s in enumerate(POINTS)
        for j in range(1, MODES + 1)
    ]
    assert max(errors) <= ROUNDING


def test_what_the_ends_prescribe_holds_without_rounding() -> None:
    prescribed = {
        "clamped_free": ([0, 1], [2, 3]),
        "clamped_clamped": ([0, 1], [0, 1]),
        "clamped_pinned": ([0, 1], [0, 2]),
        "pinned_pinned": ([0, 2], [0, 2]),
    }
    for boundary in BOUNDARIES:
        modes = beam_modes(boundary, MODES)  # type: ignore[arg-type]
        for end, derivatives in zip((0.0, 1.0), prescribed[boundary], strict=True):
            for derivative in derivatives:
                assert not modes.shapes(end, derivative).any(), (boundary, end, derivative)


def test_the_free_tip_moves_by_two_in_every_mode_to_alternating_sides() -> None:
    tip = beam_modes("clamped_free", MODES).shapes(1.0)[0]
    assert tip.tolist() == [2.0, -2.0] * (MODES // 2)


def test_a_clamped_clamped_beam_is_symmetric_to_the_last_bit() -> None:
    s = np.array([0.0, 0.125, 0.25, 0.375, 0.5])  # 1 - s is a double
    modes = beam_modes("clamped_clamped", MODES)
    sides = np.where(np.arange(MODES) % 2 == 0, 1.0, -1.0)
    assert np.array_equal(modes.shapes(1.0 - s)[:4], (modes.shapes(s) * sides)[:4])
    assert not modes.participation[1::2].any()


@pytest.mark.parametrize("boundary", ENDS)
def test_the_first_antinode_from_the_first_end_is_positive(boundary: Any) -> None:
    modes = beam_modes(boundary, MODES)
    for j in range(1, MODES + 1):
        before_the_first_node = modes.shapes(np.linspace(0.1, 1.0, 30) / (j + 0.5))[:, j - 1]
        assert before_the_first_node.min() > 0.0
        assert before_the_first_node.max() > 1.0


@pytest.mark.parametrize("boundary", ENDS)
def test_shapes_and_curvatures_are_orthonormal(boundary: Any) -> None:
    # equations.md 6.4, by Gauss's quadrature, which is exact for these products up to rounding
    s, weights = gauss()
    modes = beam_modes(boundary, MODES)
    for derivative in (0, 2):
        scaled = modes.shapes(s, derivative) / modes.eigenvalues**derivative
        product = scaled.T @ (weights[:, None] * scaled)
        assert np.abs(product - np.eye(MODES)).max() <= QUADRATURE


@pytest.mark.parametrize("boundary", ENDS)
def test_participation_is_the_integral_of_the_shape(boundary: Any) -> None:
    s, weights = gauss()
    modes = beam_modes(boundary, MODES)
    assert np.abs(weights @ modes.shapes(s) - modes.participation).max() <= QUADRATURE


@pytest.mark.parametrize("boundary", ENDS)
def test_effective_mass_fractions_sum_to_the_whole_mass(boundary: Any) -> None:
    # equations.md 6.5: |participation| is at most 4 / xi, so the remainder after N modes is at most 16 / (pi^2 N)
    for count in (5, 220, 2000):
        rest = 1.0 - float(np.sum(beam_modes(boundary, count).participation ** 2))
        assert 0.0 < rest <= 16.0 / (math.pi**2 * count)


def test_effective_mass_fractions_of_the_cantilever_are_those_of_the_reference() -> None:
    # equations.md 6.5: .91921 for 5 modes, .99816 for 220
    fractions = beam_modes("clamped_free", 220).participation ** 2
    assert float(np.sum(fractions[:5])) == pytest.approx(0.91921, abs=5e-6)
    assert float(np.sum(fractions)) == pytest.approx(0.99816, abs=5e-6)


def test_eigenvalues_and_participation_are_those_of_the_tables() -> None:
    # thesis tables 7.1 and 7.3; equations.md 6.2 and 6.5 for the other ends
    cantilever = beam_modes("clamped_free", 5)
    table_1 = [1.875104, 4.694091, 7.854757, 10.995541, 14.137168]
    table_3 = [0.78299176, 0.43393590, 0.25442530, 0.18189802, 0.14147084]
    np.testing.assert_allclose(cantilever.eigenvalues, table_1, rtol=0, atol=5.1e-7)
    np.testing.assert_allclose(cantilever.participation, table_3, rtol=0, atol=PRINTED_8)
    both, prop = beam_modes("clamped_clamped", 3), beam_modes("clamped_pinned", 3)
    np.testing.assert_allclose(both.eigenvalues[:2], [4.730040745, 7.853204624], rtol=0, atol=5.1e-10)
    np.testing.assert_allclose(both.participation, [0.8308615232, 0.0, 0.3637694122], rtol=0, atol=5.1e-11)
    np.testing.assert_allclose(prop.eigenvalues[:2], [3.926602312, 7.068582746], rtol=0, atol=5.1e-10)
    table = [0.8600009086, 0.0826311941, 0.3343860028]
    np.testing.assert_allclose(prop.participation, table, rtol=0, atol=5.1e-11)


def test_nodes_of_the_cantilever_are_those_of_the_table() -> None:
    # thesis table 7.2
    table = {
        2: [0.78344455],
        3: [0.50354787, 0.86767759],
        4: [0.35833752, 0.64408794, 0.90556401],
        5: [0.27875171, 0.49991483, 0.72322359, 0.92654700],
    }
    modes = beam_modes("clamped_free", 5)
    for j, nodes in table.items():
        for node in nodes:
            found = brentq(lambda s, j=j: modes.shapes(s)[0, j - 1], node - 1e-3, node + 1e-3, xtol=1e-15)
            assert abs(found - node) <= PRINTED_8


#: E I (N m^2), mass per length (kg/m), L (m), frequencies (Hz) and digits of table 7.5, stiffness (N/m) of table 7.6.
#: E = 205 GPa and rho = 8500 kg/m^3 throughout; sections as corrected in equations.md 9 (the stiff beam 25 x 3 mm).
THESIS_BEAMS = {
    "stiff": (
        205e9 * 5.625e-11, 8500 * 7.5e-5, 0.332, [21.6, 135.3, 378.9, 742.5, 1227.3], [0.1] * 5, (945.33, 0.005)
    ),
    "flexible 1": (
        205e9 * 24.4e-14, 8500 * 12.4e-6, 0.3, [4.283, 26.843, 75.161, 147.286, 243.475], [5.1e-4] * 5, (5.56, 0.005)
    ),
    "flexible 2": (
        205e9 * 85.5e-14, 8500 * 18.7e-6, 0.3, [6.529, 40.918, 114.571, 224.513, 371.135], [5.1e-4] * 5, (19.48, 0.006)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", THESIS_BEAMS)
def test_frequencies_and_stiffnesses_of_the_thesis_beams(name: str) -> None:
    rigidity, mass, length, hertz, last_digit, (stiffness, digits) = THESIS_BEAMS[name]
    modes = beam_modes("clamped_free", 5)
    found = natural_frequencies(modes, rigidity, mass, length) / (2.0 * np.pi)
    assert np.all(np.abs(found - hertz) <= last_digit)
    assert abs(static_stiffness(modes, 1.0) * rigidity / length**3 - stiffness) <= digits


def test_the_contact_mass_at_the_tip_is_the_mass_over_four_times_the_number_of_modes() -> None:
    # equations.md 6.6: it tends to 0, so a restitution coefficient has no meaning without the number of modes
    for count in (1, 2, 7, MODES):
        tip = beam_modes("clamped_free", count).shapes(1.0)[0]
        assert 1.0 / float(tip @ tip) == 1.0 / (4.0 * count)


def test_the_static_tip_stiffness_is_approached_with_the_third_power_of_the_number_of_modes() -> None:
    # compliance of the dropped modes: sum over j > N of 4 / xi_j^4, which tends to 4 / (3 pi^4 N^3)
    modes = beam_modes("clamped_free", 512)
    compliance = np.cumsum(modes.shapes(1.0)[0] ** 2 / modes.eigenvalues**4)
    captured = [3.0 * float(compliance[n - 1]) for n in (1, 2, 4)]
    np.testing.assert_allclose(captured, [0.97069, 0.99540, 0.99938], rtol=0, atol=5.1e-6)  # equations.md 6.6
    counts = np.array([16, 32, 64, 128, 256, 512])
    defects = 1.0 / static_stiffness(modes, 1.0) - compliance[counts - 1]
    np.testing.assert_allclose(np.log2(defects[:-1] / defects[1:]), 3.0, rtol=0, atol=0.01)
    np.testing.assert_allclose(defects * counts**3, 4.0 / (3.0 * math.pi**4), rtol=0.002)


@pytest.mark.parametrize("boundary", ENDS)
@pytest.mark.parametrize("point", [0.1, 0.3, 0.5, 0.77, 0.95])
def test_the_static_stiffness_in_closed_form_is_that_of_all_modes(boundary: Any, point: float) -> None:
    # 1 / k(b) = sum phi_j(b)^2 / xi_j^4; |phi| < 2, so that after N modes at most 4 / (3 pi^4 (N - 1)^3) is missing
    count = 1000
    modes = beam_modes(boundary, count)
    found = math.fsum(modes.shapes(point)[0] ** 2 / modes.eigenvalues**4)
    missing = 1.0 / static_stiffness(modes, point) - found
    assert 0.0 < missing <= 4.0 / (3.0 * math.pi**4 * (count - 1) ** 3)


def test_supports_are_infinitely_stiff() -> None:
    for boundary in BOUNDARIES:
        modes = beam_modes(boundary, 1)  # type: ignore[arg-type]
        assert static_stiffness(modes, 0.0) == math.inf
        assert static_stiffness(modes, 1.0) == (3.0 if boundary == "clamped_free" else math.inf)


def held_tip(count: int) -> Array:
    """Return xi of the cantilever with a held tip, by Galerkin: the stiffness on the complement of the tip's row."""
    modes = beam_modes("clamped_free", count)
    row = modes.shapes(1.0)
    complement = np.linalg.svd(row)[2][1:]
    return np.asarray(np.linalg.eigvalsh((complement * modes.eigenvalues**4) @ complement.T) ** 0.25)


def test_holding_the_tip_of_a_cantilever_gives_the_clamped_pinned_beam_at_third_order() -> None:
    # the constrained frequencies lie above (fewer modes are stiffer) and their error falls as N^-3, like the
    # compliance of the dropped modes
    exact = beam_modes("clamped_pinned", 3).eigenvalues
    np.testing.assert_allclose(exact, [3.926602, 7.068583, 10.210176], rtol=0, atol=5.1e-7)
    errors = np.array([held_tip(count)[:3] / exact - 1.0 for count in (8, 16, 32, 64)])
    assert errors.min() > 0.0
    assert errors[-1].max() <= 3e-6
    np.testing.assert_allclose(np.log2(errors[1:-1] / errors[2:]), 3.0, rtol=0, atol=0.01)


def timoshenko_drop(j: int, slenderness: float, e_over_g: float, shear: float) -> float:
    """Return the exact drop of frequency j of the pinned-pinned Timoshenko beam from Euler-Bernoulli's.

    With x = (w / w_0)^2 and r = (j pi slenderness)^2: E/(kap G) r^2 x^2 - (1 + r (1 + E/(kap G))) x + 1 = 0.
    """
    r, g = (j * math.pi * slenderness) ** 2, e_over_g / shear
    linear = 1.0 + r * (1.0 + g)
    return 1.0 - math.sqrt(2.0 / (linear + math.sqrt(linear**2 - 4.0 * g * r**2)))


def test_the_validity_estimate_is_timoshenkos_drop_to_leading_order() -> None:
    # equations.md 6.7: h/L = .01, E/G = 2.6, mode 5: exact .42025 %, estimate .42357 %
    thin = 0.01 / math.sqrt(12.0)
    modes = beam_modes("pinned_pinned", 5)
    assert timoshenko_drop(5, thin, 2.6, 5 / 6) == pytest.approx(0.0042025, abs=5.1e-8)
    assert float(frequency_error(modes, thin)[4]) == pytest.approx(0.0042357, abs=5.1e-8)
    differences = [
        abs(float(frequency_error(modes, h)[4]) / timoshenko_drop(5, h, 2.6, 5 / 6) - 1.0)
        for h in (thin, thin / 2.0, thin / 4.0)
    ]
    assert differences[0] / differences[1] == pytest.approx(4.0, rel=0.02)
    assert differences[1] / differences[2] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("count", [1, 3, 16, MODES])
def test_a_collocated_impulse_moves_its_grid_point_alone(count: int) -> None:
    grid = np.arange(1, count + 1) / count
    modes = beam_modes("clamped_free", count)
    directions = np.array([collocation(modes, grid, at) for at in range(count)])
    # the matrix of the grid has condition 2.1 for every number of modes
    assert np.abs(modes.shapes(grid) @ directions.T - np.eye(count)).max() <= 16 * ROUNDING


def test_a_collocated_impulse_can_create_energy_and_the_variational_one_cannot() -> None:
    # equations.md 6.8: three modes, r = .6: largest growth of the kinetic energy 1.46313 and 1
    modes = beam_modes("clamped_free", 3)
    tip = modes.shapes(1.0)[0]
    impulses = {1.46313: collocation(modes, [1 / 3, 2 / 3, 1.0], 2), 1.0: tip / (tip @ tip)}
    for growth, direction in impulses.items():
        jump = np.eye(3) - 1.6 * np.outer(direction, tip)
        assert np.linalg.norm(jump, 2) ** 2 == pytest.approx(growth, abs=5.1e-6)


def test_the_frequency_of_an_aluminium_strip_is_that_of_the_reference() -> None:
    # equations.md 6.6: E = 70 GPa, rho = 2700, 20 x 2 mm, L = .25 m: 26.3207 Hz, 179.2 N/m
    rigidity, mass = 70e9 * 0.02 * 0.002**3 / 12.0, 2700 * 0.02 * 0.002
    modes = beam_modes("clamped_free", 1)
    first = float(natural_frequencies(modes, rigidity, mass, 0.25)[0])
    assert first / (2.0 * math.pi) == pytest.approx(26.3207, abs=5.1e-5)
    assert static_stiffness(modes, 1.0) * rigidity / 0.25**3 == pytest.approx(179.2, rel=PRINTED_12)


@pytest.mark.parametrize("boundary", ENDS)
def test_residual_vectors_are_the_best_of_what_many_more_modes_do(boundary: Any) -> None:
    # reference: the same shapes as sums over 4000 modes, orthogonalised by a general eigenvalue problem
    natural, points = 5, np.array([0.31, 0.7])
    many = beam_modes(boundary, 4000)
    shapes, inverse = many.shapes(points)[:, natural:], many.eigenvalues[natural:] ** -4.0
    stiffness, mass = (shapes * inverse**k @ shapes.T for k in (1, 2))
    values, vectors = eigh(stiffness, mass)
    found = residual_vectors(boundary, natural, points)
    assert_allclose(found.eigenvalues**4, values, rtol=1e-6)  # the remaining share of mass outside of the sum
    places = np.linspace(0.0, 1.0, 41)
    expected = many.shapes(places)[:, natural:] * inverse @ shapes.T @ vectors
    signs = np.sign(np.sum(expected * found.shapes(places), axis=0))
    assert_allclose(found.shapes(places), expected * signs, atol=1e-6)
    participation = many.participation[natural:] * inverse @ shapes.T @ vectors
    assert_allclose(found.participation, participation * signs, atol=1e-6)


@pytest.mark.parametrize("boundary", ENDS)
def test_residual_vectors_are_orthogonal_to_the_modes_and_to_each_other(boundary: Any) -> None:
    nodes, weights = gauss()
    pieces = [0.0, 0.2, 0.55, 0.9, 1.0]  # the third derivative jumps at a point
    s = np.concatenate([a + (b - a) * nodes for a, b in pairwise(pieces)])
    w = np.concatenate([(b - a) * weights for a, b in pairwise(pieces)])
    vectors = residual_vectors(boundary, 6, pieces[1:-1])
    shapes = np.hstack([beam_modes(boundary, 6).shapes(s), vectors.shapes(s)])
    assert_allclose(shapes.T * w @ shapes, np.eye(9), atol=1e-6)  # the mass of a vector is summed to 1e-6
    assert_allclose(shapes[:, :6].T * w @ shapes[:, 6:], 0.0, atol=1e-9)
