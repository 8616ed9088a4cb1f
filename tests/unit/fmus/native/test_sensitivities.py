"""Derivatives since the start, through impacts: against 40 digits, differences, and where there are none."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from support.component_fmu import (
    HERTZ,
    HUNT_CROSSLEY,
    KELVIN_VOIGT,
    LOWER,
    VERSIONS,
    ComponentFmu,
    forced,
    stop,
)

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.export import export_fmu

KEYS = {
    "Oscillator": (
        "stop[1].restitution",
        "contact[1].position",
        "contact[1].stiffness",
        "contact[1].damping",
        "forcing.amplitude",
        "forcing.phase",
        "forcing.angular_frequency",
        "mass",
        "damping",
        "stiffness",
        "displacement_start",
        "velocity_start",
    ),
    "Chain": (
        "contact[1].restitution",
        "contact[1].position",
        "contact[1].stiffness",
        "contact[2].position",
        "mass[1]",
        "mass[3]",
        "damping[2]",
        "stiffness[1]",
        "stiffness[3]",
        "far_stiffness",
        "forcing.amplitude[2]",
        "displacement_start[3]",
        "velocity_start[1]",
    ),
    "Beam": (
        "contact[1].restitution",
        "contact[1].position",
        "contact[1].stiffness",
        "damping_ratio[2]",
        "forcing.amplitude",
        "modal_displacement_start[1]",
    ),
    "Structure": ("contact[1].restitution", "contact[1].position", "forcing.amplitude", "forcing.phase"),
}
COUNTS: dict[str, dict[str, Any]] = {"Chain": {"masses": 3}, "Beam": {"modes": 4}}
MOVING = {"forcing.angular_frequency": 1.3, "forcing.amplitude": 0.5}
OSCILLATOR = {**forced(0.5, 1.3), "displacement_start": -0.1, "velocity_start": 0.2}
CHAIN = {
    "forcing.angular_frequency": 1.3,
    "forcing.amplitude[1]": 0.1,
    "forcing.amplitude[2]": 0.7,
    "displacement_start[1]": 0.0,
    "displacement_start[3]": -0.1,
    "velocity_start[1]": 0.3,
    "mass[1]": 1.1,
    "mass[2]": 0.9,
    "mass[3]": 1.3,
    "damping[2]": 0.05,
    "stiffness[1]": 1.0,
    "stiffness[2]": 2.0,
    "stiffness[3]": 1.5,
    "far_stiffness": 0.3,
}
BEAM = {"forcing.angular_frequency": 150.0, "forcing.amplitude": 0.2, "modal_displacement_start[1]": -0.001}
BEAM |= {f"damping_ratio[{k}]": 0.02 for k in range(1, 5)}


@pytest.fixture(scope="session")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a function that returns an export with the derivatives over all keys of a component, written once."""
    folder = tmp_path_factory.mktemp("followed")

    @cache
    def write(component: str, version: str = "3.0") -> Path:
        return export_fmu(
            component,
            folder / f"{component}-{version}.fmu",
            fmi=version,
            contacts=2,
            starts=MOVING if component != "Chain" else {"forcing.angular_frequency": 1.3},
            stop_time=0.01,
            sensitivities=",".join(KEYS[component]),
            **COUNTS.get(component, {}),
        )

    return write


def outputs_at(
    fmu: Path, given: Mapping[str, float], ends: Sequence[float], names: Sequence[str], version: str = "3.0"
) -> tuple[list[float], list[int]]:
    with ComponentFmu(fmu, given, version=version) as it:
        for end in ends:
            it.advance(end)
        return [it.get(name) for name in names], [it.get(f"contact[{k}].count") for k in (1, 2)]


def check(
    fmu: Path,
    given: Mapping[str, float],
    keys: Sequence[str],
    ends: Sequence[float],
    names: Sequence[str] = ("displacement", "velocity", "acceleration"),
    *,
    close: float = 1e-6,
    step: float = 1e-5,
    version: str = "3.0",
) -> list[int]:
    """Compare derivatives with differences of runs; return the counts of both contacts."""
    values, counts = outputs_at(
        fmu, given, ends, [f"sensitivity.{name}.{key}" for key in keys for name in names], version
    )
    found = dict(zip(keys, np.reshape(values, (len(keys), len(names))), strict=True))
    with ComponentFmu(fmu, given, version=version) as it:
        begun = {key: it.get(key.replace("stop[", "contact[")) for key in keys}
    for key in keys:
        own, runs = key.replace("stop[", "contact["), {}
        size = step * max(abs(begun[key]), 0.1)
        for place in (-1, 1):
            changed = {**given, own: begun[key] + place * size}
            runs[place], other = outputs_at(fmu, changed, ends, names, version)
            assert other == counts
        expected = (np.array(runs[1]) - np.array(runs[-1])) / (2.0 * size)
        scale = max(np.abs(expected).max(), np.abs(found[key]).max(), 1e-3)
        assert np.abs(found[key] - expected).max() <= close * scale, key
    return counts


