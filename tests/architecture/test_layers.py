import re
import runpy
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import import_drawing
import pytest
from harness.kept_costs import EXPENSIVE_FIXTURE, expensive_tests
from support.places import ROOT

PACKAGES = import_drawing.LAYERS


def test_each_layer_imports_only_those_below_it_and_each_heavy_dependency_has_one_door() -> None:
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as run; run()"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert " 0 broken" in result.stdout


def test_no_module_imports_one_that_imports_it_not_even_for_its_types() -> None:
    graph = import_drawing.imports()
    assert sum(map(len, graph.values())) > 1000
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(" imports ".join(error.args[1])) from None


def test_the_drawing_of_the_rooms_is_that_of_their_imports() -> None:
    assert import_drawing.DRAWING.read_text(encoding="utf-8") == import_drawing.drawing(), (
        "run python docs/site/import_drawing.py"
    )


def test_the_build_of_the_fmus_starts_without_a_single_installed_package() -> None:
    # -S: no site-packages; the build hook imports these modules before anything is installed
    code = (
        "import sys, types; namespace = types.ModuleType('vibroimpact'); "
        f"namespace.__path__ = [{str(ROOT)!r}]; sys.modules['vibroimpact'] = namespace; "
        "import vibroimpact.fmus.packaging.build, vibroimpact.fmus.packaging.compiler"
    )
    result = subprocess.run([sys.executable, "-S", "-E", "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize(
    ("module", "not_loaded"),
    [
        # a fork of a process with threads may hang: the supervisor of guarded points forks
        ("vibroimpact.orchestrator.guard.supervisor", ("numpy", "pydantic", "vibroimpact.analysis")),
        # half a second for each process that an FMU has ended
        ("vibroimpact.orchestrator.guard.child", ("xarray", "pandas", "scipy")),
        # a tenth of a second that a run without workers does not need
        ("vibroimpact.orchestrator.running.whole", ("dask", "distributed")),
    ],
)
def test_what_starts_light_loads_nothing_heavy(module: str, not_loaded: tuple[str, ...]) -> None:
    code = f"import sys, {module}; print([name for name in {not_loaded!r} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"


@pytest.mark.parametrize(
    "imported_first",
    [
        "from vibroimpact.analysis import open_dataset",
        "from vibroimpact.orchestrator.run.dataset import dataset_of",
        "from vibroimpact.analysis import figures",
        "import vibroimpact.analysis.landmarks",
    ],
)
def test_what_opens_or_takes_datasets_lets_them_know_their_runs(imported_first: str) -> None:
    code = f"{imported_first}; import xarray; print(hasattr(xarray.Dataset, 'vibroimpact'))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "True\n"


def test_every_benchmark_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """No other test runs the benchmarks: without this test, only a benchmark's next user would see a moved name."""
    folder = ROOT / "tests" / "benchmarks"
    monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
    benchmarks = sorted(folder.glob("bench_*.py"))
    assert len(benchmarks) > 10
    for benchmark in benchmarks:
        # in this process, which has already loaded most of their imports
        runpy.run_path(str(benchmark), run_name=benchmark.stem)


def test_every_room_has_a_folder_of_tests_of_which_make_fast_runs_some() -> None:
    unit = ROOT / "tests" / "unit"
    rooms = {
        path.parent.relative_to(ROOT)
        for package in PACKAGES
        for path in ROOT.glob(f"{package}/*/__init__.py")
    }
    quick = {path.parent.relative_to(unit) for path in unit.rglob("test_*.py") if has_quick_tests(path)}
    assert sorted(map(str, rooms - quick)) == []
    assert [
        str(path) for path in unit.rglob("test_*.py") if not (ROOT / path.parent.relative_to(unit)).is_dir()
    ] == []


def has_quick_tests(path: Path) -> bool:
    """Return whether a module has a test that `make fast` runs when it is the only one of the room."""
    name = path.relative_to(ROOT).as_posix()
    functions = re.findall(r"^def (test\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
    expensive = {
        one.partition("[")[0] for one, took in expensive_tests().items() if took >= EXPENSIVE_FIXTURE
    }
    return any(f"{name}::{function}" not in expensive for function in functions)
