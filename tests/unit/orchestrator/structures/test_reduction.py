"""Modes of matrices: against beams, chains, dense solutions and 30 digits; residual vectors and their error."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from support.drawn_matrices import drawn_matrices
from support.finite_elements import chain_matrices, hermite_beam, solid

import vibroimpact as vi
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.structures import factors
from vibroimpact.orchestrator.structures.matrices import Matrices
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.reduction import reduce

MASSES, SPRINGS, DASHPOTS = [1.0, 2.0, 0.5], [3.0, 1.0, 2.0, 0.7], [0.12, 0.01, 0.3, 0.0]


def flexibility(matrices: Matrices, load: Floats, angular: float) -> Floats:
    """Return load' (K - w^2 M)^-1 load of dense matrices."""
    dynamic = (matrices.stiffness - angular**2 * matrices.mass).toarray()
    return np.asarray(load.T @ np.linalg.solve(dynamic, load))


def modal_flexibility(modes: Modes, angular: float) -> Floats:
    shapes = np.array(list(modes.shapes.values()))
    return np.asarray((shapes / (modes.natural**2 - angular**2)) @ shapes.T)


def test_frequencies_of_a_hermite_cantilever_converge_to_those_of_the_beam_with_the_fourth_power() -> None:
    exact = beam_modes("clamped_free", 4).eigenvalues ** 2
    errors = []
    for elements in (20, 40, 80):
        tip = f"{elements}.z"
        found = reduce(hermite_beam(elements), {"tip": {tip: 1.0}}, modes=4, residual=False)
        errors.append(found.natural / exact - 1.0)
        assert np.abs(found.shapes["tip"]) == pytest.approx(2.0, rel=20.0 / elements**4 * 2000)
    assert (errors[0][2:] / errors[1][2:]) == pytest.approx(16.0, rel=0.05)
    assert np.abs(errors[2]).max() < 2e-6


def test_a_chain_as_matrices_has_the_impacts_of_the_chain() -> None:
    record = {"transient_periods": 0, "recorded_periods": 30}
    settings = {
        "forcing": {"amplitude": [0.0, 0.0, 1.0], "angular_frequency": 1.3},
        "stop": [{"mass": 3, "position": 0.3, "restitution": 0.7}],
        "record": record,
    }
    body = {"kind": "chain", "masses": MASSES, "stiffnesses": SPRINGS[:3], "dampings": DASHPOTS[:3]}
    one = vi.run(Scene.from_dict({"body": body, **settings}))
    modes = reduce(chain_matrices(MASSES, [*SPRINGS[:3], 0.0], DASHPOTS), {"end": {"3.x": 1.0}}, modes=3)
    end = "body.end"
    other = vi.run(
        Scene.from_dict(
            {
                "body": modes.table(),
                "forcing": {"at": end, "amplitude": 1.0, "angular_frequency": 1.3},
                "stop": [{"at": end, "position": 0.3, "restitution": 0.7}],
                "record": {**record, "observed": [end]},
            }
        )
    )
    count = min(int(one.impact_count), 15)
    assert count > 5
    np.testing.assert_allclose(other.impact_time[:count], one.impact_time[:count], rtol=1e-10)
    np.testing.assert_allclose(other.impact_velocity[:count], one.impact_velocity[:count], rtol=1e-8)


def test_a_free_beam_has_exact_rigid_body_modes_and_its_mass_in_them() -> None:
    found = reduce(hermite_beam(40, clamped=False, mass=3.0), {"end": {"0.z": 1.0}}, modes=6, base="z")
    assert found.natural[:2].tolist() == [0.0, 0.0]
    free = np.array([4.730040745, 7.853204624, 10.995607838]) ** 2 / np.sqrt(3.0)
    assert found.natural[2:5] == pytest.approx(free, rel=1e-5)
    assert found.participation is not None
    assert (found.participation**2).sum() == pytest.approx(3.0, rel=1e-10)
    assert found.participation[2:] == pytest.approx(np.zeros(4), abs=1e-7)


