"""The controller's FMU alone, with impacts reported by FMPy: its answers follow its plan."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave

from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.python_fmus import build_orbit_controller

pytest.importorskip("pythonfmu")

FREQUENCIES = (2.0, 1.9, 1.8)
TURN = 6.283185307179586


def plan(law: str = "ogy", **changes: Any) -> dict[str, Any]:
    rows = [
        {
            "angular_frequency": frequency,
            "phase": 0.3,
            "velocity": 1.0,
            "gain_time": 0.2,
            "gain_velocity": 0.05,
            "jacobian": [[-1.2, 0.1], [0.3, 0.2]],
            "response": [0.4, -0.7],
        }
        for frequency in FREQUENCIES
    ]
    return {
        "law": law,
        "periods": 1,
        "amplitude": 5.0,
        "tolerance": 1e-3,
        "limit": 0.5,
        "stay": 1,
        "rows": rows,
        **changes,
    }


class Controller:
    """An instance made with FMPy's own class."""

    def __init__(self, path: Path, **parameters: Any) -> None:
        fmu = unpack(path)
        description = read_model_description(str(fmu.folder))
        self._variables = {v.name: v for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(fmu.folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="it",
        )
        self.fmu.instantiate()
        for name, value in parameters.items():
            self.set(name, value)
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def set(self, name: str, value: float) -> None:
        variable = self._variables[name]
        getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [value])

    def get(self, name: str) -> Any:
        variable = self._variables[name]
        return getattr(self.fmu, f"get{variable.type}")([variable.valueReference])[0]

    def impact(self, count: int, time: float, phase: float, velocity: float) -> tuple[float, float]:
        """Report an impact; return the force that the controller answers."""
        for name, value in {
            "count": count,
            "last_time": time,
            "last_phase": phase,
            "last_velocity": velocity,
        }.items():
            self.set(name, value)
        return self.get("forcing_amplitude"), self.get("forcing_angular_frequency")


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Controller]:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))
    built: dict[str, Path] = {}

    def make(chosen: dict[str, Any], **parameters: Any) -> Controller:
        path = built.setdefault(repr(chosen), tmp_path / f"controller_{len(built)}.fmu")
        return Controller(path if path.exists() else build_orbit_controller(chosen, path), **parameters)

    return make


def test_it_is_a_good_fmu_and_equal_plans_make_equal_files(tmp_path: Path) -> None:
    one, other = (build_orbit_controller(plan(), tmp_path / name) for name in ("one.fmu", "other.fmu"))
    assert one.read_bytes() == other.read_bytes()
    assert check_fmu(one) == ()


def test_before_the_first_impact_the_force_is_that_of_the_plan(made: Callable[..., Controller]) -> None:
    controller = made(plan())
    assert controller.impact(0, 0.0, 0.0, 0.0) == (5.0, 2.0)
    assert controller.get("kept")


def test_the_correction_is_that_of_the_gains_up_to_its_limit(made: Callable[..., Controller]) -> None:
    controller = made(plan())
    force, frequency = controller.impact(1, 1.0, 0.3 + 0.02, 1.1)
    assert force == pytest.approx(5.0 - 0.2 * 0.01 - 0.05 * 0.1, rel=1e-14)
    assert frequency == 2.0
    # a phase on the other side of 0 is as near
    force, _ = controller.impact(2, 1.0 + 3.1, 0.3 - 0.32 + TURN, 1.0)
    assert force == pytest.approx(5.0 + 0.2 * 0.16, rel=1e-14)
    assert controller.impact(3, 7.2, 0.3, 50.0)[0] == 4.5
    assert made(plan(), active=False).impact(1, 1.0, 0.32, 1.1)[0] == 5.0


def test_the_plan_goes_on_where_two_speeds_are_one(made: Callable[..., Controller]) -> None:
    controller = made(plan())
    period = TURN / 2.0
    assert controller.impact(1, 0.0, 0.3, 1.01)[1] == 2.0
    assert controller.impact(2, period, 0.3, 1.0095)[1] == 1.9
    assert controller.get("row") == 1
    # the first speed of a row was not reached in this row
    assert controller.impact(3, 2 * period, 0.3, 1.0094)[1] == 1.8
    assert controller.impact(4, 3 * period, 0.3, 1.0094)[1] == 1.8, "there is no other row"
    patient = made(plan(stay=3))
    frequencies = [patient.impact(n, n * period, 0.3, 1.0)[1] for n in range(1, 6)]
    assert frequencies == [2.0, 2.0, 2.0, 1.9, 1.9]


def test_a_step_that_is_taken_back_and_made_again_decides_again(made: Callable[..., Controller]) -> None:
    controller = made(plan(tolerance=1e-9))
    period = TURN / 2.0
    first = controller.impact(1, 0.0, 0.31, 1.02)
    controller.impact(2, period, 0.35, 1.3)
    assert controller.impact(1, 0.0, 0.31, 1.02) == first
    again = controller.impact(2, period + 0.01, 0.33, 1.1)
    direct = made(plan(tolerance=1e-9))
    direct.impact(1, 0.0, 0.31, 1.02)
    assert direct.impact(2, period + 0.01, 0.33, 1.1) == again


@pytest.mark.parametrize(
    ("time", "phase"), [(TURN / 2.0 * 1.3, 0.3), (TURN / 2.0, 0.3 + 1.7), (TURN / 2.0 * 2.0, 0.3)]
)
def test_an_orbit_that_is_lost_is_told_and_the_force_goes_back(
    made: Callable[..., Controller], time: float, phase: float
) -> None:
    controller = made(plan())
    controller.impact(1, 0.0, 0.3, 1.1)
    assert controller.impact(2, time, phase, 1.4) == (5.0, 2.0)
    assert not controller.get("kept")
    assert controller.impact(3, time + TURN / 2.0, 0.3, 1.4) == (5.0, 2.0), "once lost is lost"


def test_an_orbit_is_located_from_the_flight_before(made: Callable[..., Controller]) -> None:
    controller = made(plan("newton", tolerance=1e-9))
    # an orbit other than the plan's: 0.01 s late, 0.02 m/s faster; the linear map gives the impacts near it
    (a, b), (c, d) = plan()["rows"][0]["jacobian"]
    response, orbit = plan()["rows"][0]["response"], (0.01, 0.02)
    away = [0.003, -0.004]
    force, _ = controller.impact(1, 0.0, 0.3 + 2.0 * (orbit[0] + away[0]), 1.0 + orbit[1] + away[1])
    push = force - 5.0
    away = [
        a * away[0] + b * away[1] + response[0] * push,
        c * away[0] + d * away[1] + response[1] * push,
    ]
    force, _ = controller.impact(2, TURN / 2.0, 0.3 + 2.0 * (orbit[0] + away[0]), 1.0 + orbit[1] + away[1])
    assert force == pytest.approx(5.0 - 0.2 * away[0] - 0.05 * away[1], rel=1e-13)


def test_noise_is_the_same_for_a_seed_and_as_large_as_it_is_said(made: Callable[..., Controller]) -> None:
    def errors(**parameters: Any) -> list[float]:
        controller = made(plan(tolerance=1e-12), noise=1e-3, **parameters)
        found = []
        for n in range(1, 400):
            # the plan has one row: an impact in between is off
            controller.impact(n, n * TURN / 2.0, 0.3, 1.0)
            found.append(-controller.get("correction") / 0.05)
        return found

    same, again, other = errors(seed=3), errors(seed=3), errors(seed=4)
    assert same == again != other
    spread = (sum(each**2 for each in same) / len(same)) ** 0.5
    assert 0.9e-3 < spread < 1.1e-3
