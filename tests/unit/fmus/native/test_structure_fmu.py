"""The Structure FMU: modes given as arrays or by a file, against other bodies and closed forms."""

import math
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from support.component_fmu import HERTZ, KELVIN_VOIGT, LOWER, UPPER, VERSIONS, ComponentFmu, each, stop
from support.modal_fmu import CONTACTS, MODES, modes_of, structure_fmu

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.structure_file import STRUCTURE_MEMBER, structure_file

Arrays = dict[str, Any]


def oscillator(mass: float, stiffness: float, damping: float) -> Arrays:
    """Return the one mode of an oscillator."""
    root, natural = math.sqrt(mass), math.sqrt(stiffness / mass)
    return {
        "mode.angular_frequency": [natural],
        "mode.damping_ratio": [0.5 * damping / mass / natural],
        "mode.contact_shape": [[1.0 / root]],
        "mode.observed_shape": [1.0 / root],
        "mode.forcing": [1.0 / root],
        "mode.force": [1.0 / root],
        "mode.base": [-root],
    }


def free_masses(*mass: float) -> Arrays:
    """Return the modes of masses that no spring holds; contact k is between mass k and the next."""
    shape = np.diag(1.0 / np.sqrt(mass))
    return {
        "mode.angular_frequency": np.zeros(len(mass)),
        "mode.contact_shape": shape[:-1] - shape[1:],
        "mode.observed_shape": shape[0],
    }


def history(fmu: ComponentFmu, end: float, steps: int) -> np.ndarray:
    """Return displacement, velocity and impacts of the first contact at the ends of steps."""
    rows = []
    for _ in range(steps):
        fmu.step(end / steps)
        rows.append([*fmu.state(), fmu.get("contact[1].count")])
    return np.array(rows)


# ---- against the other bodies ----


@pytest.mark.parametrize("stops", [stop(1.0, 0.7), stop(0.5, law=KELVIN_VOIGT, stiffness=50.0, damping=0.1)])
def test_one_mode_moves_as_the_oscillator_bit_for_bit(stops: Mapping[str, float]) -> None:
    forcing = {"forcing.amplitude": 0.5, "forcing.angular_frequency": 1.0, **stops}
    with (
        ComponentFmu("Oscillator", {"damping": 0.2, **forcing}) as own,
        structure_fmu(oscillator(1.0, 1.0, 0.2), forcing) as given_as_mode,
    ):
        assert np.array_equal(history(own, 80.0, 40), history(given_as_mode, 80.0, 40))


@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.floats(0.05, 0.5), st.floats(-1.0, 1.0))
@settings(max_examples=30)
def test_any_oscillator_moves_alike_within_rounding(
    mass: float, stiffness: float, ratio: float, base: float
) -> None:
    damping = 2.0 * ratio * math.sqrt(mass * stiffness)
    w = math.sqrt(stiffness / mass)
    loads = {
        "forcing.amplitude": 0.5 * stiffness,
        "forcing.base_acceleration": base,
        "force": 0.1 * stiffness,
    }
    scene = {**loads, "forcing.angular_frequency": 0.9 * w, **stop(0.5, 0.6)}
    body = {"mass": mass, "stiffness": stiffness, "damping": damping}
    with (
        ComponentFmu("Oscillator", {**body, **scene}) as own,
        structure_fmu(oscillator(mass, stiffness, damping), scene) as given_as_mode,
    ):
        one, other = (history(fmu, 12.0 / w, 12) for fmu in (own, given_as_mode))
    assert np.array_equal(one[:, 2], other[:, 2])
    assert np.abs(one - other)[:, :2].max() <= 1e-9 * (1.0 + np.abs(one).max())


