"""`import vibroimpact as vi`: its names, its imports, and its agreement with the commands."""

from __future__ import annotations

import ast
import doctest
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import distributed
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from support.command_line import in_this_process
from support.places import ROOT
from support.replay_scenes import BOARD, hit
from support.still_clock import StillClock, let_nothing_run, stop_the_clock

import vibroimpact as vi
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.orchestrator.run.progress import NotebookBar
from vibroimpact.orchestrator.study.clock import Clock

DOOR = ROOT / "door" / "__init__.py"
FREE = {"body": {"mass": 1.0, "stiffness": 4.0}, "record": {"recorded_time": 5.0, "extrema": True}}
FORCED = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "forcing": {"amplitude": 1.0, "angular_frequency": 0.9},
    "stop": [{"position": 1.0, "law": "restitution", "restitution": 0.7}],
    "record": {"transient_periods": 20, "recorded_periods": 10},
}


def declared() -> dict[str, str]:
    """Return the names for type checkers: each name with its module."""
    found = {}
    for node in ast.walk(ast.parse(DOOR.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("vibroimpact"):
            for alias in node.names:
                assert alias.asname == alias.name
                found[alias.name] = node.module
    return found


def same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Compare values, dimensions and attributes; xarray of 2025 calls no two attributes of NaN identical."""
    xr.testing.assert_equal(one, other)
    for name in one.variables:
        assert repr(sorted(one[name].attrs.items())) == repr(sorted(other[name].attrs.items())), name


def test_type_checkers_see_what_is_there():
    there = declared()
    assert Path(vi.__file__).with_name("py.typed").is_file()
    assert {*there, "__version__"} == set(vi.__all__) == set(dir(vi))
    for name, module in there.items():
        found = getattr(vi, name)
        home = getattr(sys.modules[module], name)
        assert found is home
        assert found.__doc__


def test_version_is_that_of_the_package():
    assert vi.__version__ == __import__("importlib.metadata").metadata.version("vibroimpact")
    with pytest.raises(AttributeError, match="no attribute 'simulate'"):
        _ = vi.simulate


def test_the_door_loads_nothing_before_it_is_asked():
    code = (
        "import sys; import vibroimpact as vi; dir(vi); "
        "print([name for name in ('numpy', 'xarray', 'dask', 'pydantic', 'typing') if name in sys.modules])"
    )
    result = subprocess.run(
        [
            sys.executable,
            "-S",
            "-E",
            "-c",
            f"import sys; sys.path.insert(0, {str(ROOT / '.editable')!r}); {code}",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert result.stdout == "[]\n"


def test_the_page_of_the_door_runs_and_has_every_name(tmp_path, monkeypatch):
    page = ROOT / "docs" / "python.md"
    text = page.read_text(encoding="utf-8")
    for name in vi.__all__:
        assert f"vi.{name}" in text, name
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    stop_the_clock(monkeypatch)
    # the page names the most expensive effect
    monkeypatch.setattr(StillClock, "processor_time", Clock.processor_time)
    failed, tried = doctest.testfile(
        str(page), module_relative=False, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    )
    assert failed == 0
    assert tried > 30


def test_a_run_in_memory_is_that_of_the_file(tmp_path):
    scene = vi.Scene.from_dict(FORCED).with_sweep({"forcing.angular_frequency": [0.8, 0.9]})
    found, written = vi.run(scene), vi.run(scene, tmp_path / "run.nc")
    timeless = [one.drop_vars("point_seconds").drop_attrs(deep=False) for one in (found, written)]
    same(*timeless)
    same(written, open_dataset(tmp_path / "run.nc"))
    assert found.sizes["angular_frequency"] == 2
    assert found.encoding == {}
    # it saves and opens like any other dataset
    found.to_netcdf(tmp_path / "again.nc")
    assert vi.open_dataset(tmp_path / "again.nc").outcome.values.tolist() == [0, 0]


def test_scenes_are_given_as_object_file_or_tables(tmp_path):
    (tmp_path / "free.toml").write_text(vi.Scene.from_dict(FREE).to_toml())
    given = [FREE, vi.Scene.from_dict(FREE), tmp_path / "free.toml", str(tmp_path / "free.toml")]
    ends = {float(vi.run(one).final_displacement) for one in given}
    assert len(ends) == 1
    assert vi.cost_of(FREE).points == 1
    with pytest.raises(
        vi.VibroimpactError, match=r"scene: expected a Scene, the path of one or its tables, got int"
    ):
        vi.run(3)


def test_a_campaign_resumes_and_takes_a_client(tmp_path):
    scene = vi.Scene.from_dict(FORCED).with_sweep({"forcing.angular_frequency": np.linspace(0.7, 1.0, 7)})
    here = vi.campaign(scene, tmp_path / "here", workers=1, progress=False)
    assert here.sizes["angular_frequency"] == 7
    same(vi.campaign(scene, tmp_path / "here", progress=False), here)
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        there = vi.campaign(scene, tmp_path / "there", scheduler=client, progress=False)
        assert client.status == "running"
    for name in ("displacement_range", "impact_velocity", "final_phase"):
        np.testing.assert_array_equal(there[name], here[name])
    with pytest.raises(vi.VibroimpactError, match="connected"):
        vi.campaign(scene, tmp_path / "closed", scheduler=client)


def test_what_cannot_run_points_is_refused(tmp_path):
    scene = vi.Scene.from_dict(FORCED).with_sweep({"forcing.angular_frequency": [0.8, 0.9]})
    with (
        distributed.Client(processes=False, dashboard_address=":0") as client,
        pytest.raises(vi.VibroimpactError, match="threads of this one"),
    ):
        vi.campaign(scene, tmp_path / "threads", scheduler=client)
    with pytest.raises(vi.VibroimpactError, match="expected an address or a dask"):
        vi.campaign(scene, tmp_path / "no", scheduler=3)
    with pytest.raises(vi.VibroimpactError, match="expected one of them, got both"):
        vi.campaign(scene, tmp_path / "no", workers=2, scheduler="tcp://127.0.0.1:1")


def test_an_error_names_arguments_in_python_and_options_on_the_command_line(tmp_path):
    def said(call, *arguments) -> str:
        with pytest.raises(vi.VibroimpactError) as problem:
            call(*arguments)
        return str(problem.value)

    table, folder, swept = tmp_path / "a.csv", tmp_path / "old", tmp_path / "swept.nc"
    table.write_text("a\n" + "0.5\n0.25\n0.75\n" * 5)
    folder.mkdir()
    (folder / "dataset.nc").write_text("of something else")
    scene = tmp_path / "scene.toml"
    scene.write_text(vi.Scene.from_dict(FREE | {"sweep": {"body.mass": {"values": [1.0, 2.0]}}}).text)
    found = vi.run(scene, swept, progress=False)

    assert "Give rate (samples per second), or time_column." in said(vi.import_recording, [table])
    assert "campaign.json. Choose another folder." in said(vi.campaign, scene, folder)
    assert "Name one by its run_index (run): 0, 1." in said(vi.draw, found, "run")

    for arguments, words in (
        (("import", table, "-o", tmp_path / "a.nc"), "Give --rate (samples per second), or --time-column."),
        (("campaign", scene, "-o", folder), "campaign.json. Choose another folder with -o."),
        (
            ("plot", swept, "--kind", "run", "-o", tmp_path / "a.png"),
            "Name one by its run_index (--run): 0, 1.",
        ),
    ):
        assert words in in_this_process(*arguments).stderr


def test_figures_go_into_axes_that_are_there():
    scene = vi.Scene.from_dict(FORCED).with_sweep({"forcing.angular_frequency": np.linspace(0.7, 1.0, 7)})
    swept, single = vi.run(scene), vi.run(ROOT / "examples" / "single_run.toml")
    axes = Figure().subplots(2, 2)
    assert vi.figures.draw_into(axes[:, 0], swept) is not None
    alone = vi.draw(swept).axes
    for one, own in zip(axes[:, 0], alone, strict=True):
        assert (one.get_ylabel(), one.get_ylim()) == (own.get_ylabel(), own.get_ylim())
        np.testing.assert_array_equal(one.lines[0].get_xydata(), own.lines[0].get_xydata())
    assert vi.figures.draw_into(axes[0, 1], single, "portrait") is axes[0, 1]
    assert axes[0, 1].get_xlabel() == "displacement (-)"
    assert not axes[1, 1].lines
    # the next figure is independent again, and a notebook shows it
    assert vi.draw(swept)._repr_png_().startswith(b"\x89PNG")
    for given, words in (
        (axes[0, 0], "expected 2 for the panels of this figure, got 1"),
        ([], "expected axes of matplotlib, got list"),
        (Figure(), "expected axes of matplotlib, got Figure"),
    ):
        with pytest.raises(vi.VibroimpactError, match=words):
            vi.figures.draw_into(given, swept)


def test_a_notebook_sees_a_bar_that_ends_full():
    shown = []
    bar = NotebookBar(shown.append)
    bar.begin(100, 40)
    for _ in range(60):
        bar.advance(1)
    bar.lost_workers(2)
    bar.note("a <b> & c")
    assert '<progress max="100" value="40">' in shown[0]
    assert '<progress max="100" value="100">' in shown[-1]
    assert "2 workers lost" in shown[-1]
    assert "a &lt;b&gt; &amp; c" in shown[-1]
    assert len(shown) < 10


def test_a_script_without_a_main_guard_runs_once(tmp_path):
    script = tmp_path / "sweep.py"
    script.write_text(
        "import vibroimpact as vi\n"
        "print('once', flush=True)\n"
        f"scene = vi.Scene.from_dict({FORCED!r}).with_sweep({{'forcing.angular_frequency': [0.8, 0.9, 1.0]}})\n"
        "print(vi.campaign(scene, 'sweep', workers=2, progress=False).sizes['angular_frequency'], __file__)\n"
    )
    result = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert result.stdout == f"once\n3 {script}\n"
    assert (result.returncode, result.stderr) == (0, "")


def test_runs_in_threads_are_those_of_one_thread():
    scenes = [vi.Scene.from_dict(FORCED).with_values({"body.mass": 1.0 + 0.1 * k}) for k in range(8)]
    alone = [float(vi.run(scene).final_displacement) for scene in scenes]
    with ThreadPoolExecutor(4) as threads:
        together = list(threads.map(lambda scene: float(vi.run(scene).final_displacement), scenes))
    assert together == alone


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vi.run("[body]\nmass = 1"), "Scene.from_text reads it"),
        (lambda: vi.run(FREE, 3), "path: expected the name of a file or folder, got 3"),
        (lambda: vi.run(FREE, "a\0b.nc"), "path: expected the name of a file or folder"),
        (lambda: vi.Scene.from_file(None), "expected the path of a file, got NoneType"),
        (lambda: vi.Scene.from_text(b"x"), "expected TOML text, got bytes"),
        (lambda: vi.Scene.from_text("", None), "expected the name of the scene as text, got NoneType"),
        (
            lambda: vi.Scene.from_dict(FREE).with_values([1]),
            "expected a mapping of keys and their new values",
        ),
        (
            lambda: vi.Scene.from_dict(FREE).with_sweep(None),
            "expected a mapping of swept keys and their values",
        ),
        (lambda: vi.Scene.from_dict({**FREE, "scene": {"title": "\ud800"}}), r"got '\\ud800'"),
        (lambda: vi.campaign(FREE, None), "path: expected the name of a file or folder, got None"),
        (lambda: vi.campaign(FREE, "c", workers=0), "workers: expected a whole number of 1 or more, got 0"),
        (lambda: vi.campaign(FREE, "c", workers="two"), "workers: expected a whole number of 1 or more"),
        (lambda: vi.replay(FREE, 3), "path: expected the name of a file or folder, got 3"),
        (lambda: vi.draw(vi.Scene), "expected a dataset, a recording or a result, got ModelMetaclass"),
        (
            lambda: vi.draw(print),
            "expected a dataset, a recording or a result, got builtin_function_or_method",
        ),
        (lambda: vi.draw("run.nc"), "expected a dataset, a recording or a result, got str. open_dataset"),
        (lambda: vi.draw(vi.run(FREE), width="a"), "size: expected numbers, mm, got 'a'"),
        (lambda: vi.estimate_impacts(xr.DataArray([0.0, 1.0], {"time": [0.0, 1.0]}), 10.0), "got float"),
        (lambda: vi.import_recording([]), "files: expected one or more, got none"),
        (lambda: vi.import_recording("a.csv", {"rates": 3}), "settings: rates"),
        (lambda: vi.fmus.export("beam", "x.fmu", modes=2.5), "modes: expected 1 to 64, got 2.5"),
    ],
)
def test_a_wrong_type_is_named_in_one_line(call, words):
    with pytest.raises(vi.VibroimpactError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)
    str(caught.value).encode()


WRITERS = {
    "run": lambda read, path: vi.run(read / "scene.toml", path),
    "run of a scene that was read": lambda read, path: vi.run(vi.Scene.from_file(read / "scene.toml"), path),
    "accuracy": lambda read, path: vi.accuracy(read / "scene.toml", path),
    "effects": lambda read, path: vi.effects(read / "scene.toml", path),
    "follow": lambda read, path: vi.follow(read / "scene.toml", "forcing.angular_frequency", 0.9, 1.0, path),
    "replay": lambda read, path: vi.replay(read / "replayed.toml", read / "hit.nc", path),
    "replay of the scene's own": lambda read, path: vi.replay(read / "named.toml", path=path),
    "run of a replay": lambda read, path: vi.run(read / "named.toml", path),
    "scored": lambda read, path: vi.replay(read / "named.toml", path=path, score=read / "other.nc"),
    "sensitivity": lambda read, path: vi.sensitivity(read / "hit.nc", path),
    "an FMU": lambda read, path: vi.export_fmu(read / "scene.toml", path),
    "a system": lambda read, path: vi.export_ssp(read / "scene.toml", path),
}
"""Calls that write a file, by their names."""
READ = {
    "replay": ("replayed.toml", "hit.nc"),
    "replay of the scene's own": ("named.toml", "hit.nc"),
    "run of a replay": ("named.toml", "hit.nc"),
    "scored": ("named.toml", "hit.nc", "other.nc"),
    "sensitivity": ("hit.nc",),
}


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Return a folder of scenes and recordings in which every simulation fails."""
    let_nothing_run(monkeypatch)
    (tmp_path / "scene.toml").write_text(vi.Scene.from_dict(FORCED).to_toml())
    (tmp_path / "replayed.toml").write_text(BOARD)
    (tmp_path / "named.toml").write_text(BOARD.replace("[replay]", '[replay]\nrecordings = ["hit.nc"]'))
    hit(tmp_path)
    hit(tmp_path, "other.nc", 2)
    return tmp_path


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_read_is_never_written_over(name, read):
    for file in READ.get(name, ("scene.toml",)):
        before = (read / file).read_bytes()
        with pytest.raises(vi.VibroimpactError, match=f"{file}: expected a new file, got one that is read"):
            WRITERS[name](read, read / file)
        assert (read / file).read_bytes() == before


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_that_has_no_place_is_refused_before_anything_runs(name, read):
    with pytest.raises(
        vi.VibroimpactError, match="expected a place where a file can be written, got no folder"
    ):
        WRITERS[name](read, read / "nowhere" / "found.nc")


def test_responses_and_signals_are_fitted_without_steps_between():
    clock = {"time": np.arange(4000) * 0.001}
    rng = np.random.default_rng(1)
    force = rng.normal(size=4000)
    kernel = np.exp(-0.02 * np.arange(400)) * np.sin(0.3 * np.arange(400))
    motion = np.convolve(force, kernel)[:4000]
    response = vi.frequency_response(xr.DataArray(force, clock), xr.DataArray(motion, clock), segment=1024)
    assert (
        vi.fit_resonance(response).natural_angular_frequency
        == vi.fit_resonance(vi.curve_of(response)).natural_angular_frequency
    )
    decay = xr.DataArray(kernel, {"time": np.arange(400) * 0.001}, name="arm")
    assert vi.estimate_decay(decay, laws=()).exponential.decay_rate.value == pytest.approx(20.0, rel=1e-6)
