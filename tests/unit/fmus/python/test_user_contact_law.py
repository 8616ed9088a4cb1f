"""A contact law written in Python gives the same answers as an FMU and as a function."""

import gc
import importlib.util
import runpy
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from support.fmpy_checks import validate

from vibroimpact.fmus.errors import ComponentError, ComponentFileError, UsageError
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.python_fmus import USER_CONTACT_LAW, build_user_contact_law

pytest.importorskip("pythonfmu")

DISPLACEMENT, VELOCITY, RESTITUTION, FORCE = range(4)
SLOWING = "def contact_law(displacement, velocity):\n    return 0.9 - 0.05 * velocity + 0.01 * displacement\n"
FAILING = """\
def contact_law(displacement, velocity):
    if velocity > 3:
        raise RuntimeError("100% too fast, %s")
    return 2.0 if velocity > 2 else 0.5
"""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def make(tmp_path: Path) -> Callable[[str, str], Path]:
    def build(text: str, name: str = "law") -> Path:
        law = tmp_path / f"{name}.py"
        law.write_text(text)
        return build_user_contact_law(law, tmp_path / f"{name}.fmu")

    return build


def test_an_fmu_does_not_take_the_place_of_its_law(tmp_path: Path) -> None:
    law, link = tmp_path / "law.py", tmp_path / "link.fmu"
    law.write_text(SLOWING)
    link.symlink_to(law)
    for target in (law, link):
        with pytest.raises(UsageError, match="expected a new file, got one that is read"):
            build_user_contact_law(law, target)
    assert law.read_text() == SLOWING


class Slave:
    """An instance made with FMPy's own class, and its log."""

    def __init__(self, path: Path, folder: Path, *, logging: bool = True) -> None:
        md = read_model_description(str(path))
        self.lines: list[str] = []
        self.fmu = FMU2Slave(
            guid=md.guid,
            unzipDirectory=extract(str(path), str(folder)),
            modelIdentifier=md.coSimulation.modelIdentifier,
            instanceName="stop",
        )
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: self.lines.append(a[4].decode()))
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.fmu.instantiate(callbacks=callbacks, loggingOn=logging)
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def ask(self, displacement: float, velocity: float) -> float:
        self.fmu.setReal([DISPLACEMENT, VELOCITY], [displacement, velocity])
        return self.fmu.getReal([RESTITUTION])[0]


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Callable[..., Slave]]:
    slaves: list[Slave] = []

    def start(path: Path, *, logging: bool = True) -> Slave:
        slaves.append(Slave(path, tmp_path / f"unpacked{len(slaves)}", logging=logging))
        return slaves[-1]

    yield start
    for slave in slaves:
        slave.fmu.freeInstance()


def test_the_fmu_answers_what_the_function_does(make, opened) -> None:  # type: ignore[no-untyped-def]
    path = make(SLOWING)
    law = runpy.run_path(str(path.with_suffix(".py")))["contact_law"]
    stop = opened(path)
    for displacement, velocity in ((1.0, 0.0), (1.0, 0.3), (-2.0, 7.5), (0.1, 1e-9)):
        # no step between the set and the get
        assert stop.ask(displacement, velocity) == law(displacement, velocity)


def test_the_sign_of_the_velocity_does_not_matter(make, opened) -> None:  # type: ignore[no-untyped-def]
    stop = opened(make(SLOWING))
    assert stop.ask(0.0, -4.0) == stop.ask(0.0, 4.0) == pytest.approx(0.7)


def test_a_step_changes_nothing(make, opened) -> None:  # type: ignore[no-untyped-def]
    stop = opened(make(SLOWING))
    before = stop.ask(0.0, 2.0)
    stop.fmu.doStep(0.0, 0.5)
    assert stop.fmu.getReal([RESTITUTION, FORCE]) == [before, 0.0]