def test_a_chain_given_as_modes_moves_as_the_chain() -> None:
    mass, spring, dashpot = np.array([1.0, 0.5, 2.0]), [3.0, 2.0, 1.0], [0.1, 0.3, 0.05]

    def matrix(element: list[float]) -> np.ndarray:
        k = np.array([*element, 0.0])
        return np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)

    natural, shape, damping = modes_of(mass, matrix(spring), matrix(dashpot))
    arrays = {
        "mode.angular_frequency": natural,
        "mode.damping": damping,
        "mode.contact_shape": [shape[2], shape[0]],
        "mode.observed_shape": shape[2],
        "mode.forcing": shape[1],
        "mode.velocity_start": shape.T @ (mass * [0.5, 0.0, 0.0]),
    }
    common = {"forcing.angular_frequency": 0.8, **stop(0.2, 0.6), **stop(-0.3, 0.8, k=2, side=LOWER)}
    chain = {
        **{"masses": 3, **each("mass", mass), **each("stiffness", spring), **each("damping", dashpot)},
        **{"forcing.amplitude[2]": 0.5, "velocity_start[1]": 0.5, "contact[2].mass_number": 1, **common},
    }
    with (
        ComponentFmu("Chain", chain) as own,
        structure_fmu(arrays, {"forcing.amplitude": 0.5, **common}, coupled=True) as given_as_modes,
    ):
        one, other = history(own, 30.0, 30), history(given_as_modes, 30.0, 30)
    assert one[-1, 2] > 3
    assert np.abs(one - other).max() <= 1e-11


# ---- closed forms ----


@given(
    *(st.floats(1e-3, 1e3) for _ in range(2)),
    st.just(0.0) | st.floats(1e-6, 1.0),
    st.floats(0.1, 10.0),
    st.floats(-5.0, 5.0),
)
@settings(max_examples=30)
def test_two_free_masses_that_meet_keep_their_momentum_and_have_their_restitution(
    m1: float, m2: float, restitution: float, closing: float, common: float
) -> None:
    arrays = free_masses(m1, m2)
    speeds = np.array([closing + common, common])
    arrays["mode.velocity_start"] = np.sqrt([m1, m2]) * speeds
    with structure_fmu(arrays, stop(1.0, restitution)) as fmu:
        fmu.step(2.0 / closing)
        after = fmu.get_each("modal_velocity[{}]", 2) / np.sqrt([m1, m2])
        count, time, speed, impulse = fmu.contact("count", "last_time", "last_velocity", "impulse")
    reduced = m1 * m2 / (m1 + m2)
    size = (m1 + m2) * np.abs(speeds).max()
    assert count == 1
    assert time == pytest.approx(1.0 / closing, rel=1e-14 * (1.0 + np.abs(speeds).max() / closing))
    assert speed == pytest.approx(closing, rel=1e-14 * (1.0 + np.abs(speeds).max() / closing))
    assert impulse == pytest.approx((1.0 + restitution) * reduced * speed, rel=1e-14)
    assert abs(m1 * after[0] + m2 * after[1] - m1 * speeds[0] - m2 * speeds[1]) <= 1e-15 * size
    assert after[1] - after[0] == pytest.approx(
        restitution * closing, abs=1e-14 * (np.abs(speeds).max() + closing)
    )