def keys_of(component: str, *left_out: str) -> list[str]:
    return [key for key in KEYS[component] if not any(part in key for part in left_out)]


# ---- against differences ----


@pytest.mark.parametrize("version", VERSIONS)
def test_derivatives_pass_rigid_impacts_on_both_sides(followed: Callable[..., Path], version: str) -> None:
    given = {**OSCILLATOR, **stop(0.3, 0.7), **stop(-0.35, 0.6, side=LOWER, k=2)}
    given |= {"contact[1].yield_velocity": 0.1, "force": 0.02, "base_acceleration": 0.01}
    names = ["displacement", "velocity", "acceleration"]
    keys = keys_of("Oscillator", "].stiffness", "].damping")
    counts = check(followed("Oscillator", version), given, keys, [3.0, 9.0], names, version=version)
    assert min(counts) >= 2


@pytest.mark.parametrize(
    "law",
    [
        stop(0.3, law=KELVIN_VOIGT, stiffness=50.0, damping=0.7),
        stop(0.3, law=HERTZ, stiffness=500.0),
        pytest.param(
            stop(0.3, law=HUNT_CROSSLEY, stiffness=500.0, damping=0.3, exponent=1.7), marks=pytest.mark.long
        ),
    ],
    ids=["kelvin_voigt", "hertz", "hunt_crossley"],
)
@pytest.mark.parametrize("end", [1.15, 9.0])
def test_derivatives_pass_touches_and_separations(
    followed: Callable[..., Path], law: dict[str, float], end: float
) -> None:
    given = {**OSCILLATOR, **law, "contact_tolerance": 1e-13}
    keys = keys_of("Oscillator", "restitution", *(["].damping"] if law["contact[1].law"] == HERTZ else []))
    names = ["displacement", "velocity", "contact[1].force"]
    counts = check(followed("Oscillator"), given, keys, [0.5 * end, end], names, step=1e-4)
    assert counts[0] == (1 if end < 2.0 else 2)


def test_derivatives_of_a_chain_pass_impacts_of_one_mass(followed: Callable[..., Path]) -> None:
    given = {**CHAIN, **stop(0.25, 0.7), "contact[1].mass_number": 2}
    names = ["displacement[1]", "velocity[2]", "acceleration[3]"]
    keys = keys_of("Chain", "contact[1].stiffness", "contact[2]")
    counts = check(followed("Chain"), given, keys, [4.0, 8.0], names)
    assert counts[0] >= 1


def test_derivatives_of_a_beam_pass_impacts(followed: Callable[..., Path]) -> None:
    given = {**BEAM, **stop(0.0004, 0.6)}
    keys = keys_of("Beam", "].stiffness")
    counts = check(
        followed("Beam"), given, keys, [0.05, 0.1], ["displacement", "velocity"], step=1e-7, close=1e-5
    )
    assert counts[0] >= 2


# ---- rest ----


def test_derivatives_pass_chatter_rest_and_release(followed: Callable[..., Path]) -> None:
    given = {**forced(0.5, 0.4), **stop(0.05, 0.5), "force": 0.3, "displacement_start": -0.1}
    keys = keys_of("Oscillator", "].stiffness", "].damping")
    rests, leaves = 4.0, 7.5
    with ComponentFmu(followed("Oscillator"), given) as it:
        it.advance(rests)
        assert it.get("contact[1].stuck")
        assert it.get("contact[1].count") > 10
        assert it.get("sensitivity.displacement.contact[1].position") == pytest.approx(1.0, abs=1e-13)
        assert abs(it.get("sensitivity.velocity.mass")) <= 1e-13
        assert it.get("sensitivity.contact[1].force.contact[1].position") == pytest.approx(-1.0, abs=1e-12)
        it.advance(leaves)
        assert not it.get("contact[1].stuck")
    check(followed("Oscillator"), given, keys, [rests, leaves], step=1e-3, close=1e-5)


