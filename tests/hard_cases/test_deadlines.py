"""Scenes whose single steps are long, endless or beyond the numbers: the deadline and signals still work."""

import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from harness import warm
from support.command_line import ENVIRONMENT, in_this_process
from support.places import EXAMPLES

from vibroimpact.analysis.dataset import Outcome, RunRecord, read_flat
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import Scene, parse_scene

DEADLINE = 0.3

STIFF_DASHPOT = ("thesis/figure_6_5d", {"dampings": "[1e5, 0.1]"})
STIFF_AND_PLASTIC = (
    "thesis/figure_6_5d",
    {"dampings": "[1e5, 0.1]", "restitution": "1e-3", "angular_frequency": "0.5"},
)
#: With energies, its rest is computed by series.
LIGHT_BEAM = (
    "thesis/figure_7_10",
    {
        "mass_per_length": "1e-15",
        "transient_periods": "0",
        "time_series": '{ rate = 2000.0, variables = ["energy.damping_loss"] }',
    },
)
NEAR_STOP = ("thesis/figure_6_6b", {"position": "1e-300"})
LONG_STEPS = {
    "stiff dashpot": STIFF_DASHPOT,
    "stiff dashpot, nearly plastic": STIFF_AND_PLASTIC,
    "light beam": LIGHT_BEAM,
    "stop next to the start": NEAR_STOP,
}
BEYOND_NUMBERS = {
    "large force": ("chatter", {"amplitude": "1e300"}),
    "least mass": ("thesis/figure_2_11", {"mass": "5e-324"}),
}


def changed(name: str, values: dict[str, str], execution: str) -> Scene:
    """Return an example scene with other values and the keys of `execution`."""
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    for key, value in values.items():
        text, count = re.subn(rf"^{key} = .*$", f"{key} = {value}", text, count=1, flags=re.M)
        assert count == 1, key
    return parse_scene(f"{text}\n[execution]\n{execution}\n", f"{name}.toml")


def ran(scene: Scene, how: str = "auto") -> RunRecord:
    """Run the single point of a scene."""
    runner = PointRunner(scene, execution=how)
    try:
        return runner.run({})
    finally:
        runner.close()


@pytest.mark.parametrize("case", ["stiff dashpot, nearly plastic", "light beam"])
def test_the_deadline_is_kept_within_one_step(case: str) -> None:
    record = ran(changed(*LONG_STEPS[case], f"deadline = {DEADLINE}"))
    assert record.outcome == Outcome.timeout
    assert f"deadline: {DEADLINE} s passed at time" in record.message


@pytest.mark.parametrize("case", ["stiff dashpot", "stop next to the start"])
def test_the_deadline_is_kept_within_one_step_of_a_coupled_run(case: str) -> None:
    record = ran(changed(*LONG_STEPS[case], f'how = "coupled"\ndeadline = {DEADLINE}'), "coupled")
    assert record.outcome == Outcome.timeout


def test_a_coupled_run_looks_at_the_clock_before_every_communication_step() -> None:
    record = ran(changed("chatter", {}, 'how = "coupled"\ndeadline = 1e-9'), "coupled")
    assert record.outcome == Outcome.timeout
    assert record.message == "deadline: 1e-09 s passed at time 0"


@pytest.mark.parametrize("case", BEYOND_NUMBERS)
def test_a_motion_beyond_the_largest_numbers_is_one_error_that_names_the_time(case: str) -> None:
    with pytest.raises(ComponentError, match=r"expected finite numbers, got .* after time \d.* s"):
        ran(changed(*BEYOND_NUMBERS[case], "deadline = 60"))


def test_a_deadline_does_not_change_the_results() -> None:
    plain, limited = (
        ran(changed("thesis/figure_6_5d", {"transient_periods": "2000"}, execution))
        for execution in ("", "deadline = 100")
    )
    assert plain.impacts is not None
    assert limited.impacts is not None
    assert plain.impacts.tobytes() == limited.impacts.tobytes()
    assert (plain.final_displacement, plain.final_velocity) == (
        limited.final_displacement,
        limited.final_velocity,
    )


