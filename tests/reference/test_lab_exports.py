"""Small exports in the style of instruments and loggers, next to the checkout: each has one right reading."""

from __future__ import annotations

import numpy as np
import pytest
from support.real_data import trial_folder

from vibroimpact.analysis.recording import Quality
from vibroimpact.hardware.recordings import import_recording

# file, rate (Hz), channels: name, unit, number of samples, first value
EXPORTS = [
    ("acceleration_mg.csv", 500.0, [("acceleration", "0.00980665 m s-2", 200, 0.18905)]),
    ("ampm.csv", 1.0, [("weg", "0.001 m", 59, 0.02041)]),
    ("benchlink.csv", 10.0, [("channel_101", "V", 59, 0.02041), ("channel_102", "V", 59, 0.04082)]),
    ("comma_in_header.csv", 500.0, [("acc_tip", "m s-2", 59, 0.02041), ("force_stop", "N", 59, 0.02041)]),
    ("displacement_mils.csv", 500.0, [("displacement", "2.54e-05 m", 200, 0.18905)]),
    ("dmy_midnight.csv", 1.0, [("weg", "0.001 m", 59, 0.02041)]),
    ("dst_offset.csv", 1.0 / 60.0, [("weg", "0.001 m", 59, 0.02041)]),
    ("excel_days.csv", 500.0, [("acc", "9.80665 m s-2", 59, 0.02041)]),
    ("five_samples.csv", 1000.0, [("a", "9.80665 m s-2", 5, 0.1)]),
    ("french_thousands.csv", 500.0, [("force", "N", 59, 61.23)]),
    ("hms_midnight.csv", 1.0, [("weg", "0.001 m", 400, 0.02041)]),
    ("index_time.csv", 500.0, [("acc", "9.80665 m s-2", 59, 0.02041)]),
    ("int_thousand_dot.csv", 500.0, [("druck", "Pa", 59, 101325.0)]),
    ("keysight.csv", 2500.0, [("channel_1", "V", 58, 0.02041), ("channel_2", "V", 58, 0.04082)]),
    ("millis.csv", 500.0, [("acc_x", "1", 59, 0.02041), ("acc_y", "1", 59, 0.02041)]),
    ("mmss.csv", 10.0, [("weg", "0.001 m", 59, 0.02041)]),
    ("ms_no_unit.csv", 500.0, [("acc", "1", 59, 0.02041)]),
    ("picoscope.csv", 2500.0, [("channel_a", "0.001 V", 57, 20.41), ("channel_b", "V", 57, 0.04082)]),
    ("quoted_comma.csv", 500.0, [("kraft", "N", 59, 0.02041)]),
    ("rigol.csv", 2500.0, [("ch1", "V", 58, 0.02041), ("ch2", "V", 58, 0.04082)]),
    ("tek_tds.csv", 2500.0, [("ch1", "V", 60, 0.02041)]),
    ("testo.csv", 1.0, [("m_s", "m s-2", 59, 0.02041), ("c", "degree_Celsius", 59, 20.02)]),
    ("timestamp_ms.csv", 500.0, [("acc", "1", 59, 0.02041)]),
    ("trailing_stats.csv", 500.0, [("acc", "9.80665 m s-2", 400, 0.02041)]),
    ("unicode_minus.csv", 500.0, [("f", "N", 59, 0.02041)]),
    ("zeit_ms.csv", 500.0, [("weg", "0.001 m", 59, 0.02041)]),
]


@pytest.mark.parametrize(("name", "rate", "channels"), EXPORTS, ids=[name for name, _, _ in EXPORTS])
def test_an_everyday_export_is_read_as_it_was_meant(
    name: str, rate: float, channels: list[tuple[str, str, int, float]]
) -> None:
    recording = import_recording(trial_folder("lab") / name)
    found = [(one.name, one.unit, one.values.size, one.values[0]) for one in recording.channels.values()]
    assert found == channels
    for channel in recording.channels.values():
        assert channel.axis.interval == pytest.approx(1.0 / rate, rel=1e-6)
    assert not recording.events


def test_pairs_of_instants_and_values_have_an_axis_each() -> None:
    channels = import_recording(trial_folder("lab") / "xy_pairs.csv").channels
    assert [(name, one.values.size) for name, one in channels.items()] == [("a1", 400), ("a2", 800)]
    assert [one.axis.rate for one in channels.values()] == pytest.approx([500.0, 1000.0])


def test_the_infinity_of_a_scope_is_overrange() -> None:
    channel = import_recording(trial_folder("lab") / "picoscope.csv").channels["channel_a"]
    beyond = channel.quality & np.uint8(Quality.overrange) != 0
    assert int(beyond.sum()) == 3
    assert np.isnan(channel.values[beyond]).all()
