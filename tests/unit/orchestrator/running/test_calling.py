"""A scene as a function: its arrays equal those of runs and campaigns, and it refuses the same values."""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
import threading
from typing import Any

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.many_points.one_point import NOT_OF_THE_MOTION

FREQUENCY, RESTITUTION = "forcing.angular_frequency", "stop[1].restitution"
TABLES: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "forcing": {"amplitude": 1.0, "angular_frequency": 0.9},
    "stop": [{"position": 1.0, "restitution": 0.7}],
    "record": {"transient_periods": 3, "recorded_periods": 4},
}
BEAM = {"kind": "beam", "length": 1.0, "mass_per_length": 1.0, "flexural_rigidity": 2.0, "modes": 3}
CHAIN = {"kind": "chain", "masses": [1.0, 2.0], "stiffnesses": 5.0}
SERIES = {"rate": 20, "variables": ["displacement", "velocity"]}
SENSED = {"rate": 50, "variables": ["sensor.displacement"]}
KELVIN_VOIGT = {"law": "kelvin_voigt", "position": 0.5, "stiffness": 50.0, "damping": 0.5}
FREE = {"recorded_time": 5.0}


def scene_of(**tables: Any) -> vi.Scene:
    document = {**TABLES, **tables}
    return vi.Scene.from_dict({name: table for name, table in document.items() if table is not None})


SCENES = {
    "oscillator": (scene_of(), [FREQUENCY, RESTITUTION], [1.1, 0.4]),
    "amplitude": (scene_of(), ["forcing.amplitude", "stop[1].position"], [2.0, 0.8]),
    "mass, which changes the damping": (scene_of(), ["body.mass", "body.damping_ratio"], [1.3, 0.1]),
    "base": (
        scene_of(forcing={"kind": "base_acceleration", "amplitude": 1.0, "angular_frequency": 0.9}),
        ["forcing.amplitude", "body.mass"],
        [2.0, 1.5],
    ),
    "two stops": (
        scene_of(stop=[TABLES["stop"][0], {"position": -0.8, "side": "lower", "restitution": 0.9}]),
        ["stop[2].restitution"],
        [0.3],
    ),
    "yielding": (scene_of(stop=[KELVIN_VOIGT]), ["stop[1].stiffness"], [80.0]),
    "no stop": (scene_of(stop=None), [FREQUENCY], [1.2]),
    "free": (scene_of(forcing=None, record=FREE), ["body.displacement_start"], [0.9]),
    "rests": (
        scene_of(forcing={"amplitude": 3.0, "angular_frequency": 0.0}, record=FREE),
        [RESTITUTION],
        [0.1],
    ),
    "bare record": (
        scene_of(record={**TABLES["record"], "impacts": False, "strobe": False}),
        [FREQUENCY],
        [0.8],
    ),
    "one value for all periods": (
        scene_of(record={**TABLES["record"], "each_period": False}),
        [FREQUENCY],
        [0.8],
    ),
    "chain": (
        scene_of(body=CHAIN, forcing={"amplitude": [1.0, 0.5], "angular_frequency": 0.9}),
        ["body.masses[2]", FREQUENCY],
        [2.5, 0.8],
    ),
    "beam": (scene_of(body=BEAM), ["body.length"], [1.2]),
    "samples": (scene_of(record={**TABLES["record"], "time_series": SERIES}), [FREQUENCY], [0.8]),
    "coupled": (scene_of(execution={"how": "coupled"}), [RESTITUTION], [0.5]),
    "guarded": (scene_of(execution={"how": "coupled", "guard": True}), [RESTITUTION], [0.5]),
    "deadline": (scene_of(execution={"deadline": 100.0}), [RESTITUTION], [0.5]),
}


def assert_arrays_are_those_of(found: dict[str, Any], expected: xr.Dataset) -> None:
    assert set(found) == set(map(str, expected.data_vars)) - {*NOT_OF_THE_MOTION, *made_when_opened(expected)}
    for name, array in found.items():
        values, own = expected[name].values, np.asarray(array)
        assert own.shape == values.shape, name
        if name == "message":
            assert own.tolist() == values.tolist()
        else:
            assert (own.dtype, own.tobytes()) == (values.dtype, values.tobytes()), name


