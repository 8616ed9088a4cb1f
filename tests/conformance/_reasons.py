"""Parts of NI's tests that do not apply to the virtual rig, and the reasons."""

from __future__ import annotations

from fnmatch import fnmatchcase

NOT_RUN = {
    "*digital*": "digital lines: the rig has none",
    "*_di.py": "digital lines: the rig has none",
    "*_do.py": "digital lines: the rig has none",
    "*test_d[io]_channel.py": "digital lines: the rig has none",
    "*_c[io].py": "counters: the rig has none",
    "*test_c[io]_channel.py": "counters: the rig has none",
    "*power_readers*": "power modules: the rig has none",
    "*watchdog*": "watchdog timers: the rig has none",
    "*test_scale*.py": "custom scales: the rig has none",
    "*test_export_signals_properties.py": "exported signals: the rig has no terminals that drive a wire",
}
"""Files that are not run, by a pattern of their paths, and the reasons."""

NOT_MET = {
    "*test_in_stream.py::*[[]3-*": "a simulated device of NI reads the voltage of the channel's range, here 3 V; "
    "the rig reads its plant",
    "*reuse_waveform_in_place*": "a simulated device of NI reads the voltage of the channel's range, here 1 V; "
    "the rig reads its plant",
    "*test_physical_channel.py::*teds*": "sensors with a data sheet (TEDS): the rig has none",
    "*test_device_properties.py::*cal_*": "calibration of the device: the rig has none",
    "*::test___constructed_*": "a device, task, channel or scale by its name in NI's configuration",
    "*get_bool_property___returns_value*": "digital lines: the rig has none",
    "*test_channel_properties.py::*string_property*": "counters: the rig has none",
    "*power_up_states*": "states of outputs at power-up: the rig has none",
    "*hardcoded_error_message*": "the rig words an error in its own way",
    "*add_global_channels*": "asks the driver of this machine, also when the client names a server",
}
"""Tests that are allowed to fail on the rig, by a pattern of their names, and the reasons."""


def reason_not_run(path: str) -> str | None:
    """Return the reason why a file of tests is not run; None if it runs."""
    return next((why for pattern, why in NOT_RUN.items() if fnmatchcase(path, pattern)), None)


def reason_not_met(test: str) -> str | None:
    """Return the reason why a test may fail on the rig; None if it may not."""
    return next((why for pattern, why in NOT_MET.items() if fnmatchcase(test, pattern)), None)
