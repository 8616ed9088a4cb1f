"""Every kind of written file: a command that makes a small one, and its variables and attributes as text.

The text also has the values on which a user's program may depend: units, meanings of flags, the name of the kind. It
leaves out sizes, results, and facts that differ between machines.
"""

from __future__ import annotations

import math
import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from support.command_line import in_this_process
from support.places import EXAMPLES, TESTS
from support.replay_scenes import BOARD, hit
from support.rig_bench import opened_bench
from support.scenes import BEAM, CHAIN, FORCED
from support.serial_pool import campaign_here
from support.sweep_files import sweep_text
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

FREQUENCIES = "[sweep]\n'forcing.angular_frequency' = { start = 0.7, stop = 0.9, points = 3%s }\n"
SCENES = {
    "forced": FORCED,
    "swept": FORCED + FREQUENCIES % "",
    "paths": FORCED + FREQUENCIES % ", path = 'up-down'",
    "drawn": FORCED
    + "[sweep]\nsample = { design = 'saltelli', points = 8 }\n"
    + "'forcing.amplitude' = { distribution = 'uniform', low = 0.4, high = 0.5 }\n"
    + "'body.damping' = { distribution = 'uniform', low = 0.1, high = 0.12 }\n",
    "chain": CHAIN,
    "beam": BEAM,
    "board": BOARD,
}
EXAMPLES_USED = ("basins", "mixed_versions", "newtons_cradle")
RIG = ("oscillator", "oscillator_scene")
CALIBRATED = 'how = "by its maker"\nwhen = "2026-11-25"\n'
KINDS = {
    # runs
    "run": "run forced.toml",
    "run with samples": "run forced.toml --set record.time_series.rate=20 --set record.time_series.variables="
    "['displacement','contact_force','energy.kinetic']",
    "run of a chain": "run chain.toml --set record.time_series.rate=9 --set record.time_series.variables="
    "['displacement[1]','modal_energy[2]','energy.contact_loss']",
    "run of a beam": "run beam.toml --set execution.tolerance=0.1",
    "measured run": "run beam.toml --set sensor.gain=1000 --set noise={seed=5,sensor=0.01} "
    "--set daq={rate=2000.0,bits=12,range=10.0} --set record.time_series.variables=['sensor.displacement']",
    "coupled run": "run forced.toml --set execution.how=coupled --set execution.macro_step=0.05",
    "free decay": "run forced.toml --set forcing.amplitude=0 --set forcing.angular_frequency=0 "
    "--set stop=[] --set body.displacement_start=1 --set record={recorded_time=60.0} "
    "--set record.time_series.rate=20 --set record.time_series.variables=['displacement']",
    "run of components": "run mixed_versions.toml --set record.transient_time=0 --set record.recorded_time=9",
    "run of pairs": "run newtons_cradle.toml --set record.recorded_time=1",
    "bounces": "run forced.toml --set forcing.angular_frequency=0 --set body.stiffness=0 --set body.damping=0 "
    "--set record={recorded_time=12.0} --set record.time_series.rate=200 "
    "--set record.time_series.variables=['displacement']",
    "sweep": "run swept.toml",
    "sweep of paths": "run paths.toml",
    "sweep of all periods": "run swept.toml --set record.each_period=false",
    "sweep of drawn values": "run drawn.toml",
    "campaign": "",
    # studies of runs
    "accuracy": "accuracy forced.toml --budget 10",
    "effects": "effects forced.toml",
    "sensitivity": "sensitivity [sweep of drawn values] --resamples 20",
    "hard cases": "hard-cases --only grazing-from-below",
    "orbits": "orbit forced.toml --impacts 1 --periods 1",
    "orbits of a chain": "orbit chain.toml --impacts 1 --periods 1 --set body.dampings=[0.03,0.01,0.02]",
    "branches": "follow forced.toml --parameter forcing.angular_frequency --from 0.85 --to 0.9 --step 0.2",
    "bifurcations over two keys": "follow forced.toml --parameter forcing.angular_frequency --from 0.6 --to 0.9 "
    "--second stop[1].restitution --second-from 0.69 --second-to 0.71",
    "diagram": "diagram forced.toml --parameter forcing.angular_frequency --from 0.85 --to 0.9 --values 3 "
    "--points 4 --share-values 2 --doublings 0 --grazes 0",
    "diagram over two keys": "diagram forced.toml --parameter forcing.angular_frequency --from 0.85 --to 0.95 "
    "--values 3 --second stop[1].restitution --second-from 0.69 --second-to 0.71 --second-values 2 --doublings 0 "
    "--grazes 0",
    "map of impacts": "maps forced.toml --kind impact",
    "map of states": "maps forced.toml --kind strobe",
    "map of sets": "maps forced.toml --kind discontinuity --points 30",
    "map of Nordmark": "maps --kind nordmark --alpha 0.5 --gamma 0.1 --from -0.1 --to 0.1 --points 10",
    "map of square roots": "maps --kind square-root --from 0.1 --to 0.2 --points 10",
    "basins": "basins basins.toml --points 6",
    "basins and edges": "basins basins.toml --points 6 --edges",
    "shares of basins": "basins basins.toml --points 6 --parameter forcing.angular_frequency "
    "--from 1 --to 1.2 --values 2",
    "control": "control forced.toml --from 0.9 --to 0.899 --step 0.001",
    "transients": "transients forced.toml --starts 2",
    "Lyapunov exponents": "lyapunov forced.toml --set record.recorded_periods=300",
    "energies of one orbit": "energies chain.toml --set record.transient_periods=200 "
    "--set body.dampings=[0.03,0.01,0.02]",
    "energies": "energies [sweep]",
    "resonances": "resonances forced.toml "
    "--set sweep={'forcing.angular_frequency'={start=0.5,stop=1.7,points=13}}",
    "classes": "classify [sweep of paths]",
    # recordings and their analyses
    "recording": "import signal.csv --rate 20 --unit m",
    "two signals": "import two.csv --rate 1000 --unit m/s^2 --unit m/s^2",
    "recorded run": "rig record --rig RIG --channel tip=Dev1/ai0,5 --rate 1000 --duration 0.2",
    "recorded spikes": "rig spikes --rig RIG --channel tip=Dev1/ai0,5 --rate 1000 "
    "--threshold 0.5 --presamples 10 --postsamples 10 --duration 0.5",
    "recovered recording": "rig recover rig.journal",
    "measured sweep": "rig sweep sweep.toml --rig RIG",
    "estimates of a decay": "estimate decay [recording]",
    "estimates of impacts": "estimate impacts [run with samples] --channel displacement",
    "estimates of bounces": "estimate bounces [bounces] --channel displacement",
    "estimates of a response": "estimate response [two signals] --drive base --channel board --segment 64",
    "spikes": "spikes [recording]",
    "replay": "replay board.toml hit.nc",
    "replay that is fitted": "replay board.toml hit.nc --fit body.damping_ratio --score again.nc",
}
FOLDERS = {"campaign": "campaign", "measured sweep": "measured"}
"""Kinds whose file is the `dataset.nc` of a folder."""
SLOW = ("accuracy",)
"""Kinds that take seconds to make."""