def test_a_free_solid_has_six_rigid_body_modes() -> None:
    model = solid((2, 2, 5), 0.01, held=False)
    found = reduce(model, {"corner": {"0.z": 1.0}}, modes=20)
    exact = scipy.linalg.eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)[6:19]
    assert found.natural[:6].tolist() == [0.0] * 6
    assert found.natural[6:19] == pytest.approx(np.sqrt(exact), rel=1e-9)


def test_all_copies_of_a_repeated_frequency_are_found() -> None:
    one = chain_matrices([1.0] * 20, [1.0] * 20 + [0.0])
    copies = 11
    many = Matrices(
        sparse.kron(sparse.eye_array(copies), one.stiffness, format="csc"),
        sparse.kron(sparse.eye_array(copies), one.mass, format="csc"),
        None,
        tuple(f"{number}.x" for number in range(20 * copies)),
    )
    found = reduce(many, {"end": {"19.x": 1.0}}, modes=24, residual=False)
    lowest = 2.0 * np.sin(np.pi * np.array([1.0, 3.0, 5.0]) / 82.0)
    assert found.natural == pytest.approx(np.repeat(lowest, copies)[:24], rel=1e-12)


def test_residual_vectors_make_the_static_flexibility_exact_and_the_error_is_the_true_one() -> None:
    model = solid((2, 2, 6), 0.01)
    points = {"tip": {model.freedoms[-1]: 1.0}, "side": {model.freedoms[150]: 1.0, model.freedoms[30]: -1.0}}
    load = np.array([model.combination(at) for at in points.values()]).T
    static = flexibility(model, load, 0.0)
    unit = np.sqrt(np.outer(static.diagonal(), static.diagonal()))
    for residual, rounding in ((True, 1e-9), (False, np.inf)):
        found = reduce(model, points, modes=9, residual=residual)
        natural = found.natural[: 9 - found.residual_vectors]
        off = [
            np.abs(modal_flexibility(found, w) - flexibility(model, load, w)) / unit
            for w in np.linspace(0.0, 0.5 * natural.max(), 33)
        ]
        assert off[0].max() < rounding
        assert found.error == pytest.approx(np.max(off), rel=0.05)


def test_an_automatic_number_of_modes_meets_its_tolerance() -> None:
    model = solid((2, 2, 6), 0.01)
    points = {"tip": {model.freedoms[-1]: 1.0}}
    found = [reduce(model, points, modes="auto", tolerance=each) for each in (1e-1, 1e-2, 1e-3)]
    assert [each.error is not None and each.error <= 10.0**-k for k, each in enumerate(found, 1)] == [
        True
    ] * 3
    sizes = [len(each.natural) for each in found]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[2]
    with pytest.raises(UsageError, match=r"64 modes meet up to .* Hz, ten times the lowest .*, got 1e-12"):
        reduce(model, points, modes="auto", tolerance=1e-12)


def test_an_automatic_number_of_modes_reaches_beyond_what_drives_and_the_second_frequency() -> None:
    model = solid((2, 2, 6), 0.01)
    points, load = {"tip": {model.freedoms[-1]: 1.0}}, model.combination({model.freedoms[-1]: 1.0})[:, None]
    exact = np.sqrt(
        scipy.linalg.eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)[:20]
    )
    driven = float(exact[6])
    few = reduce(model, points, modes="auto", tolerance=1e-2)
    many = reduce(model, points, modes="auto", tolerance=1e-2, driven=driven)
    assert len(many.natural) > len(few.natural)
    assert few.remarks[-1].endswith("Hz, ten times the lowest elastic frequency.")
    assert many.remarks[-1].endswith(
        f"up to {driven / np.pi:.4g} Hz, twice the highest frequency of the forces and stops."
    )
    static = flexibility(model, load, 0.0)[0, 0]
    for angular in driven * np.array([0.5, 1.001, 1.5]):
        off = modal_flexibility(many, angular) - flexibility(model, load, angular)
        assert abs(off[0, 0]) < 1.1e-2 * static
    soft = chain_matrices([100.0, 1.0, 1.0, 1.0], [1.0, 1e4, 1e4, 1e4, 0.0])
    found = reduce(soft, {"end": {"4.x": 1.0}}, modes="auto", tolerance=1e-2)
    assert found.remarks[-1].endswith("the second elastic frequency.")
    assert found.natural[1] == pytest.approx(reduce(soft, {}, modes=4).natural[1], rel=1e-2)


