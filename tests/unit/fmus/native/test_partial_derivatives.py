"""Partial derivatives at an instant: against 40 digits, against differences, and adjoint against directional."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double, c_uint32
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.component_fmu import HERTZ, HUNT_CROSSLEY, KELVIN_VOIGT, LOWER, RESTITUTION, UPPER, each
from support.integrated import Integrated

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.export import export_fmu

VERSIONS = ("2.0", "3.0")
MASSES, FREE, HELD, EXTERNAL_FORCE, PAIR = 3, 0, RESTITUTION, 6, 7
EXPONENTS = {KELVIN_VOIGT: 1.0, HERTZ: 1.5}
BODIES: dict[str, dict[str, Any]] = {
    "oscillator": {},
    "chain": {"masses": MASSES},
    "beam": {"modes": 4, "sensors": 2},
    "structure": {"modes": 3, "model_exchange": True},
}


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a function that returns an export of a body, written once."""
    folder = tmp_path_factory.mktemp("bodies")

    @cache
    def write(component: str, version: str, external: bool = False, full: bool = False) -> Path:
        path = folder / f"{component}-{version}-{external}-{full}.fmu"
        options = {} if full else BODIES[component]
        return export_fmu(component, path, fmi=version, external=external, full=full, **options)

    return write


def names_of(it: Integrated) -> tuple[list[str], list[str]]:
    """Return the unknowns of an instance, and its knowns: states, inputs and tunable parameters."""
    derivatives = [unknown.variable for unknown in it.description.derivatives]
    real = [v for v in it.description.modelVariables if v.type in {"Real", "Float64"}]
    outputs = [v.name for v in real if v.causality == "output" and v.variability == "continuous"]
    inputs = [v.name for v in real if v.causality == "input" or v.variability == "tunable"]
    knowns = [v.derivative.name for v in derivatives] + [name for name in inputs if "stop[" not in name]
    return [v.name for v in derivatives] + outputs, knowns


def directional(
    it: Integrated,
    unknowns: Sequence[str],
    knowns: Sequence[str],
    seed: Sequence[float] | NDArray[np.float64],
) -> NDArray[np.float64]:
    ends = [[it.references[name] for name in names] for names in (unknowns, knowns)]
    return np.array(it.fmu.getDirectionalDerivative(*ends, list(seed)))


def jacobian(it: Integrated, unknowns: Sequence[str], knowns: Sequence[str]) -> NDArray[np.float64]:
    return np.array([directional(it, unknowns, [known], [1.0]) for known in knowns]).T


def adjoint(
    it: Integrated,
    unknowns: Sequence[str],
    knowns: Sequence[str],
    seed: Sequence[float] | NDArray[np.float64],
) -> NDArray[np.float64]:
    ends = [[it.references[name] for name in names] for names in (unknowns, knowns)]
    return np.array(it.fmu.getAdjointDerivative(*ends, list(seed), len(knowns)))


def by_differences(
    it: Integrated,
    unknowns: Sequence[str],
    knowns: Sequence[str],
    step: float,
    states: Sequence[float] | NDArray[np.float64] = (),
) -> NDArray[np.float64]:
    """Return the Jacobian by central differences of values that are set and read by name; the states come first."""
    columns = []
    for place, known in enumerate(knowns):
        # at rest on a stop the displacement that is read is that of the stop
        at, found = states[place] if place < len(states) else it.get(known), []
        size = 1.0 if 0 < len(states) <= place else step  # inputs and amplitudes act linearly
        for sign in (1.0, -1.0):
            it.set({known: at + sign * size})
            found.append(np.array([it.get(name) for name in unknowns]))
        it.set({known: at})
        columns.append((found[0] - found[1]) / (2.0 * size))
    return np.array(columns).T


