"""TDMS files, written here with npTDMS."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from vibroimpact.analysis.recording import Quality
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.recordings import import_recording

WAVEFORM = {"wf_increment": 0.001, "wf_start_offset": 0.0, "unit_string": "m/s^2"}


def channel(name: str, values: Any, group: str = "run", **properties: Any) -> ChannelObject:
    known: Mapping[str, Any] = {**WAVEFORM, **properties}
    return ChannelObject(group, name, np.asarray(values), {k: v for k, v in known.items() if v is not None})


def written(folder: Path, *segments: list[ChannelObject]) -> Path:
    path = folder / "record.tdms"
    with TdmsWriter(path) as writer:
        for channels in segments:
            writer.write_segment([RootObject({"name": "bench"}), GroupObject("run"), *channels])
    return path


def test_blocks_of_a_channel_follow_each_other_whatever_wf_samples_says(tmp_path: Path) -> None:
    blocks = [[channel("base", np.arange(100.0) + 100 * k, wf_samples=100)] for k in range(3)]
    recording = import_recording([written(tmp_path, *blocks)])
    base = recording.channels["base"]
    np.testing.assert_array_equal(base.values, np.arange(300.0))
    assert (base.axis.interval, base.unit) == (0.001, "m s-2")
    assert "wf_samples is the size of a block" in "\n".join(recording.remarks)


def test_the_epoch_of_1904_is_no_date(tmp_path: Path) -> None:
    relative = [channel("base", np.arange(9.0), wf_start_time=np.datetime64("1904-01-01T00:00:00"))]
    recording = import_recording([written(tmp_path, relative)])
    assert "source_date" not in recording.attrs
    assert "time is relative" in "\n".join(recording.remarks)
    dated = [channel("base", np.arange(9.0), wf_start_time=np.datetime64("2026-07-30T10:00:00"))]
    assert import_recording([written(tmp_path, dated)]).attrs["source_date"].startswith("2026-07-30T10:00:00")


def test_channels_that_began_later_stand_later(tmp_path: Path) -> None:
    begins = np.datetime64("2026-07-30T10:00:00.000000")
    channels = [
        channel("base", np.arange(9.0), wf_start_time=begins),
        channel("board", np.arange(9.0), wf_start_time=begins + np.timedelta64(250, "ms")),
    ]
    recording = import_recording([written(tmp_path, channels)])
    assert recording.channels["base"].axis.time[0] == 0.0
    assert recording.channels["board"].axis.time[0] == pytest.approx(0.25, abs=1e-9)
    assert recording.channels["base"].axis.trigger != recording.channels["board"].axis.trigger


def test_a_channel_of_dates_gives_the_instants(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-07-30T10:00:00.000000") + np.arange(20) * np.timedelta64(500, "us")
    channels = [
        channel("clock", stamps, wf_increment=None, unit_string=None),
        channel("base", np.arange(20.0), wf_increment=None),
    ]
    axis = import_recording([written(tmp_path, channels)]).channels["base"].axis
    assert axis.interval == pytest.approx(5e-4, rel=1e-6)


def test_words_are_left_out_and_infinities_are_overrange(tmp_path: Path) -> None:
    values = np.arange(20.0)
    values[[4, 5]] = np.inf
    values[7] = np.nan
    channels = [channel("base", values), ChannelObject("run", "notes", np.array(["a", "b"]))]
    recording = import_recording([written(tmp_path, channels)])
    assert recording.channels["base"].quality[[4, 5, 7]].tolist() == [4, 4, int(Quality.missing)]
    assert "notes: its values are no numbers" in "\n".join(recording.remarks)


def test_raw_integers_at_the_end_of_their_range_are_clipped(tmp_path: Path) -> None:
    raw = np.round(40000 * np.sin(np.arange(200) / 7.0)).clip(-32768, 32767).astype(np.int16)
    scale = {
        "NI_Number_Of_Scales": np.uint32(1),
        "NI_Scaling_Status": "unscaled",
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 1.0,
        "NI_Scale[0]_Linear_Input_Source": np.uint32(0xFFFFFFFF),
    }
    base = import_recording([written(tmp_path, [channel("base", raw, **scale)])]).channels["base"]
    np.testing.assert_allclose(base.values, raw * 0.5 + 1.0)
    assert (base.quality == 1).sum() == np.sum((raw == 32767) | (raw == -32768)) > 10


def test_without_an_interval_the_rate_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, [channel("base", np.sin(np.arange(30.0)), wf_increment=None)])
    with pytest.raises(DatasetError, match="Give rate "):
        import_recording([path])


def test_a_file_that_is_cut_off_is_told_or_refused(tmp_path: Path) -> None:
    path = written(tmp_path, [channel("base", np.arange(500.0))])
    whole = path.read_bytes()
    path.write_bytes(whole[:-800])
    recording = import_recording([path])
    assert len(recording.channels["base"].values) == 400
    assert ["cut off" in line for line in recording.remarks] == [True]
    path.write_bytes(whole[:60])
    with pytest.raises(DatasetError, match=r"record\.tdms: expected"):
        import_recording([path])


def test_decimated_copies_of_signal_express_are_left_out_and_named(tmp_path: Path) -> None:
    path = tmp_path / "record.tdms"
    groups = []
    for level, samples in ((0, 200), (1, 20), (2, 4)):
        name = f"Voltage - level {level}"
        groups += [
            GroupObject(name, {"DecimationLevel": level}),
            channel("ai0", np.arange(float(samples)), name),
        ]
    with TdmsWriter(path) as writer:
        writer.write_segment(groups)
    recording = import_recording([path])
    assert [len(one.values) for one in recording.channels.values()] == [200]
    told = "decimated copies of the samples are left out: Voltage - level 1, Voltage - level 2"
    assert told in recording.remarks


@pytest.mark.parametrize("late", [0, 250])
def test_groups_that_began_at_the_same_instant_have_one_trigger(tmp_path: Path, late: int) -> None:
    begins = np.datetime64("2026-07-30T10:00:00.000000")
    starts = [begins, begins + np.timedelta64(late, "ms"), begins + np.timedelta64(late, "ms")]
    channels = [
        channel("a", np.arange(9.0), group, wf_start_time=start)
        for group, start in zip(("one", "two", "three"), starts, strict=True)
    ]
    recording = import_recording([written(tmp_path, channels)])
    triggers = {one.axis.trigger for one in recording.channels.values()}
    assert len(triggers) == (2 if late else 1)
    assert ("triggers: the lag" in "\n".join(recording.remarks)) == bool(late)


@pytest.mark.parametrize(
    ("known", "said"),
    [
        (
            {"NI_Number_Of_Scales": np.uint32(2**31)},
            "NI_Number_Of_Scales: expected at most 100, got 2147483648",
        ),
        ({"NI_Number_Of_Scales": "9" * 30}, "NI_Number_Of_Scales: expected at most 100, got 9999"),
        ({"NI_Scale[1999999999]_Scale_Type": "Linear"}, "scales: expected at most 100, got 2000000000"),
        (
            {
                "NI_Scale[0]_Scale_Type": "Polynomial",
                "NI_Scale[0]_Polynomial_Coefficients_Size": np.int32(101),
            },
            "Coefficients_Size: expected at most 100, got 101",
        ),
    ],
)
@pytest.mark.parametrize("place", ["channel", "group", "file"])
def test_more_scales_than_a_program_writes_are_refused_before_the_data(
    tmp_path: Path, known: dict[str, Any], said: str, place: str
) -> None:
    """npTDMS loops over that number: a file of 243 bytes took half an hour, one of 6 kB 4.8 GB."""
    own = known if place == "channel" else {}
    objects = [
        RootObject(known if place == "file" else {}),
        GroupObject("run", known if place == "group" else {}),
        channel("base", np.arange(9.0), **own),
    ]
    path = tmp_path / "record.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment(objects)
    with pytest.raises(DatasetError, match=re.escape(said)) as refused:
        import_recording([path])
    assert str(refused.value).startswith(f"{path}: ")


def test_a_hundred_scales_and_a_long_table_are_read(tmp_path: Path) -> None:
    scale: dict[str, Any] = {
        "NI_Number_Of_Scales": np.uint32(1),
        "NI_Scale[0]_Scale_Type": "Table",
        "NI_Scale[0]_Table_Pre_Scaled_Values_Size": 150,
        "NI_Scale[0]_Table_Scaled_Values_Size": 150,
        "NI_Scale[0]_Table_Input_Source": np.uint32(0xFFFFFFFF),
    }
    for place in range(150):
        scale[f"NI_Scale[0]_Table_Pre_Scaled_Values[{place}]"] = float(place)
        scale[f"NI_Scale[0]_Table_Scaled_Values[{place}]"] = 2.0 * place
    base = import_recording([written(tmp_path, [channel("base", np.arange(9.0), **scale)])]).channels["base"]
    np.testing.assert_allclose(base.values, 2.0 * np.arange(9.0))
