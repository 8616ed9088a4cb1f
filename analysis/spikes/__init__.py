"""Spikes: find the impacts and shocks in a measured signal, and measure them (thesis chapter 5).

Start at `spike_report`; `identify` finds spikes, `measure_pulses` measures them.
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
