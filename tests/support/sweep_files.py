"""Sweep files of tests: a rig with a tip, and optional further wiring."""

from __future__ import annotations

from typing import Any

from vibroimpact.hardware.programs.sweep.settings import SweepSettings, parse_sweep

DRIVE = {"name": "drive", "terminal": "Dev1/ai1", "range": 5.0, "role": "drive"}
CELL = {"name": "cell", "terminal": "Dev1/ai2", "range": 5.0, "role": "load_cell", "threshold": 0.5}


def sweep_text(
    frequency: Any = None, *, inputs: tuple[dict[str, Any], ...] = (), rate: float = 5000.0, **sweep: Any
) -> str:
    """Return the text of a sweep file: an output of .5 V, inputs in addition to the tip, and keys of `[sweep]`."""
    frequencies = frequency if frequency is not None else [18.0, 19.0, 20.5]
    tip = {"name": "tip", "terminal": "Dev1/ai0", "range": 5.0, "role": "displacement"}
    lines = ["[output]", 'terminal = "Dev1/ao0"', "amplitude = 0.5", f"rate = {rate!r}", "highest = 1.0"]
    lines += ["slew = 1e6", "ramp_periods = 5", "[sweep]", f"frequency = {toml(frequencies)}"]
    chosen = {"transient_periods": 8, "recorded_periods": 4, **sweep}
    lines += [f"{key} = {toml(value)}" for key, value in chosen.items()]
    for each in (tip, *inputs):
        lines += ["[[input]]", *(f"{key} = {toml(value)}" for key, value in each.items())]
    return "\n".join([*lines, "[calibration.tip]", 'unit = "m"', "sensitivity = 500.0", ""])


def toml(value: Any) -> str:
    """Return a value as TOML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(inner)}" for key, inner in value.items()) + " }"
    return (
        f'"{value}"'
        if isinstance(value, str)
        else repr(value).lower()
        if isinstance(value, bool)
        else repr(value)
    )


def sweep_of(frequency: Any = None, **options: Any) -> SweepSettings:
    """Return the sweep of `sweep_text`."""
    return parse_sweep(sweep_text(frequency, **options), "sweep.toml")