def test_equal_free_masses_in_a_row_hand_their_velocity_on() -> None:
    arrays = free_masses(*[2.0] * 5)
    arrays["mode.velocity_start"] = math.sqrt(2.0) * np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    gaps = [stop(0.25 * k, 1.0, k=k) for k in range(1, 5)]
    with structure_fmu(arrays, {name: value for gap in gaps for name, value in gap.items()}) as fmu:
        fmu.step(10.0)
        velocities = fmu.get_each("modal_velocity[{}]", 5) / math.sqrt(2.0)
        times = [fmu.get(f"contact[{k}].last_time") for k in range(1, 5)]
    assert velocities == pytest.approx([0.0, 0.0, 0.0, 0.0, 1.0], abs=1e-15)
    assert times == pytest.approx([0.25, 0.75, 1.5, 2.5], rel=1e-15)


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(0, 2))
@settings(max_examples=30)
def test_coupled_damping_is_that_of_the_matrix_exponential(seed: int, count: int, free: int) -> None:
    rng = np.random.default_rng(seed)
    natural = np.sort(np.where(np.arange(count) < free, 0.0, rng.uniform(0.3, 4.0, count)))
    root = rng.uniform(-1.0, 1.0, (count, rng.integers(1, count + 1)))
    damping, start = root @ root.T, rng.uniform(-1.0, 1.0, 2 * count)
    force, w, phase = rng.uniform(-1.0, 1.0, count), 1.3, 0.4
    arrays = {
        "mode.angular_frequency": natural,
        "mode.damping": damping,
        "mode.forcing": force,
        "mode.displacement_start": start[:count],
        "mode.velocity_start": start[count:],
    }
    harmonic = {"forcing.amplitude": 1.0, "forcing.angular_frequency": w, "forcing.phase": phase}
    with structure_fmu(arrays, harmonic, coupled=True) as fmu:
        fmu.step(2.7)
        found = [*fmu.get_each("modal_displacement[{}]", count), *fmu.get_each("modal_velocity[{}]", count)]
    # the force as two further states, cos and sin of its phase
    square = np.zeros((2 * count + 2, 2 * count + 2))
    square[:count, count : 2 * count] = np.eye(count)
    square[count : 2 * count, :count] = -np.diag(natural**2)
    square[count : 2 * count, count : 2 * count] = -damping
    square[count : 2 * count, 2 * count] = force
    square[2 * count, 2 * count + 1], square[2 * count + 1, 2 * count] = -w, w
    exact = expm(2.7 * square) @ [*start, math.cos(phase), math.sin(phase)]
    assert np.abs(found - exact[: 2 * count]).max() <= 2e-13 * (1.0 + np.abs(exact).max())


# ---- as large as it can be ----


def all_at_once(law: int, **more: float) -> tuple[Arrays, dict[str, float]]:
    """Return 64 modes with 32 contacts: a string between stops on either side of 16 places."""
    j, places = np.arange(1, MODES + 1), np.repeat(np.arange(1, 17) / 17.0, 2)
    arrays: Arrays = {
        "mode.angular_frequency": 1.0 * j,
        "mode.damping_ratio": np.full(MODES, 0.01),
        "mode.contact_shape": math.sqrt(2.0) * np.sin(np.pi * np.outer(places, j)),
        "mode.observed_shape": math.sqrt(2.0) * np.sin(0.3 * np.pi * j),
        "mode.velocity_start": math.sqrt(2.0) * np.sin(0.3 * np.pi * j) / j**2,
    }
    stops = [
        stop(0.1 * (-1) ** k, 0.6, k=k + 1, side=(UPPER, LOWER)[k % 2], law=law, **more) for k in range(32)
    ]
    return arrays, {name: value for one in stops for name, value in one.items()}


@pytest.mark.parametrize(
    ("law", "more"), [(1, {}), (KELVIN_VOIGT, {"stiffness": 1e4}), (HERTZ, {"stiffness": 1e5})]
)
def test_the_largest_structure_keeps_its_energy_and_its_stops(law: int, more: dict[str, float]) -> None:
    arrays, stops = all_at_once(law, **more)
    with structure_fmu(arrays, {**stops, "record.energies": True}) as fmu:
        total = fmu.get("energy.kinetic") + fmu.get("energy.potential")
        for _ in range(4):
            fmu.step(0.3)
        kinds = ("kinetic", "potential", "damping_loss", "contact_loss")
        counts = [fmu.get(f"contact[{k}].count") for k in range(1, CONTACTS + 1)]
        beyond = [(-1) ** k * fmu.get(f"contact[{k + 1}].displacement") - 0.1 for k in range(CONTACTS)]
        assert sum(fmu.get(f"energy.{kind}") for kind in kinds) == pytest.approx(total, rel=1e-9)
    assert sum(count > 0 for count in counts) >= 16
    assert law != 1 or max(beyond) <= 1e-15


# ---- the file of modes ----


