"""The plant of a virtual rig: a scene that is driven by a voltage and seen as voltages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.hardware.virtual_rig.settings import RigSettings
from vibroimpact.orchestrator.run import Session
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.scene.models import MOST_IMPACTS_PER_POINT

Floats = NDArray[np.float64]
Ticks = NDArray[np.int64]
TICK = 1e-9
"""Unit of all instants of a rig, s: whole numbers of it are equal or not, with no rounding in between."""


class Plant:
    """A scene that goes on for as long as the rig is served.

    Parameters
    ----------
    settings : RigSettings

    Attributes
    ----------
    now : int
        The time reached, in ticks.
    state : dict of str to float
        Displacement (m), velocity (m/s), contact force (N) then.

    Raises
    ------
    SceneError, UsageError
        The scene is wrong, or no plant: a chain, components, a replay, or a base that moves.
    """

    def __init__(self, settings: RigSettings) -> None:
        scene = plant_scene(settings)
        self._gain = settings.exciter.gain
        stops = [f"contact_force[{k}]" for k in range(1, len(scene.stops) + 1)]
        self._session = Session(scene, ["displacement", "velocity", *stops])
        self._session.begin()
        self.now = 0
        self._last = np.asarray(self._session.sample(), dtype=np.float64)[np.newaxis]
        self.state = {name: float(values[0]) for name, values in _quantities(self._last).items()}

    def advance(self, instants: Ticks, volts: Floats) -> dict[str, Floats]:
        """Go on to instants, a voltage held before each; return what the sensors could see there.

        Parameters
        ----------
        instants : ndarray, shape (sample,)
            Ticks, ascending, after `now`.
        volts : ndarray, shape (sample,)
            Of the output that drives the force, until each instant.

        Returns
        -------
        dict of str to ndarray, shape (sample,)
            Displacement, velocity and contact force in SI units.
        """
        times = np.concatenate([[self.now], instants]) * TICK
        # after months some ticks round to the same time: nothing happens between them
        later = np.diff(times) > 0.0
        rows = self._last
        if later.any():
            moved = self._session.hold(times[np.append(True, later)], self._gain * volts[later])
            rows = np.concatenate([self._last, moved])
        found = _quantities(rows[np.cumsum(later)])
        self._last = rows[-1:]
        self.now = int(instants[-1])
        self.state = {name: float(values[-1]) for name, values in found.items()}
        return found

    def close(self) -> None:
        """Free the components."""
        self._session.close()


def _quantities(rows: Floats) -> dict[str, Floats]:
    force = rows[:, 2:].sum(axis=1)
    return {"displacement": rows[:, 0], "velocity": rows[:, 1], "contact_force": force}


def plant_scene(settings: RigSettings) -> Scene:
    """Return the scene of a rig as its plant: its forcing says where the force acts, the output what it is."""
    scene = load_scene(settings.scene)
    other = scene.general is not None or scene.replay is not None
    if other or scene.body.kind not in ("oscillator", "beam"):
        raise UsageError(
            f"{settings.source}: rig.scene: expected an oscillator or a beam, got a scene of another kind."
        )
    if scene.forcing is not None and scene.forcing.kind != "force":
        raise UsageError(
            f"{settings.source}: rig.scene: expected a force on the body, got a base that moves."
        )
    if scene.sweep:
        scene = scene.with_sweep({})
    values = {"execution.impact_limit": MOST_IMPACTS_PER_POINT}
    if scene.forcing is not None:
        values["forcing.amplitude"] = 0
    try:
        return scene.with_values(values)
    except SceneError as error:
        raise UsageError(f"{settings.source}: rig.scene: {error}") from None