def size_of(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sizes of terms: where a stop holds its point, terms of the size of their column cancel."""
    rows, columns = (np.abs(matrix).max(axis=axis, keepdims=True) for axis in (1, 0))
    sizes: NDArray[np.float64] = np.maximum(rows, columns)
    return sizes


# ---- a chain, against 40 digits ----


def slopes(law: int, contact: Mapping[str, float], depth: Any, rate: Any) -> tuple[Any, Any]:
    """Return the slopes of the force of a stop that yields over depth and rate."""
    k, c = mpmath.mpf(contact["stiffness"]), mpmath.mpf(contact["damping"])
    if law == KELVIN_VOIGT:
        return k, c
    n = mpmath.mpf(EXPONENTS.get(law, contact["exponent"]))
    c = mpmath.mpf(0) if law == HERTZ else c
    return n * k * depth ** (n - 1) * (1 + c * rate), k * depth**n * c


def exact(
    chain: Mapping[str, Sequence[float]],
    law: int,
    contact: Mapping[str, float],
    side: int,
    state: Any,
    cosine: Any,
) -> Any:
    """Return the derivatives of the accelerations over states, forces and the base's two, by M, C, K."""
    n = MASSES
    m, k, c = ([mpmath.mpf(value) for value in chain[name]] for name in ("mass", "stiffness", "damping"))
    found = mpmath.zeros(n, 3 * n + 2)
    for i in range(n):
        for first, element in ((0, k), (n, c)):
            found[i, first + i] -= element[i] / m[i]
            if i > 0:
                found[i, first + i - 1] += element[i] / m[i]
            if i + 1 < n:
                found[i, first + i] -= element[i + 1] / m[i]
                found[i, first + i + 1] += element[i + 1] / m[i]
        found[i, 2 * n + i] = 1 / m[i]
        found[i, 3 * n], found[i, 3 * n + 1] = -1, -cosine
    if law == HELD:  # the stop takes whatever force keeps the last mass at rest
        found[n - 1, :] = mpmath.zeros(1, 3 * n + 2)
    elif law != FREE:
        sign = 1 if side == UPPER else -1
        depth = sign * (mpmath.mpf(state[n - 1]) - mpmath.mpf(contact["position"]))
        stiffness, damping = slopes(law, contact, depth, sign * mpmath.mpf(state[2 * n - 1]))
        found[n - 1, n - 1] -= stiffness / m[n - 1]
        found[n - 1, 2 * n - 1] -= damping / m[n - 1]
    return found


positive = st.floats(0.1, 10.0)
rows = st.lists(positive, min_size=MASSES, max_size=MASSES)


@given(
    st.fixed_dictionaries({"mass": rows, "stiffness": rows, "damping": rows}),
    st.sampled_from([FREE, HELD, KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY]),
    st.sampled_from([UPPER, LOWER]),
    st.fixed_dictionaries(
        {"stiffness": st.floats(1.0, 1e5), "damping": st.floats(0.0, 2.0), "exponent": st.floats(1.0, 3.0)}
    ),
    st.lists(st.floats(-1.0, 1.0), min_size=2 * MASSES, max_size=2 * MASSES),
)
def test_derivatives_of_a_chain_are_right_to_12_digits(
    exported: Callable[..., Path],
    chain: dict[str, list[float]],
    law: int,
    side: int,
    contact: dict[str, float],
    drawn: list[float],
) -> None:
    sign = 1.0 if side == UPPER else -1.0
    it = Integrated("Chain", "3.0", exported("chain", "3.0"))
    contact = {**contact, "position": 0.25 * sign}
    begun = 0.25 if law in {HELD, FREE} else 0.3
    starts = {name: value for key, row in chain.items() for name, value in each(key, row).items()}
    starts |= {f"contact[1].{key}": value for key, value in contact.items()}
    it.set({**starts, f"displacement_start[{MASSES}]": sign * begun, "displacement_start[1]": 0.0})
    it.set({"forcing.angular_frequency": 2.0, f"force[{MASSES}]": sign * 1e4 if law == HELD else 0.0})
    it.set({"contact[1].law": law, "contact[1].side": side, "contact[2].law": 0})
    it.begin()
    state = np.array(drawn)
    state[MASSES - 1] = (
        sign * (0.3 + abs(drawn[MASSES - 1])) if law not in {HELD, FREE} else state[MASSES - 1]
    )
    state[-1] *= 0.4  # a damped stop still pushes
    it.move(0.3, *state)
    knowns = [f"{name}[{k}]" for name in ("displacement", "velocity", "force") for k in range(1, MASSES + 1)]
    knowns += ["base_acceleration", "forcing.base_acceleration"]
    found = jacobian(it, [f"relative_acceleration[{k}]" for k in range(1, MASSES + 1)], knowns)
    with mpmath.workdps(40):
        expected = exact(chain, law, contact, side, state, mpmath.cos(mpmath.mpf(2) * mpmath.mpf(0.3)))
        errors = [
            [abs(mpmath.mpf(found[i, j]) - expected[i, j]) for j in range(found.shape[1])]
            for i in range(MASSES)
        ]
        size = max(abs(number) for number in expected)
        assert max(max(row) for row in errors) <= 1e-12 * size
    it.fmu.freeInstance()


# ---- every body, every variable, against differences ----


#: Start displacement, amplitude of the forcing and input force by name.
ACTING = {
    "Oscillator": ("displacement_start", "forcing.amplitude", "force"),
    "Chain": ("displacement_start[1]", "forcing.amplitude[1]", "force[1]"),
    "Beam": ("modal_displacement_start[1]", "forcing.amplitude", "force"),
    "Structure": ("", "forcing.amplitude", "force"),
}


def started(it: Integrated, phase: str) -> Integrated:
    """Return an instance in continuous-time mode that flies, rests on its first stop or presses it in."""
    start, amplitude, force = ACTING[it.description.modelName]
    law = {"flies": FREE, "rests": HELD, "presses": KELVIN_VOIGT, "presses harder": HUNT_CROSSLEY}[phase]
    it.set({"contact[1].law": law, "contact[1].position": 0.0 if phase == "rests" else -0.01})
    it.set({"contact[1].stiffness": 500.0, "contact[1].damping": 0.2, "contact[1].exponent": 1.7})
    it.set({"forcing.angular_frequency": 3.0, amplitude: 0.1, force: 5e3})
    if start:
        it.set({start: 0.0})
    if it.description.modelName == "Chain":
        it.set({"contact[1].mass_number": 1})
    it.begin()
    return it


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("phase", ["flies", "rests", "presses", "presses harder"])
@pytest.mark.parametrize("component", BODIES)
def test_derivatives_of_a_body_are_its_differences(
    exported: Callable[..., Path], component: str, phase: str, version: str
) -> None:
    it = started(Integrated(component.capitalize(), version, exported(component, version)), phase)
    unknowns, knowns = names_of(it)
    states = 1e-4 * np.cos(np.arange(len(it.description.derivatives)))
    it.move(0.2, *states)
    assert (it.get("contact[1].force") > 0.0) == (phase != "flies")
    found, expected = jacobian(it, unknowns, knowns), by_differences(it, unknowns, knowns, 1e-6, states)
    assert (np.abs(found - expected) <= 1e-6 * np.maximum(size_of(expected), 1.0)).all()
    # the forcing and the inputs act, and a force of the stop follows from the state
    place = unknowns.index("contact[1].force")
    assert np.abs(found[place]).max() > 0.0 or phase == "flies"
    assert np.abs(found[unknowns.index("acceleration")]).max() > 0.1 or phase == "rests"


@pytest.mark.parametrize("phase", ["flies", "rests", "presses", "presses harder"])
@pytest.mark.parametrize("component", BODIES)
def test_adjoint_derivatives_are_the_transposed_directional_ones(
    exported: Callable[..., Path], component: str, phase: str
) -> None:
    it = started(Integrated(component.capitalize(), "3.0", exported(component, "3.0")), phase)
    unknowns, knowns = names_of(it)
    it.move(0.2, *(1e-3 * np.cos(np.arange(len(it.description.derivatives)))))
    forward = jacobian(it, unknowns, knowns)
    back = np.array([adjoint(it, [unknown], knowns, [1.0]) for unknown in unknowns])
    assert (np.abs(back - forward) <= 1e-13 * size_of(forward)).all()
    generator = np.random.default_rng(1)
    seed, other = generator.normal(size=len(knowns)), generator.normal(size=len(unknowns))
    along = float(np.dot(other, directional(it, unknowns, knowns, seed)))
    assert along == pytest.approx(float(np.dot(adjoint(it, unknowns, knowns, other), seed)), rel=1e-10)
    assert (
        np.abs(directional(it, unknowns, knowns, seed) - np.dot(forward, seed)).max()
        <= 1e-12 * np.abs(forward).max()
    )


MOTION = [f"stop[1].{name}" for name in ("velocity", "amplitude", "angular_frequency", "phase")]


def on_moving_stop(it: Integrated, motion: Mapping[str, float], **values: float) -> None:
    """Put a structure at 0 in continuous-time mode, where its moving stop presses or holds it."""
    towards = 1e3 if values["side"] == UPPER else -1e3
    it.set({f"contact[1].{name}": value for name, value in values.items()} | {"force": towards})
    it.set({f"stop[1].{name}": value for name, value in motion.items()})
    it.begin()
    it.move(0.0, *([0.0] * len(it.description.derivatives)))


@given(
    st.sampled_from([KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY]),
    st.sampled_from([UPPER, LOWER]),
    st.tuples(*(st.floats(-0.05, 0.05) for _ in range(2)), st.floats(0.5, 5.0), st.floats(-3.0, 3.0)),
    st.sampled_from(VERSIONS),
)
def test_numbers_of_the_motion_of_a_pressed_stop_are_knowns(
    exported: Callable[..., Path], law: int, side: int, motion: tuple[float, ...], version: str
) -> None:
    it = Integrated("Structure", version, exported("structure", version))
    values = {"law": law, "side": side, "stiffness": 500.0, "damping": 0.2, "exponent": 1.7}
    place = -0.4 if side == UPPER else 0.4
    on_moving_stop(
        it, dict(zip([name[8:] for name in MOTION], motion, strict=True)), position=place, **values
    )
    unknowns = ["modal_acceleration[1]", "acceleration", "contact[1].force", "displacement", "velocity"]
    found, expected = jacobian(it, unknowns, MOTION), by_differences(it, unknowns, MOTION, 1e-5)
    assert it.get("contact[1].force") > 0.0
    assert np.abs(found - expected).max() <= 1e-6 * max(np.abs(expected).max(), 1.0)
    back = np.array([adjoint(it, [name], MOTION, [1.0]) for name in unknowns]) if it.new else found
    assert np.abs(back - found).max() <= 1e-13 * np.abs(found).max()
    it.fmu.freeInstance()


@pytest.mark.parametrize("side", [UPPER, LOWER])
def test_a_held_point_follows_the_acceleration_of_its_stop(exported: Callable[..., Path], side: int) -> None:
    amplitude, frequency = 0.01, 3.0
    it = Integrated("Structure", "3.0", exported("structure", "3.0"))
    motion = {"amplitude": amplitude, "angular_frequency": frequency}
    on_moving_stop(it, motion, law=HELD, side=side, position=-amplitude)
    assert it.get("contact[1].force") > 0.0
    unknowns = [*(f"modal_acceleration[{j}]" for j in (1, 2, 3)), "contact[1].force"]  # each shape is 1
    found = jacobian(it, unknowns, MOTION)
    of_stop = np.array([0.0, -(frequency**2), -2.0 * amplitude * frequency, 0.0])
    assert found[:3].sum(axis=0) == pytest.approx(of_stop, rel=1e-13)
    assert found[3] == pytest.approx(-of_stop / 3.0 if side == UPPER else of_stop / 3.0, rel=1e-13)
    back = np.array([adjoint(it, [name], MOTION, [1.0]) for name in unknowns])
    assert back == pytest.approx(found, rel=1e-13)


@pytest.mark.parametrize("masses", [2, MASSES])
@pytest.mark.parametrize("component", BODIES)
def test_lists_in_any_order_give_the_sums_of_single_calls(
    exported: Callable[..., Path], component: str, masses: int
) -> None:
    it = Integrated(component.capitalize(), "3.0", exported(component, "3.0"))
    if component == "chain":
        it.set({"masses": masses})
    started(it, "presses")
    unknowns, knowns = names_of(it)
    forward, generator = jacobian(it, unknowns, knowns), np.random.default_rng(2)
    for _ in range(10):
        rows, columns = (generator.integers(0, len(names), size=40) for names in (unknowns, knowns))
        chosen = [unknowns[i] for i in rows], [knowns[j] for j in columns]
        seed = generator.normal(size=40)
        matrix = forward[rows][:, columns]
        near = 1e-12 * np.abs(matrix).sum()
        for _ in range(2):  # the second call knows the lists
            assert np.abs(directional(it, *chosen, seed) - matrix @ seed).max() <= near
            assert np.abs(adjoint(it, *chosen, seed) - seed @ matrix).max() <= near


def test_a_chain_of_fewer_modes_than_masses_has_them(exported: Callable[..., Path]) -> None:
    it = Integrated("Chain", "3.0", exported("chain", "3.0", full=True), "CoSimulation")
    it.set({"masses": 4, "modes": 1, "forcing.angular_frequency": 2.0, "displacement_start[1]": 0.1})
    it.fmu.exitInitializationMode()
    unknowns = [f"{name}[{k}]" for name in ("relative_acceleration", "acceleration") for k in range(1, 5)]
    knowns = [f"force[{k}]" for k in range(1, 5)] + ["base_acceleration"]
    found = directional(it, unknowns, knowns, np.ones(5))
    assert found == pytest.approx(jacobian(it, unknowns, knowns).sum(axis=1))
    assert found == pytest.approx(by_differences(it, unknowns, knowns, 1.0).sum(axis=1))


# ---- co-simulation, and the stop ----


@pytest.mark.parametrize("version", VERSIONS)
def test_co_simulation_has_them_at_a_communication_point(exported: Callable[..., Path], version: str) -> None:
    it = Integrated("Oscillator", version, exported("oscillator", version, True), "CoSimulation")
    it.set({"mass": 2.0, "contact[1].law": PAIR, "contact[2].law": PAIR, "contact[2].side": LOWER})
    assert directional(it, ["acceleration"], ["force"], [1.0]) == pytest.approx([0.5])
    it.fmu.exitInitializationMode()
    knowns = [
        "force",
        "contact[1].applied_force",
        "contact[2].applied_force",
        "base_acceleration",
        "velocity",
    ]
    found = jacobian(it, ["acceleration", "contact[1].impulse"], knowns)
    assert found == pytest.approx(np.array([[0.5, -0.5, 0.5, 0.0, 0.0], [0.0] * 5]))
    assert by_differences(it, ["acceleration"], knowns[:4], 0.1) == pytest.approx(found[:1, :4])


def test_a_force_that_another_component_answers_acts_on_a_pressed_contact(
    exported: Callable[..., Path],
) -> None:
    it = Integrated("Oscillator", "2.0", exported("oscillator", "2.0", True), "CoSimulation")
    it.set(
        {
            "mass": 2.0,
            "contact[1].law": EXTERNAL_FORCE,
            "contact[1].position": -1.0,
            "displacement_start": 0.0,
        }
    )
    it.set(
        {
            "contact[1].applied_force": 3.0,
            "contact[1].applied_stiffness": 5.0,
            "contact[1].applied_damping": 0.5,
        }
    )
    it.fmu.exitInitializationMode()
    found = jacobian(
        it, ["acceleration", "contact[1].force"], ["contact[1].applied_force", "displacement", "velocity"]
    )
    assert found == pytest.approx(np.array([[-0.5, -3.0, -0.25], [1.0, 5.0, 0.5]]))


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("law", [RESTITUTION, KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY])
@pytest.mark.parametrize("side", [UPPER, LOWER])
def test_derivatives_of_a_stop_are_its_differences(version: str, law: int, side: int) -> None:
    it = Integrated("ImpactStop", version)
    it.set({"law": law, "side": side, "yield_velocity": 0.1, "restitution": 0.8})
    it.set({"stiffness": 1e3, "damping": 0.3, "exponent": 2.5, "position": 0.1})
    sign = 1.0 if side == UPPER else -1.0
    it.set({"displacement": 0.1 + 0.2 * sign, "velocity": 0.4 * sign})
    it.fmu.exitInitializationMode()
    unknowns = [f"applied_{name}" for name in ("restitution", "force", "stiffness", "damping")]
    found = jacobian(it, unknowns, ["displacement", "velocity"])
    expected = by_differences(it, unknowns, ["displacement", "velocity"], 1e-5)
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert np.abs(found).max() > 0.1
    # out of reach, and below the yield velocity, nothing changes
    it.set({"displacement": 0.1 - 0.2 * sign, "velocity": 0.01})
    assert not jacobian(it, unknowns, ["displacement", "velocity"]).any()
    if version == "3.0":
        assert not adjoint(it, unknowns, ["displacement", "velocity"], [1.0] * 4).any()


# ---- calls that are refused ----


@pytest.mark.parametrize("version", VERSIONS)
def test_a_pair_that_the_standard_does_not_allow_is_an_error_with_a_line(
    exported: Callable[..., Path], version: str
) -> None:
    it = Integrated("Oscillator", version, exported("oscillator", version, True))
    said = it.message(directional, it, ["acceleration"], ["velocity"], [1.0])
    assert "is no known here: a state, which follows from the start values now" in said
    it.begin()
    for known, reason in (
        ("mass", "a fixed parameter"),
        ("acceleration", "an output"),
        ("contact[1].applied_impulse", "it acts as an event"),
        ("forcing.phase", "a fixed parameter"),
        ("displacement_start", "a fixed parameter"),
    ):
        said = it.message(directional, it, ["acceleration"], [known], [1.0])
        assert f"value reference {it.references[known]} is no known here: {reason}" in said
    for unknown, reason in (
        ("force", "an input, or a parameter"),
        ("mass", "a fixed parameter"),
        ("contact[1].event_indicator", "an event indicator"),
        ("forcing.amplitude", "an input, or a parameter"),
    ):
        said = it.message(directional, it, [unknown], ["force"], [1.0])
        assert f"value reference {it.references[unknown]} is no unknown here: {reason}" in said
    assert "not a variable of this type" in it.message(
        directional, it, ["contact[1].count"], ["force"], [1.0]
    )
    it.set({"velocity": math.nan})
    assert "expected finite states" in it.message(directional, it, ["acceleration"], ["force"], [1.0])
    it.set({"velocity": 0.0})
    assert "expected finite states" in it.message(directional, it, ["acceleration"], ["force"], [math.inf])
    assert directional(it, ["acceleration"], ["force"], [2.0]) == pytest.approx([2.0])
    assert directional(it, ["acceleration", "velocity"], [], []) == pytest.approx([0.0, 0.0])
    assert directional(it, ["acceleration"], ["force", "force"], [1.0, 2.0]) == pytest.approx([3.0])


def test_wrong_sizes_and_missing_arrays_are_errors(exported: Callable[..., Path]) -> None:
    it = Integrated("Oscillator", "3.0", exported("oscillator", "3.0"))
    unknown, known = ((c_uint32 * 1)(it.references[name]) for name in ("acceleration", "force"))
    numbers = (c_double * 2)()
    call = it.fmu.fmi3GetDirectionalDerivative
    for sizes in ((2, 1), (1, 2), (0, 1)):
        arguments = (unknown, 1, known, 1, numbers, sizes[0], numbers, sizes[1])
        assert "expected 1 seeds and room for 1" in it.message(call, it.fmu.component, *arguments)
    assert "got null" in it.message(call, it.fmu.component, None, 1, known, 1, numbers, 1, numbers, 1)
    assert "got null" in it.message(call, it.fmu.component, unknown, 1, known, 1, None, 1, numbers, 1)


def test_bad_parameters_are_named_in_initialization(exported: Callable[..., Path]) -> None:
    it = Integrated("Oscillator", "3.0", exported("oscillator", "3.0"))
    it.set({"mass": -1.0})
    assert "mass: expected" in it.message(directional, it, ["acceleration"], ["force"], [1.0])
    it.set({"mass": 4.0})
    assert directional(it, ["acceleration"], ["force"], [1.0]) == pytest.approx([0.25])


def test_calls_change_no_bit_of_the_motion(exported: Callable[..., Path]) -> None:
    ends = []
    for derive in (False, True):
        it = Integrated("Oscillator", "3.0", exported("oscillator", "3.0"), "CoSimulation")
        it.set({"contact[1].law": RESTITUTION, "contact[1].restitution": 0.7, "forcing.amplitude": 0.5})
        it.set({"forcing.angular_frequency": 1.3})
        it.fmu.exitInitializationMode()
        for step in range(200):
            it.fmu.doStep(0.1 * step, 0.1)
            if derive:
                jacobian(it, ["acceleration", "contact[1].force"], ["force", "velocity"])
        ends.append((it.get("displacement"), it.get("velocity"), it.get("contact[1].force")))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("component", ["Gain", "Oscillator", "Chain", "Beam", "Structure", "ImpactStop"])
def test_descriptions_say_who_has_derivatives(component: str) -> None:
    given = component != "Gain"
    for version, names in (("2.0", ["Directional"]), ("3.0", ["Directionals", "Adjoints"])):
        text = zipfile.ZipFile(fmu_path(component, version)).read("modelDescription.xml").decode()
        kinds = 2 if given else 0
        for name in names:
            flag = f'provides{name.removesuffix("s")}Derivative{"s" if name.endswith("s") else ""}="true"'
            assert text.count(flag) == kinds
    if not given:
        new = Integrated(component, "3.0", kind="CoSimulation")
        assert "not available" in new.message(directional, new, ["output"], ["input"], [1.0])
        assert "not available" in new.message(adjoint, new, ["output"], ["input"], [1.0])


def test_what_has_a_derivative_is_among_the_dependencies(exported: Callable[..., Path]) -> None:
    it = started(Integrated("Chain", "3.0", exported("chain", "3.0")), "presses")
    unknowns, knowns = names_of(it)
    structure = [*it.description.outputs, *it.description.derivatives]
    listed = {unknown.variable.name: {v.name for v in unknown.dependencies or ()} for unknown in structure}
    found = jacobian(it, unknowns, knowns)
    for i, unknown in enumerate(unknowns):
        nonzero = {knowns[j] for j in np.flatnonzero(np.abs(found[i]) > 1e-12)}
        assert nonzero - {unknown} <= listed[unknown]
