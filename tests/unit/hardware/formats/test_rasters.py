"""Matrices of 0 and 1 as event trains: trials of a raster, with a rate or a column of instants."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from vibroimpact.analysis.recording import open_recording, write_recording
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.recordings import ImportSettings, import_recording

SPIKES = ((3, 40, 41 + 20, 199), (7, 90, 150), (0, 120))
AS_EVENTS = "the columns hold 0 and 1 only: an event train each"


def trials(*runs: Any) -> Any:
    """Return a raster, shape (trial, sample), with ones at the given samples."""
    found = np.zeros((len(runs), 200))
    for row, places in zip(found, runs, strict=True):
        row[list(places)] = 1.0
    return found


def matlab(folder: Path, **variables: Any) -> Path:
    path = folder / "raster.mat"
    savemat(path, variables)
    return path


@pytest.mark.parametrize("clock", [{"fs": 500.0}, {"dt": 0.002}, {"t": np.arange(200) * 0.002}])
@pytest.mark.parametrize("turned", [False, True])
def test_trials_are_event_trains_on_the_grid_of_their_samples(
    tmp_path: Path, clock: dict[str, Any], turned: bool
) -> None:
    raster = trials(*SPIKES)
    recording = import_recording([matlab(tmp_path, raster=raster.T if turned else raster, **clock)])
    assert not recording.channels
    assert list(recording.events) == ["raster_1", "raster_2", "raster_3"]
    for train, places in zip(recording.events.values(), SPIKES, strict=True):
        np.testing.assert_allclose(train.times, np.array(places) * 0.002, atol=1e-12)
        assert train.window == pytest.approx((0.0, 199 * 0.002))
        assert train.resolution == pytest.approx(0.002)
    assert AS_EVENTS in "\n".join(recording.remarks)
    write_recording(recording, tmp_path / "raster.nc")
    assert list(open_recording(tmp_path / "raster.nc").events) == list(recording.events)


def test_a_table_of_text_with_a_rate_or_instants_is_a_raster_too(tmp_path: Path) -> None:
    path, raster = tmp_path / "raster.csv", trials(*SPIKES).T
    path.write_text("a,b,c\n" + "".join(",".join(f"{one:.0f}" for one in row) + "\n" for row in raster))
    by_rate = import_recording([path], ImportSettings(rate=500.0)).events
    path.write_text(
        "t,a,b,c\n"
        + "".join(f"{k / 500:.3f},{a:.0f},{b:.0f},{c:.0f}\n" for k, (a, b, c) in enumerate(raster))
    )
    by_instants = import_recording([path]).events
    for events in (by_rate, by_instants):
        assert [train.times.size for train in events.values()] == [4, 3, 2]
    path.write_text("a,b\n" + "".join(f"{a:.0f},{b:.0f}\n" for a, b, _ in raster))
    with pytest.raises(DatasetError, match="Give rate "):
        import_recording([path])


def test_the_user_can_keep_them_as_channels(tmp_path: Path) -> None:
    path = matlab(tmp_path, raster=trials(*SPIKES), fs=500.0)
    recording = import_recording([path], ImportSettings(events=False))
    assert len(recording.channels) == 3
    assert not recording.events


def test_the_level_of_a_switch_is_a_channel_unless_the_user_says_events(tmp_path: Path) -> None:
    path = matlab(tmp_path, switch=trials((10, 11, 12, 13, 90, 91)), fs=500.0)
    assert list(import_recording([path]).channels) == ["switch"]
    train = import_recording([path], ImportSettings(events=True)).events["switch"]
    np.testing.assert_allclose(train.times, [0.02, 0.18])


def test_a_digital_line_beside_an_analog_channel_stays_a_channel(tmp_path: Path) -> None:
    path = matlab(tmp_path, line=trials((10, 90)), acc=np.sin(np.arange(200) / 9.0), fs=500.0)
    recording = import_recording([path])
    assert sorted(recording.channels) == ["acc", "line"]


def test_a_trial_without_events_is_left_out_and_named(tmp_path: Path) -> None:
    recording = import_recording([matlab(tmp_path, raster=trials((3, 40), ()), fs=500.0)])
    assert list(recording.events) == ["raster_1"]
    assert "raster_2: has no event, and is left out" in recording.remarks


def test_a_window_that_leaves_events_out_is_refused(tmp_path: Path) -> None:
    path = matlab(tmp_path, raster=trials(*SPIKES), fs=500.0)
    with pytest.raises(DatasetError, match=r"raster_1: expected events from 0\.1 to 0\.3 s"):
        import_recording([path], ImportSettings(window=(0.1, 0.3)))