RATTLE = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping = 0.1
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 0.1
restitution = {restitution}
[record]
transient_periods = 100000
recorded_periods = 2
impacts = {impacts}
[execution]
impact_limit = 5000
"""


@pytest.mark.parametrize("restitution", [0.7, 0.0])
def test_the_impact_limit_does_not_depend_on_what_is_recorded(restitution: float) -> None:
    messages = set()
    for impacts in ("true", "false"):
        record = ran(parse_scene(RATTLE.format(restitution=restitution, impacts=impacts), "rattle.toml"))
        assert record.outcome == Outcome.impact_limit
        messages.add(record.message)
    assert len(messages) == 1
    assert "impact_limit: 5000 impacts, touch-downs and rests" in messages.pop()


def test_the_impact_limit_holds_for_the_point_and_not_for_each_sample() -> None:
    text = RATTLE.format(restitution=0.7, impacts="true").replace("transient_periods = 100000", "")
    text = text.replace("recorded_periods = 2", "recorded_periods = 10000\ntime_series = { rate = 1.0 }")
    record = ran(parse_scene(text, "rattle.toml"))
    assert record.outcome == Outcome.impact_limit
    assert record.impacts is not None
    assert 0 < len(record.impacts) <= 5000


class Heard(Exception):
    """Raised by the handler of a signal."""


@contextmanager
def alarm() -> Iterator[None]:
    """Send a signal after a moment, like Ctrl-C; its handler is restored, so that no signal ends the test runner."""

    def hear(number: int, frame: object) -> None:
        raise Heard

    before = signal.signal(signal.SIGALRM, hear)
    try:
        signal.setitimer(signal.ITIMER_REAL, DEADLINE)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("how", ["fused", "coupled"])
@pytest.mark.parametrize("case", ["stiff dashpot, nearly plastic", "light beam"])
def test_a_signal_is_heard_within_one_step(case: str, how: str) -> None:
    runner = PointRunner(changed(*LONG_STEPS[case], ""), execution=how)
    try:
        with pytest.raises(Heard), alarm():
            runner.run({})
    finally:
        runner.close()


INTERRUPTED = """
import os, signal, sys, threading
from vibroimpact.orchestrator.commands.cli import main

def interrupt():
    os.kill(os.getpid(), signal.SIGINT)

class Dying:
    def __del__(self):
        interrupt()

class Importing:
    def find_spec(self, name, path=None, target=None):
        if name == WHERE:
            sys.meta_path.remove(self)
            interrupt()

def dies_in_a_run(frame, event, argument):
    if event == "call" and frame.f_code.co_name == "open_runner":
        sys.setprofile(None)
        Dying()

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Importing())
if WHERE == "step":
    threading.Timer(1.5, interrupt).start()
elif WHERE == "__del__":
    sys.setprofile(dies_in_a_run)
main()
"""


# `_elementtree` reports an interrupted import of pyexpat as an ImportError, and `xml.etree` goes on without it.
@pytest.mark.parametrize(
    "where",
    ["step", *(pytest.param(place, marks=pytest.mark.long) for place in ("pyexpat", "xarray", "__del__"))],
)
def test_ctrl_c_leaves_no_file_wherever_it_is_heard(where: str, tmp_path: Path) -> None:
    scene, (name, values) = tmp_path / "long.toml", STIFF_AND_PLASTIC
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    for key, value in values.items():
        text = re.sub(rf"^{key} = .*$", f"{key} = {value}", text, count=1, flags=re.M)
    scene.write_text(text)
    target = tmp_path / "long.nc"
    program = INTERRUPTED.replace("WHERE", repr(where))
    words, cold = (
        (program, "run", scene, "-o", target),
        where in ("pyexpat", "xarray"),
    )  # their imports are interrupted
    ended = warm.run(*words, env=os.environ | ENVIRONMENT, cold=cold)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")
    assert os.listdir(tmp_path) == ["long.toml"]


def test_every_point_of_a_campaign_whose_steps_are_long_gets_its_outcome(
    tmp_path: Path, cluster: str
) -> None:
    name, values = STIFF_AND_PLASTIC
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    for key, value in values.items():
        text = re.sub(rf"^{key} = .*$", f"{key} = {value}", text, count=1, flags=re.M)
    sweep = f'[sweep]\n"forcing.amplitude[1]" = {{ values = [0.5, 0.6, 0.7] }}\n[execution]\ndeadline = {DEADLINE}\n'
    (tmp_path / "scene.toml").write_text(f"{text}\n{sweep}")
    done = in_this_process(
        "campaign", tmp_path / "scene.toml", "-o", tmp_path / "out", "--scheduler", cluster
    )
    assert done.returncode == 0, done.stderr
    outcomes = read_flat(tmp_path / "out" / "dataset.nc")["outcome"].values
    np.testing.assert_array_equal(outcomes, [Outcome.timeout] * 3)


def test_a_coupling_that_throws_its_bodies_beyond_the_numbers_is_one_error() -> None:
    text = (EXAMPLES / "two_oscillators.toml").read_text(encoding="utf-8")
    text, count = re.subn(r"^gain = .*$", "gain = 1e9", text, count=1, flags=re.M)
    assert count == 1
    runner = GeneralRunner(parse_scene(text, "two_oscillators.toml"))
    try:
        with pytest.raises(ComponentError, match="finite"):
            runner.run({})
    finally:
        runner.close()