def test_a_chain_that_chatters_keeps_the_derivatives_of_its_other_masses(
    followed: Callable[..., Path],
) -> None:
    given = {**CHAIN, **stop(0.1, 0.4), "contact[1].mass_number": 3, "force[3]": 1.5}
    given |= {"forcing.angular_frequency": 0.2}
    with ComponentFmu(followed("Chain"), given) as it:
        it.advance(6.0)
        assert it.get("contact[1].stuck")
        # the impulses of the chatter depend on its start: the other masses know of it
        assert it.get("sensitivity.velocity[1].contact[1].restitution") != 0.0
    keys = ["contact[1].restitution", "contact[1].position", "mass[1]", "stiffness[1]", "velocity_start[1]"]
    check(followed("Chain"), given, keys, [6.0], ["displacement[1]", "velocity[2]"], step=1e-4, close=1e-5)


# ---- against 40 digits ----


def exact_run(given: Mapping[str, Any], end: Any) -> tuple[Any, Any]:
    """Return the motion at `end` of an oscillator of mass 1 with one upper stop, from its closed form, in 40 digits."""
    mp = mpmath.mp
    zeta, amplitude, w = given["damping"] / 2, given["amplitude"], given["frequency"]
    k = given["stiffness"]
    damped, split = mpmath.sqrt(k - zeta**2), (k - w**2) ** 2 + (2 * zeta * w) ** 2
    steady = amplitude * (k - w**2) / split, amplitude * 2 * zeta * w / split

    def motion(t: Any, x: Any, v: Any) -> Callable[[Any], tuple[Any, Any]]:
        a = x - steady[0] * mpmath.cos(w * t) - steady[1] * mpmath.sin(w * t)
        b = v - w * (steady[1] * mpmath.cos(w * t) - steady[0] * mpmath.sin(w * t)) + zeta * a

        def at(s: Any) -> tuple[Any, Any]:
            u, c, n = s - t, mpmath.cos(damped * (s - t)), mpmath.sin(damped * (s - t))
            decay = mpmath.exp(-zeta * u)
            free = decay * (a * c + b / damped * n)
            rate = decay * (b * c - a * damped * n) - zeta * free
            return (
                free + steady[0] * mpmath.cos(w * s) + steady[1] * mpmath.sin(w * s),
                rate + w * (steady[1] * mpmath.cos(w * s) - steady[0] * mpmath.sin(w * s)),
            )

        return at

    t, x, v, place = mp.mpf(0), given["x"], given["v"], given["position"]
    for guess in [*given["guesses"], None]:
        at = motion(t, x, v)
        if guess is None:
            return at(end)
        t = mpmath.findroot(lambda s, at=at: at(s)[0] - place, guess)
        x, v = place, -given["restitution"] * at(t)[1]
    raise AssertionError


@pytest.mark.parametrize("nearness", [0.0, 1e-3, 1e-5])
def test_derivatives_are_right_to_10_digits_also_near_a_graze(
    followed: Callable[..., Path], nearness: float
) -> None:
    """The last impact comes close to a graze: its derivatives grow like 1 / v, and lose the digits of v alone."""
    given = {**OSCILLATOR, **stop(0.3, 0.7)}
    keys = {
        "contact[1].restitution": "restitution",
        "contact[1].position": "position",
        "stiffness": "stiffness",
    }
    keys |= {"forcing.amplitude": "amplitude", "forcing.angular_frequency": "frequency", "damping": "damping"}
    end = 3.0
    if nearness:  # a stop just below the first crest
        with ComponentFmu(followed("Oscillator"), {**given, "contact[1].law": 0}) as it:
            crest = max((it.advance(0.001 * n).get("displacement"), it.time) for n in range(1, 3000))
        given["contact[1].position"] = crest[0] * (1.0 - nearness)
    with ComponentFmu("Oscillator", given) as it:
        it.advance(end)
        assert it.get("contact[1].count") == 1
        guess, speed = it.get("contact[1].last_time"), it.get("contact[1].last_velocity")
    with ComponentFmu(followed("Oscillator"), given) as it:
        it.advance(end)
        found = {key: it.get(f"sensitivity.displacement.{_own(key)}") for key in keys}
    with mpmath.workdps(60):
        mp = mpmath.mp
        base = {"restitution": 0.7, "position": given["contact[1].position"], "stiffness": 1.0}
        base |= {"amplitude": 0.5, "frequency": 1.3, "damping": given["damping"]}
        start = {name: mp.mpf(value) for name, value in base.items()}
        start |= {"x": mp.mpf(-0.1), "v": mp.mpf(0.2), "guesses": [mp.mpf(guess)]}
        h = mp.mpf(10) ** -20
        for key, name in keys.items():
            up, down = (
                exact_run({**start, name: start[name] + sign * h}, mp.mpf(end))[0] for sign in (1, -1)
            )
            expected = (up - down) / (2 * h)
            assert abs(found[key] - expected) <= (1e-11 + 1e-14 / speed**2) * max(abs(expected), 1e-2), key
    if nearness:
        assert abs(found["contact[1].position"]) > 0.1 / speed
        assert speed < 2.0 * math.sqrt(nearness)


