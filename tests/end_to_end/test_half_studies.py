"""Every study saves its results when Ctrl-C or a failure ends it half way: printed, written, and announced."""

from __future__ import annotations

import itertools
import pkgutil
import signal
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from support.command_line import ENTRY, in_this_process
from support.dataset_kinds import KindsOfDataset
from support.operations import OPERATIONS

from vibroimpact.analysis.study import INCOMPLETE, Study
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.orbits.basins import BasinsOfScene

STUDIES: dict[str, type[Study[Any]]] = {
    words: pkgutil.resolve_name(f"vibroimpact.{one.study}") for words, one in OPERATIONS.items() if one.study
}
PREPARED: dict[str, type[Study[Any]]] = {"basins": BasinsOfScene}
"""Studies that take the place of those of the operations for the datasets here."""
CASES = {
    "accuracy": ("accuracy", 3),
    "basins": ("basins", 2),
    "classify": ("classes", 2),
    "control": ("control", 1),
    "diagram": ("diagram", 3),
    "effects": ("effects", 2),
    "energies": ("energies", 2),
    "follow": ("branches", 5),
    "hard-cases": ("hard cases", 1),
    "lyapunov": ("Lyapunov exponents", 1),
    "maps": ("map of sets", 1),
    "orbit": ("orbits", 1),
    "resonances": ("resonances", 6),
    "sensitivity": ("sensitivity", 1),
    "transients": ("transients", 3),
}
"""For each study: a kind of dataset that it makes, and the number of rows after which it ends."""


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> KindsOfDataset:
    return KindsOfDataset(tmp_path_factory.mktemp("kinds"))


@pytest.fixture
def ends_after(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int, BaseException], None]:
    """Return a function that ends a study by an exception after some rows."""

    def ends(words: str, many: int, end: BaseException) -> None:
        kind = PREPARED.get(words, STUDIES[words])
        rows = kind.rows

        def few(self: Study[Any]) -> Generator[Any, None, None]:
            with closing(rows(self)) as found:
                yield from itertools.islice(found, many)
            raise end

        monkeypatch.setattr(kind, "rows", few)

    return ends


Ends = Callable[[str, int, BaseException], None]


def test_every_study_has_a_case() -> None:
    assert CASES.keys() == STUDIES.keys()


@pytest.mark.parametrize("words", CASES)
def test_an_interrupted_study_prints_and_writes_what_it_found(
    words: str, kinds: KindsOfDataset, ends_after: Ends, tmp_path: Path
) -> None:
    kind, many = CASES[words]
    given = kinds.arguments(kind)
    ends_after(words, many, KeyboardInterrupt())
    output, figure = tmp_path / "half.nc", tmp_path / "half.png"
    done = in_this_process(*given, "-o", output, "--figure", figure)
    assert done.returncode == 130, done.stderr
    assert done.stderr.splitlines()[-1].startswith("Interrupted: ")
    assert "Dataset written to" in done.stdout
    assert figure.exists() or f"{figure} is not written: " in done.stderr
    with xr.open_dataset(output, engine="netcdf4") as found:
        assert found.attrs[INCOMPLETE] == "interrupted"


@pytest.mark.parametrize("words", CASES)
def test_a_study_that_fails_prints_and_writes_what_it_found_then_its_error(
    words: str, kinds: KindsOfDataset, ends_after: Ends, tmp_path: Path
) -> None:
    kind, many = CASES[words]
    given = kinds.arguments(kind)
    ends_after(words, many, ComponentError("body: it broke."))
    done = in_this_process(*given, "-o", tmp_path / "half.nc")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "body: it broke."
    assert "Dataset written to" in done.stdout
    with xr.open_dataset(tmp_path / "half.nc", engine="netcdf4") as found:
        assert found.attrs[INCOMPLETE] == "failed: body: it broke."


@pytest.mark.parametrize("words", CASES)
def test_a_study_that_is_interrupted_before_its_first_row_says_so_and_writes_nothing(
    words: str, kinds: KindsOfDataset, ends_after: Ends, tmp_path: Path
) -> None:
    given = kinds.arguments(CASES[words][0])
    ends_after(words, 0, KeyboardInterrupt())
    done = in_this_process(*given, "-o", tmp_path / "half.nc")
    assert done.returncode == 130
    assert done.stderr.splitlines()[-1].startswith(f"{words}: interrupted before there was a")
    assert not (tmp_path / "half.nc").exists()


@pytest.mark.parametrize(
    ("words", "stream"), [("accuracy forced.toml --budget 90", "stdout"), ("hard-cases", "stderr")]
)
def test_the_slowest_studies_hear_ctrl_c(
    words: str, stream: str, kinds: KindsOfDataset, tmp_path: Path
) -> None:
    """The signal comes once two rows are reported; the study ends by itself, with its results so far."""
    name, *rest = words.split()
    scene = kinds.arguments("effects")[1]
    given = [str(scene) if word == "forced.toml" else word for word in rest]
    output = tmp_path / "half.nc"
    command = [sys.executable, "-c", ENTRY, name, *given, "-o", str(output)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        lines = getattr(process, stream)
        while not all(lines.readline() for _ in range(2)):
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "Interrupted: " in err
    assert f"Dataset written to {output}." in out
    with xr.open_dataset(output, engine="netcdf4") as found:
        assert found.attrs[INCOMPLETE] == "interrupted"