@pytest.mark.parametrize("rayleigh", [(0.0, 0.0), (0.3, 0.02)])
def test_full_and_rayleigh_damping_have_the_response_of_30_digits(rayleigh: tuple[float, float]) -> None:
    matrices = chain_matrices(MASSES, SPRINGS, DASHPOTS)
    assert matrices.damping is not None
    modes = reduce(matrices, {"one": {"1.x": 1.0}, "end": {"3.x": 1.0}}, modes=3, rayleigh=rayleigh)
    assert modes.damping is not None
    shapes = np.array(list(modes.shapes.values()))
    damping = modes.damping + np.diag(2.0 * modes.natural * modes.damping_ratios)
    stiffness, mass, given_damping = (
        each.toarray() for each in (matrices.stiffness, matrices.mass, matrices.damping)
    )
    with mpmath.workdps(30):
        k, m, c = (mpmath.matrix(each.tolist()) for each in (stiffness, mass, given_damping))
        c = c + mpmath.mpf(rayleigh[0]) * m + mpmath.mpf(rayleigh[1]) * k
        for angular in (0.0, 0.7, 1.9, 6.0):
            exact = mpmath.inverse(k - angular**2 * m + mpmath.mpc(0, angular) * c)
            found = shapes @ np.linalg.solve(
                np.diag(modes.natural**2 - angular**2) + 1j * angular * damping, shapes.T
            )
            expected = np.array([[complex(exact[i, j]) for j in (0, 2)] for i in (0, 2)])
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)


def test_rayleigh_damping_drags_rigid_body_modes_by_a_matrix() -> None:
    found = reduce(
        chain_matrices([1.0, 1.0], [0.0, 1.0, 0.0]), {"end": {"2.x": 1.0}}, modes=2, rayleigh=(0.2, 0.1)
    )
    assert found.damping is not None
    assert found.damping.tolist() == [[0.2, 0.0], [0.0, 0.0]]
    assert found.damping_ratios == pytest.approx([0.0, 0.5 * (0.2 / np.sqrt(2.0) + 0.1 * np.sqrt(2.0))])


def test_a_freedom_without_mass_follows_its_springs() -> None:
    found = reduce(chain_matrices([1.0, 0.0], [0.0, 3.0, 6.0]), {"one": {"1.x": 1.0}}, modes=2)
    assert found.natural == pytest.approx([np.sqrt(2.0)], rel=1e-14)
    assert found.remarks == ("1 of 2 modes are kept: the structure has no more.",)


def test_unused_degrees_of_freedom_are_left_out_by_name() -> None:
    model = chain_matrices([1.0, 0.0, 2.0], [1.0, 0.0, 0.0, 4.0])
    found = reduce(model, {"one": {"1.x": 1.0}}, modes=2)
    assert found.natural == pytest.approx([1.0, np.sqrt(2.0)])
    assert found.remarks == ("1 degrees of freedom without stiffness and mass are left out: 2.x.",)
    with pytest.raises(UsageError, match=r"with stiffness or mass at 'two', got '2\.x'"):
        reduce(model, {"two": {"2.x": 1.0}}, modes=1)