def test_one_setting_of_the_inputs_is_one_call_of_the_law(make, opened) -> None:  # type: ignore[no-untyped-def]
    counting = "count = 0\ndef contact_law(x, v):\n    global count\n    count += 1\n    return count / 100\n"
    stop = opened(make(counting))
    first = stop.ask(0.0, 1.0)
    assert [stop.fmu.getReal([RESTITUTION])[0] for _ in range(5)] == [first] * 5
    assert stop.ask(0.0, 1.0) == pytest.approx(first + 0.01)


def test_two_laws_in_one_process_keep_apart(make, opened) -> None:  # type: ignore[no-untyped-def]
    one = opened(make("def contact_law(x, v):\n    return 0.25\n", "one"))
    other = opened(make("def contact_law(x, v):\n    return 0.75\n", "other"))
    assert (one.ask(0.0, 1.0), other.ask(0.0, 1.0)) == (0.25, 0.75)


def test_a_mistake_at_an_impact_is_an_fmi_error_that_names_inputs_and_line(make, opened) -> None:  # type: ignore[no-untyped-def]
    stop = opened(make(FAILING))
    with pytest.raises(FMICallException, match="fmi2GetReal"):
        stop.ask(0.25, 4.0)
    assert "contact_law(0.25, 4): contact_law.py, line 3: RuntimeError: 100%% too fast, %%s" in stop.lines[-1]
    with pytest.raises(FMICallException):
        stop.ask(0.25, 2.5)
    assert (
        "contact_law(0.25, 2.5): expected a coefficient of restitution, 0 <= r <= 1, got 2.0."
        in stop.lines[-1]
    )


def test_an_instance_lives_on_after_mistakes_and_is_freed_without_harm(make, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    stop = Slave(make(FAILING), tmp_path / "unpacked")
    for _ in range(50):
        with pytest.raises(FMICallException):
            stop.ask(0.0, 4.0)
        assert stop.ask(0.0, 1.0) == 0.5
    stop.fmu.freeInstance()
    gc.collect()


def test_pythonfmu_says_nothing_without_logging_on(make, opened) -> None:  # type: ignore[no-untyped-def]
    stop = opened(make(FAILING), logging=False)
    with pytest.raises(FMICallException):
        stop.ask(0.0, 4.0)
    assert stop.lines == []


def test_the_description_is_valid_and_says_what_importers_need(make) -> None:  # type: ignore[no-untyped-def]
    path = make(SLOWING)
    assert validate(path) == ()
    assert check_fmu(path) == ()
    description = read_description(path)
    assert (description.fmiVersion, description.modelName) == ("2.0", "UserContactLaw")
    assert not description.coSimulation.canGetAndSetFMUstate
    assert [v.name for v in description.modelVariables] == [
        "displacement",
        "velocity",
        "applied_restitution",
        "applied_force",
    ]
    assert [v.unit for v in description.modelVariables] == ["m", "m/s", None, "N"]
    (restitution, force) = description.outputs
    assert [v.name for v in restitution.dependencies] == ["displacement", "velocity"]
    assert force.variable.name == "applied_force"


def test_equal_laws_make_equal_files(make) -> None:  # type: ignore[no-untyped-def]
    assert make(SLOWING, "one").read_bytes() == make(SLOWING, "two").read_bytes()
    assert make(FAILING, "three").read_bytes() != make(SLOWING, "two").read_bytes()


def test_the_template_is_a_law(tmp_path: Path, opened) -> None:  # type: ignore[no-untyped-def]
    stop = opened(build_user_contact_law(USER_CONTACT_LAW / "contact_law.py", tmp_path / "template.fmu"))
    answers = [stop.ask(0.0, v) for v in (0.0, 0.1, 1.0, 10.0)]
    assert answers[0] == 1.0
    assert answers == sorted(answers, reverse=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "def contact_law(x, v):\n    return 1.2\n",
            r"contact_law\(0, 1\): expected .* 0 <= r <= 1, got 1.2",
        ),
        ("def contact_law(x, v):\n    return None\n", "got None"),
        ("def contact_law(x, v):\n    return float('nan')\n", "got nan"),
        ("def contact_law(x, v):\n    return 1 / 0\n", "line 2: ZeroDivisionError"),
        ("def contact_law(v):\n    return 1\n", "takes 1 positional argument"),
        ("def law(x, v):\n    return 1\n", "expected a function contact_law"),
        ("import no_such_package\n", "line 1: ModuleNotFoundError"),
        ("def contact_law(:\n", "SyntaxError"),
    ],
)
def test_a_wrong_law_is_refused_when_it_is_built(make, text: str, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ComponentFileError, match=message):
        make(text)


