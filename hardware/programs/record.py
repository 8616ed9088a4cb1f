"""Record inputs of a rig."""

from __future__ import annotations

import os
from collections.abc import Sequence

from vibroimpact.analysis.recording import Recording
from vibroimpact.hardware.operations.rig_record import Record
from vibroimpact.hardware.programs.measuring import Describe, Request, measure_into, measured, request_of
from vibroimpact.hardware.rig.acquisition import Facts
from vibroimpact.hardware.rig.measurement import Measurement, measurement_of
from vibroimpact.hardware.rig.opening import Rig


def record(
    rig: str | Rig | None,
    channels: Sequence[str],
    rate: float,
    duration: float | None = None,
    *,
    loopback: Sequence[str] = (),
    calibration: Sequence[str | os.PathLike[str]] = (),
    journal: str | os.PathLike[str] | None = None,
) -> Recording:
    """Record inputs of a rig.

    Parameters
    ----------
    rig : str, Rig or None
        `virtual:RIG.toml`, `grpc://host:port` or `local`, or an open rig; None: the board of this machine.
    channels : sequence of str
        `NAME=TERMINAL[,RANGE]`, the range in V; at most 8.
    rate : float
        Samples per second and channel.
    duration : float or None
        s; None: until Ctrl-C, which ends it and keeps the samples so far.
    loopback : sequence of str
        The same for inputs that an output is wired to.
    calibration : sequence of path
        Files of calibrations: their channels are in m or N, others in V.
    journal : path or None
        File that keeps all samples, during the measurement and after it; None: no file.

    Returns
    -------
    Recording
        Its attribute `ended` is the reason if it is shorter than requested; else empty.

    Raises
    ------
    UsageError, RigError
        The request cannot be met, or the rig failed before there were samples.

    Examples
    --------
    >>> tip = record("virtual:examples/rig/oscillator.toml", ["tip=Dev1/ai0,5"], 5000.0, 0.2).channel("tip")
    >>> len(tip.values), tip.unit, tip.axis.rate
    (1000, 'V', 5000.0)
    """
    request = request_of(channels, loopback, calibration, rate, duration)
    return measured(rig, request, _describer(request), journal=journal)


def record_channels(options: Record) -> None:
    """Record inputs of a rig into a file."""
    request = request_of(
        options.channel, options.loopback or (), options.calibration or (), options.rate, options.duration
    )
    measure_into(options, request, _describer(request))


def _describer(request: Request) -> Describe:
    def describe(rig: Rig, facts: Facts) -> Measurement:
        return measurement_of(
            "record", rig, facts, request.inputs, request.calibrations, loopbacks=request.loopbacks
        )

    return describe
