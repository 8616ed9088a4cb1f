"""Chain modes against closed forms and 80-digit eigenvectors, over up to 18 decades of masses: equations.md 5."""

import math

import mpmath as mp
import numpy as np
import pytest
from support.exact_modes import as_doubles, frequencies_below
from support.exact_modes import chain_modes as exact_modes
from support.modes import ChainModes, chain_modes
from support.tolerance import EPSILON, ROUNDING

#: Relative error of frequencies and damping ratios of up to a dozen masses: a few roundings each. Some of them come
#: from the factor's entries sqrt(k/m).
FEW_MASSES = 3 * ROUNDING
#: Relative error for 64 masses: the factors of the elimination have conditions of the order of 64.
MANY_MASSES = 100 * EPSILON


def graded(seed: int, masses: int, grounded: str) -> tuple[np.ndarray, np.ndarray]:
    """Return masses of 1e-9 to 1e9 kg and springs of 1e-5 to 1e15 N/m, the far spring last."""
    random = np.random.default_rng(seed)
    m, k = 10 ** random.uniform(-9, 9, masses), 10 ** random.uniform(-5, 15, masses + 1)
    if grounded in ("near", "nowhere"):
        k[-1] = 0.0
    if grounded in ("far", "nowhere"):
        k[0] = 0.0
    return m, k


def modes_of(m: np.ndarray, k: np.ndarray, c: np.ndarray) -> ChainModes:
    return chain_modes(m, k[:-1], c[:-1], float(k[-1]), float(c[-1]))