KEPT_ATTRIBUTES = (
    *("Conventions", "dataset_schema", "recording_schema", "results_schema", "results_kind", "history"),
    *("units_system", "execution", "engine", "engine_version", "map", "quantity"),
)
"""Attributes of a file whose values are in the text; the text has only name and type of all others."""

VARYING = ("trigger",)
"""Attributes of variables whose values differ from run to run, in addition to non-integer numbers."""


class KindsOfDataset:
    """A folder with a file of each kind, made on first use."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        for name, text in SCENES.items():
            (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        for name in (*EXAMPLES_USED, *(f"rig/{each}" for each in RIG)):
            shutil.copy(EXAMPLES / f"{name}.toml", folder)
        _release(folder / "oscillator_scene.toml")
        (folder / "sweep.toml").write_text(sweep_text([19.0, 20.0]) + CALIBRATED, encoding="utf-8")
        _write_signals(folder)
        with zipfile.ZipFile(TESTS / "end_to_end" / "version_0_2.zip") as archive:
            archive.extract("rig.journal", folder)

    def described(self, kind: str) -> str:
        """Return the text of a kind."""
        return described(self.file(kind))

    def file(self, kind: str) -> Path:
        """Return the file of a kind."""
        path = self._folder / (f"{FOLDERS[kind]}/dataset.nc" if kind in FOLDERS else f"{kind}.nc")
        if kind == "campaign" and not path.exists():
            with pytest.MonkeyPatch.context() as patch:
                campaign_here(patch, SCENES["paths"], path.parent, runner=DEFAULT_RUNNER)
        elif not path.exists():
            self._make(kind, path)
        return path

    def arguments(self, kind: str, rig: str = "") -> list[str | Path]:
        """Return the words of the command that makes a kind, after making the files that it needs."""
        words = re.findall(r"(?:\[[^\]=]+\]|\S)+", KINDS[kind])
        return [rig if word == "RIG" else self._word(word) for word in words]

    def _make(self, kind: str, path: Path) -> None:
        with self._rig() if "RIG" in KINDS[kind] else nullcontext("") as rig:
            given = self.arguments(kind, rig)
            done = in_this_process(*given, "-o", path.parent if kind in FOLDERS else path)
        assert path.exists(), f"{kind}: {done.returncode}: {done.stdout}{done.stderr}"

    @contextmanager
    def _rig(self) -> Iterator[str]:
        """Yield the address of a rig whose clock runs only while a call waits for it, however busy the machine is."""
        with opened_bench(self._folder / "oscillator.toml") as bench:
            yield f"grpc://{bench.server.address}"

    def _word(self, word: str) -> str | Path:
        """Return a word of a command; a file of this folder becomes its path."""
        if word.startswith("["):
            return self.file(word[1:-1])
        path = self._folder / word
        return path if path.is_file() else word


def _release(scene: Path) -> None:
    """Start the body of a rig away from its rest, so that its motion can be measured."""
    text = scene.read_text(encoding="utf-8")
    scene.write_text(text.replace("[body]", "[body]\ndisplacement_start = -0.003"), encoding="utf-8")


def _write_signals(folder: Path) -> None:
    """Write a decay, a drive with its response, and a hit, as files for import or reading."""
    decay = (f"{0.99**n * math.cos(0.3 * n)}\n" for n in range(400))
    (folder / "signal.csv").write_text("signal\n" + "".join(decay))
    base = np.random.default_rng(1).normal(size=2000)
    board = np.convolve(base, 0.9 ** np.arange(40) * np.sin(0.8 * np.arange(40)))[:2000]
    rows = (f"{one},{other}\n" for one, other in zip(base, board, strict=True))
    (folder / "two.csv").write_text("base,board\n" + "".join(rows))
    hit(folder)
    hit(folder, "again.nc", seed=2)


def described(path: Path) -> str:
    """Return the attributes and variables of a file; a list of coordinates shared by several variables appears once."""
    with netCDF4.Dataset(path) as data:
        lines = [f"{name}: {_of_file(name, data.getncattr(name))}" for name in sorted(data.ncattrs())]
        lists = sorted(
            {each.coordinates for each in data.variables.values() if "coordinates" in each.ncattrs()}
        )
        lines += [f"coordinates {number}: {names}" for number, names in enumerate(lists, start=1)]
        lines += [_line_of(data.variables[name], lists) for name in sorted(data.variables)]
    return "".join(f"    {line}\n" for line in lines)


def _line_of(variable: Any, lists: Sequence[str]) -> str:
    """Return name, dimensions, type and attributes of a variable."""
    values = {key: variable.getncattr(key) for key in sorted(variable.ncattrs())}
    if "coordinates" in values:
        values["coordinates"] = lists.index(values["coordinates"]) + 1
    attributes = [f"{key} = {_of_variable(key, value)}" for key, value in values.items()]
    kind = getattr(variable.dtype, "name", "str")
    return f"{variable.name}({', '.join(variable.dimensions)}) {kind}: {'; '.join(attributes)}"


def _of_file(name: str, value: Any) -> str:
    return _written(value) if name in KEPT_ATTRIBUTES else type(value).__name__


def _of_variable(name: str, value: Any) -> str:
    if name != "_FillValue" and np.asarray(value).dtype.kind == "f":
        return "numbers"
    return type(value).__name__ if name in VARYING else _written(value)


def _written(value: Any) -> str:
    return repr(value.tolist() if hasattr(value, "tolist") else value)


def datasets() -> str:
    """Return all kinds with their texts."""
    with tempfile.TemporaryDirectory() as folder:
        kinds = KindsOfDataset(Path(folder))
        return "".join(f"{kind}\n{kinds.described(kind)}" for kind in KINDS)


def kept(text: str) -> dict[str, str]:
    """Return the texts of all kinds by their names."""
    blocks = re.split(r"^(?=\S)", text, flags=re.MULTILINE)[1:]
    return {kind: block for kind, _, block in (each.partition("\n") for each in blocks)}