def made_when_opened(dataset: xr.Dataset) -> set[str]:
    return {str(name) for name in dataset.data_vars if str(name).endswith("_run")} | {
        "run_id",
        "displacement_range",
    }


@pytest.mark.parametrize("name", SCENES)
def test_one_point_is_the_run_of_its_scene_and_many_are_a_sweep_over_them(name: str) -> None:
    scene, keys, values = SCENES[name]
    with vi.runner(scene, keys) as motion:
        found, again = motion(values), motion(np.array(values))
        expected = vi.run(scene.with_values(dict(zip(keys, values, strict=True))), progress=False)
        assert_arrays_are_those_of(found, expected)
        assert_arrays_are_those_of(again, expected)
        points = np.array([values, [scene.value(key) for key in keys]])
        axes = {
            key: {"values": column, "zip": "p"} for key, column in zip(keys, points.T.tolist(), strict=True)
        }
        axes = axes if len(keys) > 1 else {keys[0]: points[:, 0]}
        many, sweep = motion(points), vi.run(scene.with_sweep(axes), progress=False)
        assert_arrays_are_those_of(many, in_order_of_runs(sweep))


def in_order_of_runs(sweep: xr.Dataset) -> xr.Dataset:
    """Return a sweep along one dimension in the order of its runs; a file has its single key ascending."""
    return sweep.isel({sweep.run_id.dims[0]: np.argsort(sweep.run_id.values)})


def test_the_order_of_calls_makes_no_difference() -> None:
    points = [[0.9, 0.7], [1.3, 0.2], [0.7, 0.9], [0.9, 0.7]]
    with vi.runner(scene_of(), [FREQUENCY, RESTITUTION]) as motion:
        found = [motion(point)["impact_time"].tobytes() for point in points]
        backwards = [motion(point)["impact_time"].tobytes() for point in reversed(points)]
    assert found == backwards[::-1]
    assert found[0] == found[3] != found[1]


def test_what_one_call_gave_is_not_changed_by_the_next() -> None:
    with vi.runner(scene_of(), FREQUENCY) as motion:
        first = motion(0.9)
        kept = {name: np.array(array) for name, array in first.items()}
        motion(1.3)
        motion([[1.3], [0.7]])
    for name, array in first.items():
        assert np.array_equal(np.asarray(array), kept[name], equal_nan=name != "message"), name


def refusal_of_sweep(scene: vi.Scene, key: str, value: float) -> str:
    with pytest.raises(vi.VibroimpactError) as refused:
        scene.with_sweep({key: [value]})
    return str(refused.value)


@pytest.mark.parametrize("value", [1.2, -0.1, math.nan, math.inf])
def test_a_bad_value_is_refused_as_by_a_sweep_and_the_next_call_goes_on(value: float) -> None:
    scene = scene_of()
    with vi.runner(scene, RESTITUTION) as motion:
        before = motion(0.5)["impact_time"]
        for given in (value, [value], [[0.5], [value]]):
            with pytest.raises(vi.VibroimpactError) as refused:
                motion(given)
            expected = refusal_of_sweep(scene, RESTITUTION, value)
            assert str(refused.value).replace("values[2]", "values[1]") == expected
        assert motion(0.5)["impact_time"].tobytes() == before.tobytes()


def test_rules_between_keys_are_those_of_a_sweep() -> None:
    scene = scene_of(stop=[TABLES["stop"][0], {"position": -0.8, "side": "lower", "restitution": 0.9}])
    with vi.runner(scene, "stop[1].position") as motion:
        motion(0.5)
        with pytest.raises(vi.VibroimpactError) as refused:
            motion(-1.0)
    assert str(refused.value) == refusal_of_sweep(scene, "stop[1].position", -1.0)


def test_what_a_body_refuses_is_an_outcome_with_the_message_of_its_run() -> None:
    scene = scene_of()
    with vi.runner(scene, FREQUENCY) as motion:
        found = motion(1e-308)
        expected = vi.run(scene.with_values({FREQUENCY: 1e-308}), progress=False)
        assert (found["outcome"], found["message"]) == (3, str(expected.message.values))
        assert "expected a period" in found["message"]
        assert motion(0.9)["outcome"] == 0