@pytest.mark.parametrize(("version", "full"), [("3.0", False), ("3.0", True), ("2.0", False)])
def test_a_file_of_modes_moves_as_the_arrays_do(tmp_path: Path, version: str, full: bool) -> None:
    arrays = oscillator(2.0, 3.0, 0.3)
    scene = {"forcing.amplitude": 0.5, "forcing.angular_frequency": 1.1, **stop(0.1, 0.6)}
    path = export_fmu(
        "Structure", tmp_path / "one.fmu", modes=1, contacts=1, fmi=version, full=full, starts=scene,
        structure=structure_file(arrays),
    )  # fmt: skip
    assert validate_fmu(str(path)) == []
    with structure_fmu(arrays, scene) as own, ComponentFmu(path, version=version) as exported:
        assert np.array_equal(history(own, 30.0, 30), history(exported, 30.0, 30))


@pytest.mark.parametrize("version", VERSIONS)
def test_a_file_holds_the_largest_structure(tmp_path: Path, version: str) -> None:
    arrays, stops = all_at_once(1)
    arrays["mode.damping"] = 0.02 * np.diag(np.arange(1.0, MODES + 1.0)) + 0.001
    path = export_fmu(
        "Structure", tmp_path / "largest.fmu", modes=64, contacts=32, fmi=version, starts=stops,
        structure=structure_file(arrays, coupled=True), stop_time=0.1,
    )  # fmt: skip
    with structure_fmu(arrays, stops, coupled=True) as own, ComponentFmu(path, version=version) as exported:
        for fmu in (own, exported):
            fmu.step(0.5)
        assert own.state() == exported.state()
        assert own.contact("count", "last_velocity") == exported.contact("count", "last_velocity")


HEAD = structure_file({"mode.angular_frequency": [1.0, 2.0], "mode.contact_shape": [[1.0, 1.0]]})
SIZES = "2 modes, 1 contacts, 0 sines, 0 signals and 0 rows of tables"
Members = dict[str, dict[str, bytes]]


@pytest.fixture(scope="module")
def good_members(tmp_path_factory: pytest.TempPathFactory) -> Members:
    """The members of an exported Structure, by version of FMI."""
    path, found = tmp_path_factory.mktemp("good") / "good.fmu", {}
    for version in VERSIONS:
        export_fmu("Structure", path, modes=2, contacts=1, fmi=version, structure=HEAD)
        with zipfile.ZipFile(path) as archive:
            found[version] = {name: archive.read(name) for name in archive.namelist()}
    return found


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (b"", "a file that begins with VISTRUC2 and six sizes, got another"),
        (b"VISTRUC1" + HEAD[8:], "a file that begins with VISTRUC2"),
        (HEAD[:-1], f"232 bytes for {SIZES}, got fewer"),
        (HEAD + b"\0", f"232 bytes for {SIZES}, got more"),
        (HEAD[:8] + bytes(8) + HEAD[16:], "1 to 64 modes, got 0"),
        (HEAD[:8] + b"\x41" + HEAD[9:], "1 to 64 modes, got 65"),
        (HEAD[:16] + b"\xff" * 8 + HEAD[24:], "0 to 32 contacts, got -1"),
        (HEAD[:24] + b"\x10" + HEAD[25:], "0 to 15 sines, got 16"),
        (HEAD[:32] + b"\x09" + HEAD[33:], "0 to 8 signals, got 9"),
        (HEAD[:40] + b"\1\x20" + HEAD[42:], "0 to 8192 rows of tables, got 8193"),
        (HEAD[:48] + b"\2" + HEAD[49:], "0 to 1 as mark of coupled damping, got 2"),
        (HEAD[:-8] + b"\xff" * 8, "finite numbers, got"),
    ],
)
def test_a_damaged_file_is_refused_by_one_line(
    good_members: Members, tmp_path: Path, version: str, content: bytes, rule: str
) -> None:
    write_fmu(tmp_path / "bad.fmu", {**good_members[version], STRUCTURE_MEMBER: content})
    messages: list[str] = []
    with pytest.raises(Exception, match="instantiate"):
        ComponentFmu(tmp_path / "bad.fmu", version=version, messages=messages)
    (message,) = messages
    assert f"resources/structure.bin: expected {rule}" in message
    assert "\n" not in message


def test_a_damaged_file_is_not_exported(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"resources/structure\.bin: expected 232 bytes"):
        export_fmu("Structure", tmp_path / "new.fmu", modes=2, contacts=1, structure=HEAD[:-1])
    assert not (tmp_path / "new.fmu").exists()