def changed(name: str, place: tuple[int, int], value: float) -> Matrices:
    parts = {"stiffness": SPRINGS, "mass": MASSES, "damping": DASHPOTS}
    base = chain_matrices(MASSES, SPRINGS, DASHPOTS)
    found = {each: getattr(base, each).toarray() for each in parts}
    found[name][place] = value
    stiffness, mass, damping = (sparse.csc_array(found[each]) for each in parts)
    return Matrices(stiffness, mass, damping, base.freedoms)


@pytest.mark.parametrize(
    ("matrices", "text"),
    [
        (changed("stiffness", (0, 1), -2.0), r"stiffness that is symmetric, got two numbers for"),
        (changed("damping", (0, 2), 2.0), r"symmetric \(gyroscopic terms are not modelled\), got two numbers"),
        (changed("mass", (1, 1), -2.0), r"mass with a diagonal >= 0, got -2 at 2\.x"),
        (changed("mass", (1, 1), np.nan), r"mass of finite numbers, got nan at 2\.x"),
        (changed("stiffness", (0, 0), 1e-3), r"stiffness that is positive semi-definite, got negative energy"),
        (Matrices(sparse.eye_array(2), sparse.eye_array(3), None, ("a", "b")), r"mass for 2 degrees of freedom"),
        (Matrices(sparse.eye_array(2), sparse.eye_array(2), None, ("a", "a")), r"once, got 'a' twice"),
        (
            Matrices(sparse.csc_array([[2.0, 1.0], [0.0, 2.0]]), sparse.eye_array(2), None, ("a", "b")),
            r"both triangles of a symmetric matrix, got one alone",
        ),
        (
            Matrices(sparse.eye_array(2), sparse.csc_array([[1.0, 2.0], [2.0, 1.0]]), None, ("a", "b")),
            r"mass that is positive semi-definite, got negative energy for a motion, mostly of",
        ),
        (
            Matrices(sparse.eye_array(2), sparse.csc_array(np.zeros((2, 2))), None, ("a", "b")),
            r"a mass matrix with numbers above 0, got one without any",
        ),
    ],
)  # fmt: skip
def test_matrices_that_are_none_of_a_structure_are_refused_by_name(matrices: Matrices, text: str) -> None:
    with pytest.raises(UsageError, match=text):
        reduce(matrices, {}, modes=1)


def test_points_and_numbers_that_do_not_fit_are_refused() -> None:
    model = chain_matrices(MASSES, SPRINGS)
    ends = {"one": {"1.x": 1.0}, "end": {"3.x": 1.0}}
    for text, call in {
        r"at least 3 modes \(0 of a rigid body, 2 residual vectors, 1 natural one\), got 2": {"modes": 2},
        r"1 to 64 modes, got 65": {"modes": 65},
        r"a base direction that some degrees of freedom end in, got 'q'": {"base": "q", "modes": 3},
        r"a damping ratio for each of 3 modes, got 2": {"damping_ratio": [0.1, 0.1], "modes": 3},
    }.items():
        with pytest.raises(UsageError, match=text):
            reduce(chain_matrices([1.0] * 4, [1.0] * 5) if "least" in text else model, ends, **call)  # type: ignore[arg-type]


def test_factors_beyond_the_memory_are_refused_before_they_are_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(factors, "available_memory", lambda: 1e5)
    monkeypatch.setattr(factors, "_factors", lambda _: pytest.fail("factors were made"))
    with pytest.raises(
        UsageError, match=r"within the available memory of 0\.0001 GB, got .* GB for \d+ unknowns"
    ):
        reduce(solid((2, 2, 8), 0.01), {}, modes=3)


def test_factors_that_find_no_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("scipy.sparse.linalg.splu", full)
    with pytest.raises(UsageError, match="within the memory, got larger ones for 3 unknowns"):
        reduce(chain_matrices(MASSES, SPRINGS), {}, modes=3)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(2, 40))
