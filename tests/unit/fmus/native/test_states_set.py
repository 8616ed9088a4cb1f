"""States of model exchange can be set one by one: CasADi and PyFMI compute their Jacobians this way."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.integrated import Integrated

from vibroimpact.fmus.packaging.export import export_fmu

VERSIONS = ("2.0", "3.0")
MASSES = 12
DASHPOT = 3e5
"""Damping coefficient of the stiff chain, N.s/m: its fastest mode decays in a microsecond."""
CHAIN = {
    **{f"mass[{k}]": 1.0 + 0.1 * k for k in range(1, MASSES + 1)},
    **{f"stiffness[{k}]": 1000.0 for k in range(1, MASSES + 1)},
    **{f"damping[{k}]": DASHPOT for k in range(1, MASSES + 1)},
}


def running(component: str, version: str, folder: Path, **options: Any) -> Integrated:
    """Return an export in continuous-time mode."""
    path = export_fmu(component, folder / f"{component}.fmu", fmi=version, **options)
    it = Integrated(component.capitalize(), version, path)
    it.begin()
    return it


def states_of(it: Integrated) -> list[str]:
    """Return the names of its states, in their order."""
    return [unknown.variable.derivative.name for unknown in it.description.derivatives]


def jacobian(it: Integrated, states: NDArray[np.float64], move: Callable[[int, float], None]) -> NDArray[Any]:
    """Return the Jacobian of the derivatives by differences; `move` sets one state to another value."""
    columns = []
    for place, value in enumerate(states):
        found = []
        for sign in (1.0, -1.0):
            it.move(0.0, *states)
            move(place, value + sign * 1e-3)
            found.append(np.array(it.derivatives(states.size)))
        columns.append((found[0] - found[1]) / 2e-3)
    return np.array(columns).T


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("component", "options"),
    [("oscillator", {}), ("chain", {"masses": MASSES, "starts": CHAIN}), ("beam", {"modes": 5})],
)
def test_a_jacobian_by_single_states_is_that_by_all_states(
    tmp_path: Path, component: str, options: dict[str, Any], version: str
) -> None:
    it = running(component, version, tmp_path, **options)
    names = states_of(it)
    states = 0.01 * np.cos(np.arange(len(names)))

    def move_all(place: int, value: float) -> None:
        moved = states.copy()
        moved[place] = value
        it.move(0.0, *moved)

    one, all_at_once = (
        jacobian(it, states, move) for move in (lambda place, value: it.set({names[place]: value}), move_all)
    )
    assert np.abs(all_at_once).max() > 1.0 or component == "oscillator"
    np.testing.assert_allclose(one, all_at_once, rtol=1e-9, atol=1e-9 * np.abs(all_at_once).max())


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_is_read_as_it_was_set_and_the_others_stay(tmp_path: Path, version: str) -> None:
    it = running("chain", version, tmp_path, masses=3)
    it.move(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    it.set({"displacement[2]": -2.0, "velocity[3]": -6.0})
    assert it.numbers("getContinuousStates", 6) == pytest.approx([1.0, -2.0, 3.0, 4.0, 5.0, -6.0])
    assert it.get("displacement[2]") == pytest.approx(-2.0)
    assert it.get("velocity[3]") == it.get("der(displacement[3])") == pytest.approx(-6.0)


@pytest.mark.parametrize("version", VERSIONS)
def test_states_are_set_in_continuous_time_mode_alone(tmp_path: Path, version: str) -> None:
    path = export_fmu("oscillator", tmp_path / "o.fmu", fmi=version)
    it = Integrated("Oscillator", version, path)
    assert "cannot be set" in it.message(it.set, {"velocity": 1.0})
    it.begin()
    it.set({"velocity": 1.0})
    assert it.numbers("getContinuousStates", 2)[1] == 1.0
    assert "cannot be set" in it.message(it.set, {"acceleration": 1.0})
    it.fmu.enterEventMode()
    assert "cannot be set" in it.message(it.set, {"velocity": 2.0})
    stepped = Integrated("Oscillator", version, path, "CoSimulation")
    stepped.fmu.exitInitializationMode()
    assert "cannot be set" in stepped.message(stepped.set, {"velocity": 1.0})


@pytest.mark.parametrize("version", VERSIONS)
def test_states_that_are_not_finite_are_discarded_however_they_were_set(tmp_path: Path, version: str) -> None:
    it = running("oscillator", version, tmp_path)
    it.set({"velocity": math.nan})
    it.message(it.derivatives, 2)
    it.set({"velocity": 0.5})
    assert it.derivatives(2)[0] == 0.5


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("component", ["Oscillator", "Chain", "Beam", "Structure"])
def test_no_variable_is_a_state_and_the_derivative_of_another(component: str, version: str) -> None:
    it = Integrated(component, version)
    derivatives = [unknown.variable.name for unknown in it.description.derivatives]
    states = states_of(it)
    assert len(derivatives) == len(states) == len({*derivatives, *states}) // 2
    half = len(states) // 2
    assert all(name == f"der({state})" for name, state in zip(derivatives[:half], states, strict=False))
    # displacements first, then velocities, in the same order
    assert [name.replace("displacement", "velocity") for name in states[:half]] == states[half:]
    causalities = {v.name: v.causality for v in it.description.modelVariables}
    assert {causalities[name] for name in derivatives} == {"local"}