def test_files_that_cannot_be_read_or_written_are_named(tmp_path: Path, make) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(UsageError, match=r"absent\.py: expected a Python file"):
        build_user_contact_law(tmp_path / "absent.py", tmp_path / "law.fmu")
    make(SLOWING)
    with pytest.raises(UsageError, match="expected a file that can be written"):
        build_user_contact_law(tmp_path / "law.py", tmp_path / "law.py" / "law.fmu")


def test_without_pythonfmu_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "pythonfmu" else find_spec(name)
    )
    with pytest.raises(ComponentError, match=r"pip install 'vibroimpact\[python-fmus\]'"):
        build_user_contact_law(USER_CONTACT_LAW / "contact_law.py", tmp_path / "law.fmu")


def test_the_fmu_runs_where_pythonfmu_is_not_installed(make, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    # -S: no site-packages; then only FMPy's folder is made visible again
    code = textwrap.dedent("""
        import sys
        import importlib.util
        assert importlib.util.find_spec("pythonfmu") is None
        path, folder = sys.argv[1:]
        import ctypes
        ctypes.CDLL(path).fmi2GetVersion.restype = ctypes.c_char_p
        library = ctypes.CDLL(path)
        library.fmi2Instantiate.restype = ctypes.c_void_p
        callbacks = (ctypes.c_void_p * 5)()
        instance = library.fmi2Instantiate(b"stop", 1, b"", folder.encode(), callbacks, 0, 0)
        assert instance
        value, reference = ctypes.c_double(2.0), ctypes.c_uint(1)
        set_real, get_real = library.fmi2SetReal, library.fmi2GetReal
        for function in (set_real, get_real):
            function.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p]
        assert set_real(instance, ctypes.byref(reference), 1, ctypes.byref(value)) == 0
        reference.value = 2
        assert get_real(instance, ctypes.byref(reference), 1, ctypes.byref(value)) == 0
        print(value.value)
    """)
    unpacked = Path(extract(str(make(SLOWING)), str(tmp_path / "bare")))
    (binary,) = unpacked.glob("binaries/win64/*.dll" if sys.platform == "win32" else "binaries/linux64/*.so")
    command = [sys.executable, "-S", "-E", "-c", code, str(binary), (unpacked / "resources").as_uri()]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert float(result.stdout) == pytest.approx(0.8)


def test_a_thousand_lives_of_a_python_component_in_one_process_take_no_more_memory(tmp_path: Path) -> None:
    import psutil  # type: ignore[import-untyped, unused-ignore]

    from vibroimpact.orchestrator.importer.component import Component
    from vibroimpact.orchestrator.importer.specification import ComponentSpec

    law = tmp_path / "law.py"
    law.write_text("def contact_law(displacement, velocity):\n    return 0.7\n", encoding="utf-8")
    spec = ComponentSpec("law", build_user_contact_law(law, tmp_path / "law.fmu"))
    memory = psutil.Process().memory_info

    def live(times: int) -> float:
        for _ in range(times):
            component = Component(spec)
            component.begin({}, 0.0, first=True)
            component.instance.exit_initialization()
            component.instance.step(0.0, 0.1)
            component.free()
        return float(memory().rss)

    path = list(sys.path)
    before = live(100)
    # a leak takes 18 kB for each instance, 16 MB in total; other work of this process may take some memory
    assert live(900) - before < 8e6
    # each leaked instance adds an entry to sys.path
    assert len(sys.path) <= len(path) + 1
