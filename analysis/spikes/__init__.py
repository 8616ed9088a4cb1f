"""Spikes: find the impacts and shocks in a measured signal, and measure them (thesis chapter 5).

Start at `spike_report`; `identify` finds spikes, `measure_pulses` measures them.

Examples
--------
>>> import numpy as np
>>> from vibroimpact.analysis.recording import Channel, TimeAxis
>>> time = np.arange(20_000) * 1e-4
>>> force = np.random.default_rng(0).normal(0.0, 0.01, len(time))
>>> for start in (0.3, 0.8, 1.5):
...     inside = (time > start) & (time < start + 0.005)
...     force[inside] += np.sin(np.pi * (time[inside] - start) / 0.005)
>>> cell = Channel("cell", force, "N", TimeAxis(time, 1e-4), np.zeros(len(time), np.uint8))
>>> spikes = spike_report(cell).dataset
>>> spikes.spike_peak.values.round(1), spikes.spike_impulse.values.round(4)  # 2 / pi * 5 ms
(array([1., 1., 1.]), array([0.0032, 0.0032, 0.0032]))
"""

from vibroimpact.analysis.spikes.contact import calibrate, contact_time_measure, impact_velocity
from vibroimpact.analysis.spikes.identify import Identification, SpikeSettings, identify
from vibroimpact.analysis.spikes.pulses import Pulses, measure_pulses
from vibroimpact.analysis.spikes.report import Mechanics, SpikeReport, in_newtons, spike_report

__all__ = [
    "Identification",
    "Mechanics",
    "Pulses",
    "SpikeReport",
    "SpikeSettings",
    "calibrate",
    "contact_time_measure",
    "identify",
    "impact_velocity",
    "in_newtons",
    "measure_pulses",
    "spike_report",
]
