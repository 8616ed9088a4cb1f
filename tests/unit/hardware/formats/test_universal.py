"""Frequency responses, spectra, shapes and geometry of universal files, written with pyuff, equal to what it reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.universal import read_universal
from vibroimpact.hardware.recordings import import_recording

FREQUENCY = np.arange(1.0, 101.0) * 0.5
RECEPTANCE = 1.0 / (900.0 - FREQUENCY**2 + 2j * FREQUENCY)


def function(kind: int, data: Any, unit: str) -> dict[str, Any]:
    known = {
        **dict.fromkeys(("binary", "ver_num", "load_case_id", "z_axis_spec_data_type"), 0),
        **dict.fromkeys(("rsp_ent_name", "ref_ent_name", "id2", "id3", "id4", "id5"), "NONE"),
        **{"id1": "H1", "func_type": kind, "rsp_node": 7, "rsp_dir": -3, "ref_node": 2, "ref_dir": 1},
        **{"x": FREQUENCY, "data": data, "num_pts": len(data), "abscissa_spacing": 1},
        **{
            "abscissa_min": 0.5,
            "abscissa_inc": 0.5,
            "abscissa_spec_data_type": 18,
            "abscissa_axis_units_lab": "Hz",
        },
        **{"ord_data_type": 6 if np.iscomplexobj(data) else 4, "ordinate_spec_data_type": 12},
        **{"ordinate_axis_units_lab": unit, "orddenom_spec_data_type": 13, "orddenom_axis_units_lab": "N"},
    }
    return dict(pyuff.prepare_58(**known))


def shape(number: int, is_complex: bool) -> dict[str, Any]:
    turned = 1.0 + 0.25j if is_complex else 1.0
    values = {f"r{axis}": np.array([0.1, -0.2, 0.3]) * axis * number * turned for axis in (1, 2, 3)}
    known = {
        **{f"id{line}": "NONE" for line in range(2, 6)},
        **{"id1": f"mode {number}", "model_type": 1, "data_ch": 2, "spec_data_type": 8, "n_data_per_node": 3},
        **{"analysis_type": 3 if is_complex else 2, "data_type": 5 if is_complex else 2},
        **{"node_nums": [1, 2, 7], "load_case": 1, "mode_n": number, **values},
    }
    modal = {"freq": 12.5 * number, "modal_m": 1.0, "modal_damp_vis": 0.01, "modal_damp_his": 0.0}
    complex_ones = {"eig": -0.5 + 78.5j, "modal_a": 1.0 + 0j, "modal_b": 1.0 + 0j}
    return dict(pyuff.prepare_55(**known, **(complex_ones if is_complex else modal)))


def geometry(kind: int, labels: list[int]) -> dict[str, Any]:
    prepare = pyuff.prepare_15 if kind == 15 else pyuff.prepare_2411
    count = len(labels)
    same = {key: [0] * count for key in ("def_cs", "disp_cs", "color")}
    places = {key: np.arange(count) * 0.25 + at for at, key in enumerate("xyz")}
    return dict(prepare(node_nums=labels, **same, **places))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "modal.uff"
    trace = pyuff.prepare_82(trace_num=3, n_nodes=4, color=1, id="outline", nodes=np.array([1, 2, 0, 7]))
    datasets = [
        function(4, RECEPTANCE, "m/s^2"), function(9, np.abs(RECEPTANCE) ** 2, "m^2/s^4/Hz"), shape(1, False),
        shape(2, True), geometry(15, [1, 2]), geometry(2411, [7]), dict(trace),
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(datasets, "add")
    return path


def test_responses_and_spectra_are_what_pyuff_reads(path: Path) -> None:
    response, density = read_universal(path).functions
    known = [found for found in pyuff.UFF(str(path)).read_sets() if found["type"] == 58]
    for found, one in zip(known, (response, density), strict=True):
        np.testing.assert_array_equal(one.values, found["data"])
        np.testing.assert_array_equal(one.abscissa, found["x"])
    assert (response.kind, density.kind) == ("a frequency response", "a power spectral density")
    assert (response.unit, response.per_unit, response.abscissa_unit) == ("m/s^2", "N", "Hz")
    assert (response.response.node, response.response.direction) == (7, "-Z")
    assert (response.reference.node, response.reference.direction) == (2, "+X")
    np.testing.assert_allclose(response.values, RECEPTANCE, rtol=1e-10)


def test_shapes_have_their_nodes_frequencies_and_damping(path: Path) -> None:
    normal, damped = read_universal(path).shapes
    known = [found for found in pyuff.UFF(str(path)).read_sets() if found["type"] == 55]
    for found, one in zip(known, (normal, damped), strict=True):
        np.testing.assert_array_equal(one.values, np.column_stack([found["r1"], found["r2"], found["r3"]]))
        assert one.nodes.tolist() == [1, 2, 7]
    assert (normal.kind, normal.number, normal.frequency, normal.damping_ratio) == (
        "a normal mode",
        1,
        12.5,
        0.01,
    )
    assert (damped.kind, damped.eigenvalue) == ("a complex mode", -0.5 + 78.5j)
    assert np.isnan(damped.frequency)


def test_nodes_of_both_datasets_and_the_lines_between_them_are_read(path: Path) -> None:
    found = read_universal(path)
    assert found.nodes.tolist() == [1, 2, 7]
    np.testing.assert_allclose(found.coordinates, [[0.0, 1.0, 2.0], [0.25, 1.25, 2.25], [0.0, 1.0, 2.0]])
    assert {name: nodes.tolist() for name, nodes in found.traces.items()} == {"outline 3": [1, 2, 0, 7]}


def test_an_import_says_what_such_a_file_has_and_what_reads_it(path: Path) -> None:
    with pytest.raises(
        DatasetError, match=r"a frequency response.*hardware\.formats.universal\.read_universal reads"
    ):
        import_recording(path)


def test_a_file_that_is_cut_off_is_refused(path: Path) -> None:
    content = path.read_bytes()
    for share in (0.3, 0.6, 0.95):
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(DatasetError):
            read_universal(path)
