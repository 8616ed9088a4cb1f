"""What `vibroimpact maps` does: a map of a scene, or of what a graze is like, told, written and drawn."""

from __future__ import annotations

import numpy as np
import xarray as xr

from vibroimpact.analysis.commands.found import write_found
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting
from vibroimpact.analysis.orbits.normal_forms import periods_of
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.commands.failures import counted
from vibroimpact.orchestrator.operations.maps import Maps
from vibroimpact.orchestrator.orbits.maps import HISTORY, MapSettings, map_of, settings_of
from vibroimpact.orchestrator.ssp import opened_scene


def show_map(options: Maps) -> None:
    """Find a map; tell, write and draw it.

    Raises
    ------
    UsageError
        Half a range is given, or changes without a scene.
    """
    settings, path = _settings(options), options.scene
    refuse_outputs([] if path is None else [path], options.output, options.figure)
    if path is None and options.changes:
        raise UsageError("--set: expected a scene to change, got none.")
    scene = None if path is None else opened_scene(path, options.changes or ())
    refuse_overwriting(options.output, options.force, lambda there: there.get("history") == HISTORY)
    found = map_of(scene, settings)
    _tell(found)
    write_found(found.assign_attrs({} if path is None else {"scene_file": str(path)}), "maps", options)


def _settings(options: Maps) -> MapSettings:
    start, stop = options.start, options.stop
    if (start is None) != (stop is None):
        raise UsageError("maps: from, to: expected both or neither, got one of them.")
    return settings_of(
        options.kind,
        span=None if start is None or stop is None else (start, stop),
        points=options.points,
        alpha=options.alpha,
        gamma=options.gamma,
        restitution=options.restitution,
        slope=options.slope,
    )


def _tell(found: xr.Dataset) -> None:
    kind = found.attrs["map"]
    if kind in ("nordmark", "square-root"):
        _tell_diagram(found, "rho" if kind == "nordmark" else "d")
        return
    say(f"{counted(found.sizes['state'], 'state' if kind == 'strobe' else 'impact')} of a run.")
    for name in found["orbit_name"].values:
        say(f"{name}")
    if kind == "discontinuity":
        say(
            f"S has {int(np.isfinite(found['before_velocity']).sum())} points, W "
            f"{int(np.isfinite(found['after_velocity']).sum())}, of {found.sizes['graze']} grazes."
        )


def _tell_diagram(found: xr.Dataset, name: str) -> None:
    if name == "rho":
        numbers = {key: float(found.attrs[key]) for key in ("alpha", "gamma", "restitution")}
        say(", ".join(f"{key} {value:.8g}" for key, value in numbers.items()) + ".")
        if "grazing_amplitude" in found.attrs:
            say(f"Graze at the forcing amplitude {float(found.attrs['grazing_amplitude']):.12g}.")
        elif "oscillator_damping_ratio" in found.attrs:
            ratio, frequency = (
                float(found.attrs[f"oscillator_{key}_ratio"]) for key in ("damping", "frequency")
            )
            say(
                f"An oscillator of damping ratio {ratio:.8g} has these, forced at {frequency:.8g} times its frequency."
            )
        else:
            say("No oscillator has these: expected -2 sqrt(gamma) <= alpha < 1 + gamma.")
    states = found["x"].values
    bounded = np.isfinite(states).all(axis=1)
    periods = periods_of(np.nan_to_num(states))
    values = found[name].values
    runs: list[str] = []
    edges = np.flatnonzero(np.diff(periods, prepend=-1) != 0)
    for begin, end in zip(edges, [*edges[1:], len(values)], strict=True):
        if end - begin >= max(3, len(values) // 100) and bounded[begin:end].all():
            what = f"period {periods[begin]}" if periods[begin] else "no period"
            runs.append(f"{what} from {values[begin]:.4g} to {values[end - 1]:.4g}")
    if runs:
        say(f"{name}: " + "; ".join(runs) + ".")