@pytest.mark.parametrize(
    ("values", "shape"),
    [
        (1.0, "()"),
        ([1.0], "(1,)"),
        ([1.0] * 3, "(3,)"),
        ([[1.0]], "(1, 1)"),
        ([], "(0,)"),
        ([[[0.9, 0.7]]], "(1, 1, 2)"),
    ],
)
def test_another_shape_is_refused_with_the_shape_that_is_expected(values: Any, shape: str) -> None:
    with (
        vi.runner(scene_of(), [FREQUENCY, RESTITUTION]) as motion,
        pytest.raises(vi.VibroimpactError) as refused,
    ):
        motion(values)
    expected = "expected shape (2,) of one point, or (point, 2) of some"
    assert str(refused.value) == f"values: {expected}, for {FREQUENCY}, {RESTITUTION}, got {shape}."


@pytest.mark.parametrize("values", ["0.9", None, [0.9, "a"], [[0.9, 0.7], [0.9]]])
def test_what_is_no_number_is_refused(values: Any) -> None:
    with vi.runner(scene_of(), [FREQUENCY, RESTITUTION]) as motion, pytest.raises(vi.VibroimpactError):
        motion(values)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ([], "expected different keys"),
        ([FREQUENCY, FREQUENCY], "expected different keys"),
        ("stop[3].restitution", "expected a number of this scene, got nothing"),
        ("body.kind", "expected a numeric key"),
        ("record.recorded_periods", "key"),
        ("nothing", "key"),
    ],
)
def test_a_key_that_cannot_be_varied_is_refused_when_it_is_opened(keys: Any, words: str) -> None:
    with pytest.raises(vi.VibroimpactError, match=words):
        vi.runner(scene_of(), keys)


def test_the_sweep_of_a_scene_is_left_out() -> None:
    scene = scene_of().with_sweep({FREQUENCY: [0.8, 0.9]})
    with vi.runner(scene, FREQUENCY) as motion:
        assert motion(0.9)["displacement_max"].shape == (4,)


def test_it_pickles_into_another_process() -> None:
    motion = vi.runner(scene_of(), [FREQUENCY, RESTITUTION])
    found = motion([1.1, 0.4])["impact_time"].tobytes().hex()
    code = (
        "import pickle, sys; motion = pickle.loads(sys.stdin.buffer.read()); "
        "print(motion([1.1, 0.4])['impact_time'].tobytes().hex())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps(motion), capture_output=True, check=True
    )
    assert done.stdout.decode().strip() == found
    motion.close()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_fork_opens_its_own() -> None:
    with vi.runner(scene_of(), FREQUENCY) as motion:
        expected = motion(1.1)["impact_time"].tobytes()
        pid = os.fork()
        if pid == 0:
            os._exit(0 if motion(1.1)["impact_time"].tobytes() == expected else 1)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
        assert motion(1.1)["impact_time"].tobytes() == expected


def test_a_second_thread_in_a_call_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    # a scene with samples runs alone
    scene = scene_of(record={**TABLES["record"], "time_series": SERIES})
    inside, over, results = threading.Event(), threading.Event(), []
    run = PointRunner.run

    def waiting(runner: PointRunner, *arguments: Any) -> Any:
        inside.set()
        over.wait(30.0)
        return run(runner, *arguments)

    monkeypatch.setattr(PointRunner, "run", waiting)
    with vi.runner(scene, FREQUENCY) as motion:
        thread = threading.Thread(target=lambda: results.append(motion(0.9)))
        thread.start()
        assert inside.wait(30.0)
        with pytest.raises(vi.VibroimpactError, match="Make one for each thread"):
            motion(0.9)
        over.set()
        thread.join()
    assert results[0]["outcome"] == 0


def test_a_closed_one_is_refused() -> None:
    motion = vi.runner(scene_of(), FREQUENCY)
    motion.close()
    motion.close()
    with pytest.raises(vi.VibroimpactError, match="got one that was closed"):
        motion(0.9)


def test_ctrl_c_in_a_call_leaves_one_that_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    from vibroimpact.orchestrator.run.many_points.loop_rows import LoopArrays

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with vi.runner(scene_of(), FREQUENCY) as motion:
        expected = motion(1.1)["impact_time"].tobytes()
        with monkeypatch.context() as patch:
            patch.setattr(LoopArrays, "call", interrupted)
            with pytest.raises(KeyboardInterrupt):
                motion(0.9)
        assert motion(1.1)["impact_time"].tobytes() == expected