def test_random_structures_of_springs_have_the_modes_of_dense_matrices(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    rows = np.zeros((random.integers(count // 2, 2 * count), count))
    for row in rows:
        one, other = random.choice(count, 2, replace=False)
        row[one], row[other] = 1.0, random.choice([-1.0, 0.0])
    stiffness = rows.T @ (10.0 ** random.uniform(-1, 1, len(rows))[:, None] * rows)
    mass = np.diag(10.0 ** random.uniform(-1, 1, count))
    names = tuple(f"{number}.x" for number in range(count))
    exact = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
    found = reduce(
        Matrices(sparse.csc_array(stiffness), sparse.csc_array(mass), None, names), {}, modes=count
    )
    assert found.natural**2 == pytest.approx(exact, rel=1e-9, abs=1e-11 * exact.max())
    assert (found.natural == 0.0).sum() == (exact < 1e-10 * exact.max()).sum()


def test_flexibility_without_mass_at_a_point_is_no_mode_and_is_told() -> None:
    stiffness = sparse.csc_array([[3.0, -1.0, 0.0], [-1.0, 3.0, -1.0], [0.0, -1.0, 1.5]])
    given = Matrices(stiffness, sparse.csc_array(np.diag([1.0, 2.0, 0.0])), None, ("1.x", "2.x", "3.x"))
    found = reduce(given, {"tip": {"3.x": 1.0}}, modes=3)
    condensed = np.array([[3.0, -1.0], [-1.0, 3.0 - 1.0 / 1.5]])
    squares = scipy.linalg.eigh(condensed, np.diag([1.0, 2.0]), eigvals_only=True)
    np.testing.assert_allclose(found.natural**2, squares, rtol=1e-13)
    whole = np.linalg.inv(stiffness.toarray())[2, 2]
    assert found.error == pytest.approx(1.0 / 1.5 / whole, rel=1e-12)
    assert modal_flexibility(found, 0.0)[0, 0] == pytest.approx(whole - 1.0 / 1.5, rel=1e-12)
    assert any("no mass, and is left out" in remark for remark in found.remarks)


def test_a_free_body_in_texts_of_fourteen_digits_has_a_rigid_body_mode() -> None:
    count = 46
    springs = np.random.default_rng(1).random(count - 1) * 1e5
    elongations = np.eye(count - 1, count) - np.eye(count - 1, count, 1)
    exact = elongations.T @ (springs[:, None] * elongations)
    for up in (0.0, 1.0):  # rounding that lowers the energy of a translation, or raises it
        rounded = np.array([[float(f"{each:.13e}") for each in row] for row in exact])
        rounded[np.diag_indices(count)] *= 1.0 + (2.0 * up - 1.0) * 1e-14
        names = tuple(f"{place}.x" for place in range(1, count + 1))
        given = Matrices(sparse.csc_array(rounded), sparse.csc_array(np.eye(count)), None, names)
        found = reduce(given, {"tip": {"1.x": 1.0}}, modes=6)
        assert found.natural[0] == 0.0
        assert found.natural[1] > 1.0


def test_free_bodies_of_masses_over_twelve_decades_have_each_a_rigid_body_mode() -> None:
    masses = 10.0 ** np.linspace(-6.0, 6.0, 30)
    blocks = [1e4 * np.array([[1.0, -1.0], [-1.0, 1.0]])] * 15
    names = tuple(f"{place}.x" for place in range(1, 31))
    given = Matrices(sparse.block_diag(blocks, format="csc"), sparse.csc_array(np.diag(masses)), None, names)
    found = reduce(given, {"one": {"1.x": 1.0}, "last": {"30.x": 1.0}}, modes=30)
    assert (found.natural[:15] == 0.0).all()
    for point, body in (("one", masses[:2]), ("last", masses[-2:])):
        own = 1.0 / (found.shapes[point][:15] ** 2).sum()
        assert own == pytest.approx(body.sum(), rel=1e-9)


def in_digits(matrix: sparse.csc_array, digits: int) -> sparse.csc_array:
    """Return a matrix as a text of some digits has it."""
    found = matrix.copy()
    found.data = np.array([float(f"{each:.{digits - 1}e}") for each in found.data.tolist()])
    return found


@pytest.mark.parametrize("elements", [5, 20, 60])
def test_a_free_beam_of_ten_digits_has_its_rigid_body_modes_and_a_held_one_has_none(elements: int) -> None:
    for rigidity in (1.0, 3.7, 12.3):
        exact = hermite_beam(elements, 1.7, rigidity, 0.9, clamped=False)
        free = Matrices(
            in_digits(exact.stiffness, 10), in_digits(exact.mass, 10), None, exact.freedoms, exact.coordinates
        )
        found = reduce(free, {"tip": {exact.freedoms[-2]: 1.0}}, modes=6)
        expected = reduce(exact, {"tip": {exact.freedoms[-2]: 1.0}}, modes=6)
        assert found.natural[:2].tolist() == [0.0, 0.0]
        np.testing.assert_allclose(found.natural[2:5], expected.natural[2:5], rtol=1e-2)
        assert any("few digits" in remark for remark in found.remarks)
        held = free.stiffness[2:, 2:].tocsc(), free.mass[2:, 2:].tocsc()
        modes = reduce(Matrices(*held, None, exact.freedoms[2:]), {"tip": {exact.freedoms[-2]: 1.0}}, modes=6)
        assert modes.natural[0] > 0.0


def test_few_digits_do_not_make_the_slow_mode_of_a_fine_mesh_a_rigid_body_mode() -> None:
    exact = hermite_beam(200, 1.7, 3.7, 0.9)
    given = Matrices(in_digits(exact.stiffness, 10), in_digits(exact.mass, 10), None, exact.freedoms)
    found = reduce(given, {"tip": {exact.freedoms[-2]: 1.0}}, modes=4)
    assert found.natural[0] > 0.0
    assert found.remarks == ("The 10 digits of the stiffness do not tell slow modes from rigid-body modes.",)


def test_motions_without_mass_beside_heavy_unknowns_are_refused() -> None:
    """Masses of 1e-5 to 6.5e6 kg turn the rounding of five such motions into 1e-25 kg: theirs and rounding alone."""
    drawn = drawn_matrices(np.random.default_rng(1998000074))
    stiffness, mass = (sparse.csc_array(each) for each in (drawn.stiffness, drawn.mass))
    with pytest.raises(UsageError, match="expected mass or stiffness for each motion"):
        reduce(Matrices(stiffness, mass, None, drawn.names), {}, modes=64)


def test_many_rigid_bodies_in_a_text_of_ten_digits_are_all_found() -> None:
    """24 rigid-body modes of springs over four decades: their rounding is seen before the last of them is sought."""
    drawn = drawn_matrices(np.random.default_rng(1998000682))
    stiffness = np.array([float(f"{each:.9e}") for each in drawn.stiffness.ravel()]).reshape(
        drawn.stiffness.shape
    )
    matrices = Matrices(sparse.csc_array(stiffness), sparse.csc_array(drawn.mass), None, drawn.names)
    found = reduce(matrices, {}, modes=30)
    assert (found.natural == 0.0).sum() == drawn.rigid == 24
    assert any("few digits" in remark for remark in found.remarks)


def test_a_point_that_hardly_moves_has_an_error_beside_a_usual_one() -> None:
    beam = hermite_beam(10, 1.0, 1.0, 1.0)
    points = {"tip": {beam.freedoms[-2]: 1.0}, "still": {beam.freedoms[-2]: 1e-90}}
    with np.errstate(all="raise", under="ignore"):
        found = reduce(beam, points, modes=4)
    assert 0.0 < found.error < 1.0