def _own(key: str) -> str:
    return "stop[1].restitution" if key == "contact[1].restitution" else key


# ---- where there are none, and what is not paid ----


def test_a_start_on_the_stop_and_a_changed_frequency_have_no_derivative(
    followed: Callable[..., Path],
) -> None:
    given = {**OSCILLATOR, **stop(-0.1, 0.7)}
    with ComponentFmu(followed("Oscillator"), given) as it:
        it.advance(1.0)
        assert math.isnan(it.get("sensitivity.displacement.contact[1].position"))
        assert math.isfinite(it.get("sensitivity.displacement.stop[1].restitution"))
    with ComponentFmu(followed("Oscillator"), OSCILLATOR) as it:
        it.advance(1.0)
        it.set("forcing.angular_frequency", 1.5)
        it.advance(2.0)
        assert math.isnan(it.get("sensitivity.velocity.forcing.angular_frequency"))
        assert math.isfinite(it.get("sensitivity.velocity.forcing.amplitude"))


def test_a_saved_state_has_the_derivatives(followed: Callable[..., Path]) -> None:
    given, name = {**OSCILLATOR, **stop(0.3, 0.7)}, "sensitivity.displacement.mass"
    with ComponentFmu(followed("Oscillator"), given) as it:
        it.advance(2.0)
        data, time = it.serialized(), it.time
        ends = [it.advance(7.0).get(name)]
        it.restore(data)
        it.time = time
        ends.append(it.advance(7.0).get(name))
    assert ends[0] == ends[1]


def test_results_are_the_same_bits_with_and_without(followed: Callable[..., Path]) -> None:
    given = {**OSCILLATOR, **stop(0.3, 0.7), **stop(-0.35, law=KELVIN_VOIGT, stiffness=9.0, side=LOWER, k=2)}
    runs = [
        outputs_at(fmu, given, [0.7, 5.0, 30.0], ["displacement", "velocity", "contact[1].impulse"])
        for fmu in (followed("Oscillator"), fmu_path("Oscillator", "3.0"))
    ]
    assert runs[0] == runs[1]


def test_setups_without_derivatives_are_refused(followed: Callable[..., Path]) -> None:
    for given, reason in (
        ({"amplitude.frequency_slope": 0.1}, "modes that do not follow the amplitude"),
        (
            {"contact[1].law": KELVIN_VOIGT, "contact[1].stiffness": 1.0, "contact[1].relaxation_time": 0.1},
            "relax",
        ),
        ({"forcing.angular_frequency": 0.0}, "forcing.angular_frequency > 0"),
    ):
        it = ComponentFmu(followed("Oscillator"), given, initialize=False)
        with pytest.raises(FMICallException):
            it.initialize()
        assert reason in it.messages[-1]
        it.free()


@pytest.mark.parametrize(
    ("component", "names", "reason"),
    [
        ("Oscillator", "restitution", "sensitivities: restitution: expected a parameter"),
        ("Oscillator", "contact[1].restitutoin", "Did you mean contact[1].restitution?"),
        ("Oscillator", "impact_limit", "expected a parameter over which the body has derivatives"),
        ("Oscillator", "mass,mass", "expected each parameter once"),
        ("Oscillator", "contact[3].position", "expected a parameter"),
        ("Oscillator", "", "sensitivities: : expected"),
        ("Beam", "length", "expected a parameter"),
        ("Gain", "gain", "expected a parameter"),
        ("Chain", "mass[1]", "at most 16 parameters and 512 outputs"),
    ],
)
def test_other_keys_are_refused_by_name(tmp_path: Path, component: str, names: str, reason: str) -> None:
    counts: dict[str, Any] = {"masses": 64, "contacts": 8} if component == "Chain" else {}
    if component == "Chain":
        names = ",".join(f"mass[{k}]" for k in range(1, 17))
    with pytest.raises(UsageError, match=r".*") as error:
        export_fmu(component, tmp_path / "it.fmu", sensitivities=names, **counts)
    assert reason in str(error.value)