def uniform(masses: int) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and orthonormal shapes of equations.md 5.2 for m = k = 1, in 40 digits and rounded."""
    with mp.workdps(40):
        angle = [(2 * j + 1) * mp.pi / (2 * masses + 1) for j in range(masses)]
        natural = [float(2 * mp.sin(a / 2)) for a in angle]
        size = 2 / mp.sqrt(2 * masses + 1)
        shapes = [[float(size * mp.sin((i + 1) * a)) for a in angle] for i in range(masses)]
    return np.array(natural), np.array(shapes)


def test_frequencies_of_the_printed_chains() -> None:
    two = chain_modes([1, 1], [1, 1], [0.1, 0.1])  # thesis 6.2: .618, 1.618, the golden ratio
    golden = (math.sqrt(5.0) - 1.0) / 2.0
    np.testing.assert_allclose(two.natural, [golden, golden + 1.0], rtol=2 * EPSILON)
    five = chain_modes([1] * 5, [1] * 5, [0] * 5)  # equations.md 5.2
    assert float(five.natural[0] ** 2) == pytest.approx(0.0810140527710, abs=5.1e-14)
    mixed = chain_modes([1, 2, 0.5], [3, 1, 2], [0.12, 0.04, 0.08])
    np.testing.assert_allclose(mixed.natural, [0.53645647, 2.0, 2.28302747], rtol=0, atol=5.1e-9)
    assert abs(mixed.natural[1] - 2.0) <= 2 * EPSILON * 2.0


@pytest.mark.parametrize("masses", [1, 2, 5, 31, 64])
def test_uniform_chains_have_the_closed_form_to_the_last_digits(masses: int) -> None:
    natural, shapes = uniform(masses)
    found = chain_modes([1.0] * masses, [1.0] * masses, [0.1] * masses)
    np.testing.assert_allclose(found.natural, natural, rtol=2 * EPSILON)
    np.testing.assert_allclose(found.shapes, shapes, rtol=0, atol=EPSILON)
    assert found.classical
    np.testing.assert_allclose(found.damping_ratio, 0.05 * natural, rtol=ROUNDING)
    # units: w = sqrt(k/m), shapes in kg^(-1/2), ratio = c / (2 sqrt(k m)) w/sqrt(k/m)
    scaled = chain_modes([0.25] * masses, [100.0] * masses, [0.1] * masses)
    np.testing.assert_allclose(scaled.natural, 20.0 * natural, rtol=4 * EPSILON)
    np.testing.assert_allclose(scaled.shapes, 2.0 * shapes, rtol=0, atol=4 * EPSILON)
    np.testing.assert_allclose(scaled.damping_ratio, 0.01 * natural, rtol=ROUNDING)


@pytest.mark.parametrize("masses", [2, 5, 31, 64])
def test_the_solver_finds_the_closed_form_of_a_chain_that_is_all_but_uniform(masses: int) -> None:
    # one mass heavier by one part in 2^52 is enough for the general method
    m = np.ones(masses)
    m[0] += EPSILON
    found = chain_modes(m, [1.0] * masses, [0.1] * masses)
    natural, shapes = uniform(masses)
    np.testing.assert_allclose(found.natural, natural, rtol=MANY_MASSES)
    gap = float(np.diff(natural).min()) if masses > 1 else 1.0
    np.testing.assert_allclose(found.shapes, shapes, rtol=0, atol=MANY_MASSES / gap)
    assert np.abs(found.shapes.T @ found.shapes - np.eye(masses)).max() <= MANY_MASSES


@pytest.mark.parametrize("grounded", ["near", "far", "both", "nowhere"])
def test_every_mode_of_a_graded_chain_is_right_to_a_few_roundings(grounded: str) -> None:
    # reference: eigenvectors of M^-1/2 K M^-1/2 in 80 digits. In doubles that matrix has lost all but the largest
    # frequencies. Damping c = k / 1000 s gives the ratios w / 2000
    for seed in range(15):
        masses = 2 + seed % 11
        m, k = graded(seed, masses, grounded)
        found = modes_of(m, k, 1e-3 * k)
        natural, vectors = exact_modes(m, k)
        rigid = 1 if grounded == "nowhere" else 0
        errors = [abs(found.natural[j] / natural[j] - 1) for j in range(rigid, masses)]
        assert max(errors) <= FEW_MASSES, seed
        assert found.classical, seed
        np.testing.assert_allclose(found.damping_ratio[rigid:] / found.natural[rigid:], 5e-4, rtol=FEW_MASSES)
        weighted = np.sqrt(m)[:, None] * (found.shapes - as_doubles(vectors))
        assert np.abs(weighted).max() <= 2 * FEW_MASSES, seed
        assert np.all(found.natural[:rigid] == 0.0)
        assert np.all(found.damping_ratio[:rigid] == 0.0)


def test_sixty_four_masses_over_eighteen_decades_keep_all_frequencies() -> None:
    m, k = graded(0, 64, "near")
    found = modes_of(m, k, 1e-3 * k)
    assert found.natural[-1] / found.natural[0] > 1e17
    # an exact count checks each frequency: j of them lie a few roundings below it, and j + 1 a few roundings above it
    for j, natural in enumerate(found.natural):
        assert frequencies_below(m, k, float(natural), 1.0 - MANY_MASSES) == j
        assert frequencies_below(m, k, float(natural), 1.0 + MANY_MASSES) == j + 1


def test_small_masses_among_large_ones_keep_the_digits_of_their_displacements() -> None:
    # errors are relative to the mode's largest displacement; components of a unit vector in sqrt(mass) keep only 7
    # digits. The remaining error (6e-14 here) belongs to modes in which a small mass is almost in resonance
    for seed in range(40):
        random = np.random.default_rng(seed)
        masses = 2 + seed % 7
        m, k = 10 ** random.uniform(-9, 9, masses), 10 ** random.uniform(-5, 5, masses + 1)
        exact = as_doubles(exact_modes(m, k)[1])
        errors = np.abs(modes_of(m, k, 0.0 * k).shapes - exact) / np.abs(exact).max(axis=0)
        assert errors.max() <= 1e-12, seed


def test_masses_without_a_spring_to_the_ground_move_as_one() -> None:
    # two floating groups, m = (1, 3) and (2, 4, 6), and a third tied to the far ground
    found = chain_modes([1, 3, 2, 4, 6, 5], [0, 7, 0, 2, 3, 0], [0] * 6, 11.0)
    assert found.natural[:2].tolist() == [0.0, 0.0]
    assert found.natural[2] > 0.0
    groups = np.array([[0.5, 0.5, 0, 0, 0, 0], [0, 0, *[1 / math.sqrt(12.0)] * 3, 0]]).T
    np.testing.assert_allclose(found.shapes[:, :2], groups, rtol=EPSILON)
    assert np.any(np.abs(found.natural - math.sqrt(11.0 / 5.0)) <= 4 * EPSILON)
    assert found.classical


def exact_damping(m: np.ndarray, k: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return Psi' C Psi in 80 digits."""
    _, vectors = exact_modes(m, k)
    n = len(m)
    with mp.workdps(80):
        rows = mp.zeros(n + 1, n)
        for e in range(n + 1):
            for j in range(n):
                ahead, behind = (vectors[e, j] if e < n else 0), (vectors[e - 1, j] if e else 0)
                rows[e, j] = mp.sqrt(mp.mpf(float(c[e]))) * (ahead - behind)
        return as_doubles(rows.T * rows)