def test_more_modes_than_the_file_has_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match=r"modes: expected at most the 2 modes of resources/structure\.bin, got 3"
    ):
        export_fmu("Structure", tmp_path / "new.fmu", modes=3, contacts=1, structure=HEAD)


# ---- further sines ----

FORCED: Arrays = {
    "mode.angular_frequency": [0.8, 2.1],
    "mode.damping_ratio": [0.03, 0.02],
    "mode.contact_shape": [[1.0, 0.6]],
    "mode.observed_shape": [1.0, 0.6],
    "mode.forcing": [1.0, 0.6],
    "mode.base": [-1.0, 0.4],
    "mode.sine": [[0.5, -1.0], [-1.0, 0.4]],
}
SINES = {
    **{"forcing.amplitude": 0.4, "forcing.angular_frequency": 1.0, "forcing.phase": 0.3},
    **{"sine[1].amplitude": 0.3, "sine[1].angular_frequency": 1.7, "sine[1].phase": 2.0},
    **{
        "sine[2].amplitude": 0.2,
        "sine[2].angular_frequency": 0.6,
        "sine[2].phase": -0.5,
        "sine[2].of_base": True,
    },
}


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_a_file_holds_the_rows_of_sines(tmp_path: Path, version: str) -> None:
    scene = {**SINES, **stop(0.4, 0.6)}
    path = export_fmu(
        "Structure", tmp_path / "two.fmu", modes=2, contacts=1, fmi=version, starts=scene,
        structure=structure_file(FORCED),
    )  # fmt: skip
    with structure_fmu(FORCED, scene) as own, ComponentFmu(path, version=version) as exported:
        assert np.array_equal(history(own, 30.0, 10), history(exported, 30.0, 10))
        assert own.get("contact[1].count") > 3


def test_an_acceleration_of_the_base_by_a_sine_is_in_the_absolute_acceleration() -> None:
    still = {"mode.angular_frequency": [0.0], "mode.base": [-1.0], "mode.sine": [[-1.0], [-1.0], [1.0]]}
    of_base = {"sine[1].amplitude": 0.3, "sine[1].angular_frequency": 1.7, "sine[1].of_base": True}
    of_base |= {"sine[2].amplitude": 0.5, "sine[2].of_base": True}
    of_base |= {"sine[3].amplitude": 0.2, "sine[3].angular_frequency": 0.3}
    with structure_fmu(still, of_base) as fmu:
        fmu.step(2.0)
        assert fmu.get("acceleration") == pytest.approx(0.2 * math.cos(0.6), abs=1e-13)


def test_tuned_sines_keep_their_phases() -> None:
    at, tuned = (
        31.7,
        {"forcing.angular_frequency": 1.1, "sine[1].amplitude": 0.5, "sine[2].angular_frequency": 0.7},
    )
    shifted = {"forcing.phase": 0.3 - 0.1 * at, "sine[2].phase": -0.5 - 0.1 * at}
    with structure_fmu(FORCED, {**SINES, **stop(0.4, 0.6)}) as fmu:
        fmu.step(at)
        start = {
            f"mode.{name}_start": [fmu.get(f"modal_{name}[{k}]") for k in (1, 2)]
            for name in ("displacement", "velocity")
        }
        for name, value in tuned.items():
            fmu.set(name, value)
        fmu.step(10.0)
        reached = fmu.state()
    again = {**SINES, **tuned, **shifted, **stop(0.4, 0.6)}
    with structure_fmu({**FORCED, **start}, again, start_time=at) as fmu:
        fmu.step(10.0)
        assert fmu.state() == pytest.approx(reached, abs=1e-10)
        assert fmu.get("contact[1].count") >= 2


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("sine[1].amplitude", math.inf, "a finite number, got inf"),
        ("sine[1].angular_frequency", -1.0, "0, or 1e-150 to 1e"),
        ("sine[1].angular_frequency", 0.0, "> 0, as at the start, got 0"),
        ("sine[3].angular_frequency", 1.0, "0, as at the start, got 1"),
    ],
)
def test_a_sine_is_not_tuned_to_what_it_cannot_be(name: str, value: float, rule: str) -> None:
    messages: list[str] = []
    with structure_fmu(FORCED, {**SINES, **stop(0.4, 0.6)}, messages=messages) as fmu:
        fmu.step(1.0)
        fmu.set(name, value)
        with pytest.raises(FMICallException):
            fmu.step(1.0)
    assert f"{name}: expected {rule}" in messages[-1]


