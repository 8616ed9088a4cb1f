"""Universal files (UFF 58), written here with pyuff, of text and binary."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from vibroimpact.analysis.recording import Quality
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.formats.uff import read_uff
from vibroimpact.hardware.recordings import ImportSettings, import_recording, sources

TIME = np.arange(200) / 256.0
BASE = 9.81 * np.sin(TIME * 40.0)


def function(name: str, data: Any = BASE, **known: Any) -> dict[str, Any]:
    values = {
        **dict.fromkeys(("binary", "ver_num", "load_case_id", "ref_node", "ref_dir"), 0),
        **dict.fromkeys(("orddenom_spec_data_type", "z_axis_spec_data_type"), 0),
        **dict.fromkeys(("rsp_ent_name", "ref_ent_name", "id2", "id3", "id4", "id5"), "NONE"),
        "id1": name,
        "func_type": 1,
        "rsp_node": 7,
        "rsp_dir": -3,
        "x": TIME[: len(data)],
        "data": np.asarray(data),
        "ord_data_type": 4,
        "num_pts": len(data),
        "abscissa_spacing": 1,
        "abscissa_min": 0.0,
        "abscissa_inc": 1.0 / 256.0,
        "abscissa_spec_data_type": 17,
        "abscissa_axis_units_lab": "s",
        "ordinate_spec_data_type": 12,
        "ordinate_axis_units_lab": "m/s^2",
    }
    return dict(pyuff.prepare_58(**{**values, **known}))


def units(code: int, words: str) -> dict[str, Any]:
    known = {"units_code": code, "units_description": words, "temp_mode": 1, "length": 1.0, "force": 1.0}
    return dict(pyuff.prepare_164(**known, temp=1.0, temp_offset=0.0))


def written(folder: Path, *datasets: dict[str, Any]) -> Path:
    path = folder / "record.uff"
    path.unlink(missing_ok=True)
    pyuff.UFF(str(path)).write_sets(list(datasets), "add")
    return path


# pyuff leaves its file open after writing binary samples
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("binary", [0, 1])
def test_functions_over_time_are_channels_on_one_axis(tmp_path: Path, binary: int) -> None:
    force = function("force", np.cos(TIME), binary=binary, ordinate_axis_units_lab="N")
    recording = import_recording([written(tmp_path, function("acc", binary=binary), force)])
    acc = recording.channels["acc"]
    np.testing.assert_allclose(acc.values, BASE, rtol=1e-11, atol=1e-11)
    assert acc.axis is recording.channels["force"].axis
    assert acc.axis.rate == pytest.approx(256.0, rel=1e-5)  # the increment has six digits in the file
    assert (acc.unit, recording.channels["force"].unit) == ("m s-2", "N")


def test_a_rate_does_not_make_a_table_of_a_universal_file(tmp_path: Path) -> None:
    recording = import_recording([written(tmp_path, function("acc"))], ImportSettings(rate=256.0))
    assert list(recording.channels) == ["acc"]
    np.testing.assert_allclose(recording.channels["acc"].values, BASE, rtol=1e-11, atol=1e-11)


def test_instants_of_their_own_are_kept_and_shared(tmp_path: Path) -> None:
    uneven = np.cumsum(np.linspace(0.01, 0.02, 200))
    known = {"abscissa_spacing": 0, "x": uneven, "abscissa_inc": 0.0}
    recording = import_recording([written(tmp_path, function("a", **known), function("b", **known))])
    np.testing.assert_allclose(recording.channels["a"].axis.time, uneven, rtol=1e-5)
    assert recording.channels["a"].axis is recording.channels["b"].axis


def test_what_is_no_function_over_time_is_left_out_and_named(tmp_path: Path) -> None:
    response = function("H1", func_type=4, abscissa_spec_data_type=18)
    recording = import_recording([written(tmp_path, function("acc"), response)])
    assert list(recording.channels) == ["acc"]
    assert "H1: a frequency response, is left out; functions over time are read" in recording.remarks
    with pytest.raises(DatasetError, match=r"functions over time \(dataset 58\).*H1: a frequency response"):
        import_recording([written(tmp_path, response)])


def test_units_come_from_the_label_then_from_the_units_of_the_file(tmp_path: Path) -> None:
    plain = function("acc", ordinate_axis_units_lab="NONE")
    assert import_recording([written(tmp_path, units(1, "SI"), plain)]).channels["acc"].unit == "m s-2"
    recording = import_recording([written(tmp_path, units(5, "mm, N"), plain)])
    assert recording.channels["acc"].unit == "1"
    assert "the units of the file are 'mm, N', not SI (unit)" in recording.remarks


def test_functions_of_one_name_are_told_apart_by_their_place(tmp_path: Path) -> None:
    names = [function("run", rsp_node=node) for node in (7, 12)]
    recording = import_recording([written(tmp_path, *names)])
    assert [channel.label for channel in recording.channels.values()] == ["run 7-Z", "run 12-Z"]


def test_markers_of_overrange_are_markers_in_this_format_too(tmp_path: Path) -> None:
    driven = BASE.copy()
    driven[5] = 9.9e37
    recording = import_recording([written(tmp_path, function("acc", driven))])
    assert recording.channels["acc"].quality[5] == Quality.overrange


def test_a_file_that_was_cut_off_is_said_or_refused_in_one_line(tmp_path: Path) -> None:
    path = written(tmp_path, function("acc"), function("force"))
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 3 // 4])
    recording = import_recording([path])
    assert list(recording.channels) == ["acc"]
    assert recording.remarks[0] == "the file is cut off: its last dataset has no end, and is left out"
    path.write_bytes(content[: len(content) // 4])
    with pytest.raises(DatasetError, match="cut off") as refused:
        import_recording([path])
    assert "\n" not in str(refused.value)


def test_a_header_that_promises_more_samples_than_there_are_is_said(tmp_path: Path) -> None:
    path = written(tmp_path, function("acc"))
    path.write_bytes(
        path.read_bytes().replace(b"         4       200         1", b"         4 999999999         1")
    )
    recording = import_recording([path])
    assert len(recording.channels["acc"].values) == 200
    assert "acc: the header says 999999999 samples, the file has 200" in recording.remarks


def test_a_package_that_is_missing_is_named_with_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, function("acc"))
    monkeypatch.setattr(sources, "read_file", read_raw)  # in this process
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(DatasetError) as refused:
        import_recording([path], ImportSettings(rate=256.0))
    told = str(refused.value)
    assert "pip install 'vibroimpact[uff]'" in told
    assert "pip install '.[uff]'" in told


def test_a_function_that_ends_before_its_samples_is_refused_by_name(tmp_path: Path) -> None:
    """pyuff then has no samples at all, which once led to a KeyError."""
    path = tmp_path / "record.uff"
    axes = (
        "        17    0    0    0 Time                 s\n"
        + "        12    0    0    0 a                    m\n"
    ) + ("         0    0    0    0 NONE                 NONE\n" * 2)
    path.write_text(
        "    -1\n    58b     1     2          11        16     0     0           0           0\n"
        + f"{'':80}\n" * 5
        + "    1         0    0         0 base               1   3 NONE               0   0\n"
        + "         9         2         1  0.00000e+00  1.00000e-02  0.00000e+00\n"
        + axes
        + "  0.00000e+00  0.00000e+00\n    -1\n"
    )
    with pytest.raises(DatasetError, match="a function without samples") as refused:
        import_recording([path])
    assert str(refused.value).startswith(f"{path}: expected a universal file (UFF) with functions over time")


@pytest.mark.parametrize("lines", range(3, 14))
def test_a_universal_file_cut_after_any_line_of_its_head_is_refused(tmp_path: Path, lines: int) -> None:
    path = written(tmp_path, function("base"))
    head = path.read_text().splitlines(keepends=True)[:lines]
    for end in ("", "    -1\n"):
        path.write_text("".join(head) + end)
        with pytest.raises(DatasetError, match=r"record\.uff: expected"):
            import_recording([path])


def test_functions_of_one_set_of_instants_share_a_table_and_others_have_their_own(tmp_path: Path) -> None:
    uneven = np.cumsum(1.0 + 0.25 * np.arange(9.0))
    kinds = {"abscissa_spacing": 0, "data": BASE[:9]}
    sets = [
        function("a", **kinds, x=uneven),
        function("b", **kinds, x=2.0 * uneven),
        function("c", **kinds, x=uneven),
    ]
    first, second = read_uff(written(tmp_path, *sets)).tables
    assert [column.label for column in first.columns] == ["a", "c"]
    assert [column.label for column in second.columns] == ["b"]
    np.testing.assert_allclose(second.time.values, 2.0 * uneven, rtol=1e-5)