@pytest.mark.parametrize("grounded", ["near", "both"])
def test_the_modal_damping_matrix_of_any_dampers_keeps_its_digits(grounded: str) -> None:
    # relative to the damping rates of the two modes coupled by an entry
    for seed in range(8):
        m, k = graded(seed, 2 + seed, grounded)
        c = k * 10 ** np.random.default_rng(seed).uniform(-4, -2, len(k))
        found = modes_of(m, k, c)
        exact = exact_damping(m, k, c)
        size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
        assert np.abs((found.damping - exact) / size).max() <= 10 * FEW_MASSES, seed
        assert not found.classical
        ratios = np.diag(exact) / (2.0 * found.natural)
        np.testing.assert_allclose(found.damping_ratio, ratios, rtol=10 * FEW_MASSES)


CLASSICAL = {
    "proportional": ([1, 2, 0.5], [3, 1, 2, 0], [0.12, 0.04, 0.08, 0]),
    "proportional with a far end": ([1, 2, 0.5], [3, 1, 2, 0.7], [0.3, 0.1, 0.2, 0.07]),
    "undamped": ([1, 2, 0.5], [3, 1, 2, 0], [0, 0, 0, 0]),
    "one mass": ([3], [2, 1], [0.4, 0]),
    "a ground damper that every mode meets alike": ([1, 1], [1, 2, 1], [0.5, 0, 0.5]),
    "two alike, apart": ([1, 1], [1, 0, 1], [0.2, 0, 0.2]),
}
COUPLED = {
    "a damper at the ground only": ([1, 2, 0.5], [3, 1, 2, 0], [0.1, 0, 0, 0]),
    "slightly out of proportion": ([1, 2, 0.5], [3, 1, 2, 0], [0.12, 0.04, 0.08 * (1 + 1e-12), 0]),
    "a free mass that is damped": ([1], [0, 0], [0.1, 0]),
    "free masses, damped alike": ([1, 1], [0, 1, 0], [0.1, 0, 0.1]),
    "two alike, joined by a damper": ([1, 1], [1, 0, 1], [0, 0.1, 0]),
}


@pytest.mark.parametrize("name", CLASSICAL)
def test_damping_that_leaves_the_modes_alone_is_classical(name: str) -> None:
    m, k, c = (np.array(x, dtype=float) for x in CLASSICAL[name])
    found = modes_of(m, k, c)
    assert found.classical
    np.testing.assert_allclose(
        found.damping, np.diag(2.0 * found.damping_ratio * found.natural), atol=ROUNDING
    )


@pytest.mark.parametrize("name", COUPLED)
def test_damping_that_couples_modes_or_damps_a_rigid_one_is_not_classical(name: str) -> None:
    m, k, c = (np.array(x, dtype=float) for x in COUPLED[name])
    assert not modes_of(m, k, c).classical


@pytest.mark.parametrize("name", [*CLASSICAL, *COUPLED])
def test_shapes_make_mass_and_stiffness_diagonal(name: str) -> None:
    m, k, c = (np.array(x, dtype=float) for x in {**CLASSICAL, **COUPLED}[name])
    found = modes_of(m, k, c)
    n = len(m)
    ends = np.eye(n + 1, n) - np.eye(n + 1, n, -1)
    psi = found.shapes
    np.testing.assert_allclose(psi.T @ (m[:, None] * psi), np.eye(n), atol=ROUNDING)
    stretch = ends @ psi
    np.testing.assert_allclose(
        stretch.T @ (k[:, None] * stretch), np.diag(found.natural**2), atol=4 * ROUNDING
    )
    np.testing.assert_allclose(stretch.T @ (c[:, None] * stretch), found.damping, atol=ROUNDING)
    assert np.all(np.diff(found.natural) >= 0.0)


def test_the_first_mass_that_takes_part_moves_to_the_positive_side() -> None:
    for seed in range(20):
        m, k = graded(seed, 9, "both")
        weighted = np.sqrt(m)[:, None] * modes_of(m, k, 0.0 * k).shapes
        for j in range(9):
            assert weighted[np.argmax(np.abs(weighted[:, j]) > 1e-8), j] > 0.0


def test_light_and_heavy_chains_differ_by_their_units_only() -> None:
    # masses 1e-9 and 1e9 kg: w scales with 1/sqrt(m), shapes too
    m, k = np.array([1.0, 2.0, 0.5]), np.array([3.0, 1.0, 2.0, 0.3])
    one = modes_of(m, k, 0.0 * k)
    for scale in (1e-9, 1e9):
        other = modes_of(scale * m, k, 0.0 * k)
        np.testing.assert_allclose(other.natural * math.sqrt(scale), one.natural, rtol=FEW_MASSES)
        np.testing.assert_allclose(other.shapes * math.sqrt(scale), one.shapes, rtol=FEW_MASSES)
