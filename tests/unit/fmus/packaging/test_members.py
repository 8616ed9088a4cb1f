"""Members of an export for its user: icon, page, reference result; and the token."""

from __future__ import annotations

import csv
import hashlib
import io
import re
import struct
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import simulate_fmu
from support.component_fmu import VERSIONS
from support.exports import exported

from vibroimpact.fmus import components
from vibroimpact.fmus.packaging.build import read_components
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.trial import FOLDER, MANIFEST, MOST_INTERVALS, RESULT

NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"
#: HTML elements without an end tag.
EMPTY = {"meta", "img"}
ATTRIBUTES_WITH_PLACES = {"href", "src"}


class Page(HTMLParser):
    """Reader of a page: its links, its headings and the cells of its tables; unbalanced elements are an error."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.places: list[str] = []
        self.elements: list[str] = []
        self.open: list[str] = []
        self.cells: list[str] = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self.places += [str(value) for name, value in attrs if name in ATTRIBUTES_WITH_PLACES]
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "td" in self.open:
            self.cells.append(data)


@pytest.fixture(scope="module", params=[(n, f) for n in components() for f in VERSIONS], ids=str)
def archive(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, dict[str, bytes]]:
    name, fmi = request.param
    path = exported(name, tmp_path_factory.mktemp(name) / "x.fmu", fmi=fmi)
    with zipfile.ZipFile(path) as file:
        return path, {member: file.read(member) for member in file.namelist()}


def test_the_page_stands_alone_and_has_every_variable(archive: tuple[Path, dict[str, bytes]]) -> None:
    path, members = archive
    page = Page(members["documentation/index.html"].decode())
    assert not {"script", "link", "iframe"} & set(page.elements)
    assert {"math", "table", "h1", "img"} <= set(page.elements)
    for place in page.places:
        assert not re.match(r"\w+:", place), place
        inside = (Path("/documentation") / place).as_posix()
        assert Path(inside).is_absolute()
        parts: list[str] = []
        for part in Path(inside).parts[1:]:
            parts = parts[:-1] if part == ".." else [*parts, part]
        assert "/".join(parts) in members, place
    names = {v.name for v in read_description(path).modelVariables}
    assert names <= set(page.cells)


def test_the_icon_is_small_and_where_a_tool_looks_for_it(archive: tuple[Path, dict[str, bytes]]) -> None:
    path, members = archive
    three = read_description(path).fmiVersion == "3.0"
    icon = members["terminalsAndIcons/icon.png" if three else "model.png"]
    assert icon.startswith(b"\x89PNG\r\n\x1a\n")
    assert struct.unpack(">II", icon[16:24]) == (160, 160)
    assert len(icon) < 8000
    if three:
        root = ElementTree.fromstring(members["terminalsAndIcons/terminalsAndIcons.xml"])
        assert root.find("GraphicalRepresentation/Icon") is not None


def test_every_component_has_an_icon_of_its_own() -> None:
    icons = {c.source.with_name("icon.png").read_bytes() for c in read_components()}
    assert len(icons) == len(read_components())


def reference(members: dict[str, bytes]) -> tuple[list[str], np.ndarray]:
    header, *rows = csv.reader(io.StringIO(members[f"{FOLDER}/{RESULT}"].decode()))
    return header, np.array(rows, float)


def test_the_reference_result_is_what_fmpy_finds(archive: tuple[Path, dict[str, bytes]]) -> None:
    path, members = archive
    root = ElementTree.fromstring(members[f"{FOLDER}/{MANIFEST}"])
    assert root.get(f"{NAMESPACE}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    (related,) = root.iter("Related")
    assert (related.get("role"), related.get("source")) == ("result", RESULT)
    content = members[f"{FOLDER}/{RESULT}"]
    assert hashlib.sha3_256(content).hexdigest().upper() == related.get("checksum")
    header, rows = reference(members)
    names = header[1:]
    assert len(rows) == MOST_INTERVALS + 1
    assert np.isfinite(rows).all()
    outputs = [v for v in read_description(path).modelVariables if v.causality == "output"]
    continuous = {v.name for v in outputs if v.variability == "continuous"}
    assert set(names) == continuous
    step = (rows[-1, 0] - rows[0, 0]) / MOST_INTERVALS
    found = simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        start_time=rows[0, 0],
        stop_time=rows[-1, 0],
        step_size=step,
        output_interval=step,
        output=names,
    )
    theirs = np.column_stack([found[name] for name in names])[: len(rows)]
    # summed communication points differ by rounding: at a sample the slope jumps
    chosen = [k for k, name in enumerate(names) if not name.endswith("_rate")]
    scale = np.abs(rows[:, 1:]).max(axis=0) + 1e-300
    assert (np.abs(theirs - rows[:, 1:]) / scale)[:, chosen].max() < 1e-6


def test_a_run_that_ends_early_is_kept_as_far_as_it_goes(tmp_path: Path) -> None:
    starts = {"contact[1].law": "restitution", "impact_limit": 3, "velocity_start": 0.1}
    path = export_fmu("oscillator", tmp_path / "x.fmu", starts=starts)
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in (f"{FOLDER}/{MANIFEST}", f"{FOLDER}/{RESULT}")}
    (related,) = ElementTree.fromstring(members[f"{FOLDER}/{MANIFEST}"]).iter("Related")
    assert "impact_limit" in str(related.get("description"))
    assert 2 < len(reference(members)[1]) < MOST_INTERVALS


def test_what_the_library_warns_of_is_told(tmp_path: Path) -> None:
    notes: list[str] = []
    starts = {"thickness": 0.02}
    export_fmu("beam", tmp_path / "x.fmu", starts=starts, note=notes.append)
    (line,) = notes
    assert line.startswith("Beam: modes: mode ")
    assert "Euler-Bernoulli" in line


def test_a_token_is_of_the_component_and_its_end_of_the_export(tmp_path: Path) -> None:
    component = next(c for c in read_components() if c.name == "Oscillator")
    paths = [
        export_fmu("oscillator", tmp_path / f"{place}.fmu", starts={"mass": mass})
        for place, mass in enumerate((1.0, 2.0, 2.0))
    ]
    one, two, again = (str(read_description(path).instantiationToken) for path in paths)
    assert two == again != one
    assert one[:-13] == two[:-13] == component.token[:-13]
    assert len(one) == len(component.token)


def test_many_outputs_have_a_shorter_reference_result(tmp_path: Path) -> None:
    path = export_fmu("chain", tmp_path / "x.fmu", masses=64)
    with zipfile.ZipFile(path) as file:
        header, rows = reference({name: file.read(name) for name in file.namelist()})
    assert len(header) > 150
    assert 20 <= len(rows) < MOST_INTERVALS
    assert path.stat().st_size < 700_000