# ---- what is refused ----


GOOD: Arrays = {
    "mode.angular_frequency": [0.0, 1.0, 2.0],
    "mode.contact_shape": [[1.0, 0.5, -0.5]],
    "mode.observed_shape": [1.0, 1.0, 1.0],
}
MATRIX = np.diag([0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("name", "values", "rule"),
    [
        (
            "mode.angular_frequency",
            [0.0, 2.0, 1.0],
            r"\[3\]: expected at least that of the mode before, 2, got 1",
        ),
        ("mode.angular_frequency", [-1e-200, 1.0, 2.0], r"\[1\]: expected 0, or a size of 1e-150 to 1e\+150"),
        (
            "mode.angular_frequency",
            [-1.0, -2.0, 1.0],
            r"\[2\]: expected at least that of the mode before, -1",
        ),
        ("mode.angular_frequency", [0.0, math.nan, 2.0], r"\[2\]: expected 0, or"),
        ("mode.angular_frequency", [0.0, 1.0, 1e200], r"\[3\]: expected 0, or"),
        ("mode.damping_ratio", [0.0, math.nan, 0.0], r"\[2\]: expected a finite number, got nan"),
        (
            "mode.contact_shape",
            [[0.0, 0.0, 0.0]],
            r"\[1,1:3\]: expected the shape of a contact that can move",
        ),
        ("mode.contact_shape", [[math.nan, 1.0, 0.0]], r"\[1,1:3\]: expected the shape of a contact"),
        ("mode.observed_shape", [1.0, math.inf, 0.0], r"\[2\]: expected a finite number, got inf"),
        ("mode.forcing", [math.nan, 0.0, 0.0], r"\[1\]: expected a finite number"),
        ("mode.base", [0.0, 0.0, math.nan], r"\[3\]: expected a finite number"),
        ("mode.force", [math.inf, 0.0, 0.0], r"\[1\]: expected a finite number"),
        ("mode.displacement_start", [math.nan, 0.0, 0.0], r"\[1\]: expected a finite number"),
        ("mode.displacement_start", [3.0, 0.0, 0.0], r": expected a start on the free side of contact\[1\]"),
        ("mode.velocity_start", [0.0, math.inf, 0.0], r"\[2\]: expected a finite number"),
    ],
)
def test_a_bad_array_ends_initialization_with_one_line_that_names_it(
    name: str, values: Any, rule: str
) -> None:
    with structure_fmu({**GOOD, name: values}, stop(1.0), initialize=False) as fmu:
        with pytest.raises(FMICallException):
            fmu.initialize()
        (message,) = fmu.messages
        assert "\n" not in message
        assert re.search(name.replace(".", r"\.") + rule, message)


@pytest.mark.parametrize(
    ("place", "value", "rule"),
    [
        ((0, 1), 0.05, r"mode\.damping\[2,1\]: expected that of \[1,2\]"),
        ((2, 0), math.nan, r"mode\.damping\[3,1\]: expected a finite number"),
    ],
)
def test_a_bad_matrix_is_refused_where_it_is_read(place: tuple[int, int], value: float, rule: str) -> None:
    matrix = MATRIX.copy()
    matrix[place] = value
    with structure_fmu({**GOOD, "mode.damping": matrix}, coupled=True, initialize=False) as fmu:
        with pytest.raises(FMICallException, match="ExitInitializationMode"):
            fmu.initialize()
        assert re.search(rule, fmu.messages[0])
    with structure_fmu({**GOOD, "mode.damping": matrix}) as fmu:
        fmu.step(1.0)
