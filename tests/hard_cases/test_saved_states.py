"""A saved state continues in another process, and a thousand lives of a component leave nothing behind."""

import json
import subprocess
import sys
from ctypes import c_void_p
from pathlib import Path

import pytest
from harness import warm
from support.coupled_parts import VERSIONS, body, contact, external, stop, values
from support.places import TESTS
from support.saved_states import deserialize, serialize

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.master import Importer

#: Slow forcing: chatter from about 1 s to 2.5098 s, then sticking until 7.854 s.
SLOW: dict[str, Value] = {
    "damping": 0.1,
    "forcing.amplitude": 1.0,
    "forcing.angular_frequency": 0.2,
    "displacement_start": -0.1,
}
MOMENTS = {"flight": 0.2, "chatter": 2.3, "end of chatter": 2.509, "sticking": 5.0, "after release": 9.0}
OUTPUTS = (
    "displacement",
    "velocity",
    "contact[1].last_time",
    "contact[1].last_velocity",
    "contact[1].stick_start",
)
END = 40.0
MEGABYTE = 1 << 20

# the other process: the same components, restored to each of the saved states, run to the end
GO_ON = """
import json, sys
sys.path[:0] = [{tests!r}, {here!r}]
from support.coupled_parts import values
from support.saved_states import deserialize
from test_saved_states import END, OUTPUTS, coupled, fused
kind, version, *moments = json.loads(sys.argv[1])
for time, files in moments:
    importer = {{"fused": fused, "coupled": coupled}}[kind](version)
    importer.begin(time)
    for component, file in zip(importer.components.values(), files, strict=True):
        slot = deserialize(component.instance, open(file, "rb").read())
        component.instance.restore(slot)
        component.instance.free_state(slot)
    importer.advance(END)
    print(json.dumps([v.hex() for v in values(importer, "b", *OUTPUTS)]))
    importer.free()
"""


def fused(version: str) -> Importer:
    law: dict[str, Value] = {"contact[1].law": "restitution", "contact[1].restitution": 0.7}
    return Importer([body("b", {**SLOW, **external(0.0), **law}, version)])


def coupled(version: str) -> Importer:
    return Importer(
        [body("b", {**SLOW, **external(0.0)}, version), stop("s", 0.7, version)], contact("b", "s")
    )


def saved(importer: Importer) -> list[bytes]:
    """Return the serialized current states of all components."""
    states = []
    for component in importer.components.values():
        slot = c_void_p()
        component.instance.save(slot)
        states.append(serialize(component.instance, slot))
        component.instance.free_state(slot)
    return states


@pytest.mark.parametrize("kind", ["fused", "coupled"])
@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_goes_on_in_another_process_as_in_its_own(tmp_path: Path, version: str, kind: str) -> None:
    importer = {"fused": fused, "coupled": coupled}[kind](version)
    moments, here = [], []
    for name, time in MOMENTS.items():
        importer.begin()
        importer.advance(time)
        files = []
        for i, state in enumerate(saved(importer)):
            files.append(tmp_path / f"{name}{i}")
            files[-1].write_bytes(state)
        moments.append((importer.time, [*map(str, files)]))
        stuck = importer.components["b"].group("Boolean", ["contact[1].stuck"]).get()[0]
        assert bool(stuck) == (name == "sticking")
        importer.advance(END)
        here.append([v.hex() for v in values(importer, "b", *OUTPUTS)])
    importer.free()
    code = GO_ON.format(tests=str(TESTS), here=str(Path(__file__).parent))
    there = warm.run(code, json.dumps([kind, version, *moments]))
    assert there.returncode == 0, there.stderr
    assert [*map(json.loads, there.stdout.splitlines())] == here


@pytest.mark.parametrize("version", VERSIONS)
def test_a_damaged_or_foreign_state_is_refused_and_the_instance_lives_on(version: str) -> None:
    importer = coupled(version)
    importer.begin()
    importer.advance(2.3)
    state, other = saved(importer)
    owner = importer.components["b"].instance
    damaged = bytearray(state)
    damaged[len(damaged) // 2] ^= 1
    for wrong in (bytes(damaged), state[:-1], state + b"x", other, b"", b"x" * len(state)):
        with pytest.raises(ComponentError, match="b: fmi"):
            deserialize(owner, wrong)
    importer.advance(END)
    importer.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_taken_back_a_thousand_times_is_the_same_step(version: str) -> None:
    importer = fused(version)
    importer.begin()
    importer.advance(2.3)
    instance, slot, found = importer.components["b"].instance, c_void_p(), set()
    instance.save(slot)
    for _ in range(1000):
        instance.restore(slot)
        instance.step(2.3, 20.0)
        found.add(tuple(values(importer, "b", *OUTPUTS)))
    instance.free_state(slot)
    importer.free()
    assert len(found) == 1


CYCLES = """
import gc, resource, sys
sys.path[:0] = [{tests!r}, {here!r}]
from test_saved_states import coupled, fused
version, kind, lives = sys.argv[1:]
def cycles(count):
    for _ in range(count):
        importer = {{"fused": fused, "coupled": coupled}}[kind](version)
        importer.begin()
        importer.advance(3.0)
        for component in importer.components.values():
            component.instance.terminate()
        importer.free()
    gc.collect()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
warm = cycles(150)
print(cycles(int(lives)) - warm)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the largest memory of a process is read from POSIX")
@pytest.mark.parametrize("lives", [pytest.param(1000, marks=pytest.mark.long), 300])
def test_lives_leave_no_memory_behind(lives: int) -> None:
    code = CYCLES.format(tests=str(TESTS), here=str(Path(__file__).parent))
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", code, version, "coupled", str(lives)], stdout=subprocess.PIPE, text=True
        )
        for version in VERSIONS
    ]
    grown = [process.communicate(timeout=100)[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert (
        max(map(int, grown)) < MEGABYTE
    )  # a leak shows from 1 kilobyte a life in 1000 lives, from 3.5 in 300
