"""Channels from xarray's arrays, and arrays from channels: analyses accept both."""

from __future__ import annotations

import numpy as np
import xarray as xr

from vibroimpact.analysis.recording.channels import Channel, Floats, Quality, TimeAxis
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import DatasetError


def channel_of(signal: Channel | xr.DataArray) -> Channel:
    """Return a signal as a channel.

    Parameters
    ----------
    signal : Channel or xarray.DataArray
        An array has one dimension with its instants as coordinate. Instants are numbers in seconds or in the unit of
        the coordinate's `units` (`1` in a nondimensional run), or times of NumPy. The attribute `units` of the array is
        its unit; without it, the array is a pure number. NaN samples count as missing.

    Raises
    ------
    DatasetError
        The array has another shape, no instants, or instants that do not ascend; with its name.

    Examples
    --------
    >>> time = np.linspace(0.0, 1.0, 5)
    >>> tip = channel_of(xr.DataArray(time**2, {"time": time}, name="tip", attrs={"units": "mm"}))
    >>> tip.name, tip.unit, tip.axis.interval
    ('tip', '0.001 m', 0.25)
    """
    if isinstance(signal, Channel):
        return signal
    if not isinstance(signal, xr.DataArray):
        raise DatasetError(
            f"signal: expected a Channel or an xarray.DataArray, got {type(signal).__name__}. "
            'Give arrays their instants: xarray.DataArray(values, {"time": time}).'
        )
    name = str(signal.name) if signal.name is not None else "signal"
    if signal.ndim != 1 or signal.size < 2:
        raise DatasetError(
            f"{name}: expected two samples or more along one dimension, got the shape {signal.shape}."
        )
    values = _numbers(signal, name)
    time = _instants(signal, name)
    if not np.all(np.diff(time) > 0.0):
        raise DatasetError(
            f"{name}: time: expected finite instants that ascend, got others. Sort the array by time."
        )
    quality = np.where(np.isfinite(values), 0, Quality.missing).astype(np.uint8)
    unit = measured_unit(str(signal.attrs.get("units", "1"))).cf
    label = str(signal.attrs.get("long_name", ""))
    return Channel(name, values, unit, TimeAxis.through(time), quality, label)


def array_of(channel: Channel) -> xr.DataArray:
    """Return a channel as an array along `time` (s); samples that are not plain measurements are NaN.

    Examples
    --------
    >>> time = np.arange(3.0)
    >>> tip = Channel("tip", time, "m", TimeAxis(time, 1.0), np.array([0, 0, 1], np.uint8))
    >>> array_of(tip).values
    array([ 0.,  1., nan])
    """
    seconds = xr.Variable("time", channel.time, {"units": "s", "long_name": "time"})
    attributes = {"units": channel.unit, "long_name": channel.label or channel.name}
    values = np.where(channel.good, channel.values, np.nan)
    return xr.DataArray(values, {"time": seconds}, ["time"], channel.name, attributes)


def _numbers(signal: xr.DataArray, name: str) -> Floats:
    if signal.dtype.kind not in "fiub":
        raise DatasetError(f"{name}: expected real numbers, got values of the type {signal.dtype}.")
    return np.asarray(signal.values, dtype=np.float64)


def _instants(signal: xr.DataArray, name: str) -> Floats:
    """Return the instants of an array, s: its own coordinate, or the coordinate called `time`."""
    (dimension,) = signal.dims
    along = [str(key) for key, each in signal.coords.items() if each.dims == (dimension,)]
    chosen = dimension if dimension in along else "time" if "time" in along else None
    if chosen is None:
        raise DatasetError(
            f"{name}: expected a coordinate with the instants of its samples, got none along {dimension}. "
            "Add one: signal.assign_coords(time=...)."
        )
    time = signal.coords[chosen]
    if time.dtype.kind in "mM":
        return np.asarray((time.values - time.values[0]) / np.timedelta64(1, "ns"), dtype=np.float64) * 1e-9
    if time.dtype.kind not in "fiu":
        raise DatasetError(f"{name}: {chosen}: expected instants, got values of the type {time.dtype}.")
    unit = measured_unit(str(time.attrs.get("units", "s")))
    # without units, as in a nondimensional run, time is in the unit of the motion
    if unit.si not in ("s", "1"):
        raise DatasetError(f"{name}: {chosen}: expected instants in seconds, got the unit {unit.label}.")
    return np.asarray(time.values, dtype=np.float64) * unit.factor
