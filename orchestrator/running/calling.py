"""A scene as a function of some of its numbers: values in, arrays out, for optimisers and sliders."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.run import PointRunner, Runner
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.run.many_points.one_point import NOT_OF_THE_MOTION, OnePoint, one_point_of
from vibroimpact.orchestrator.run.points import independent_points
from vibroimpact.orchestrator.running.opening import open_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.fields import is_whole

Floats = NDArray[np.float64]


class SceneRunner:
    """An opened scene as a function of the values of some keys.

    Parameters
    ----------
    scene : Scene
        The scene; its sweep is left out.
    keys : sequence of str
        Keys of the arguments of a call, each a number that a sweep may vary.

    Attributes
    ----------
    scene : Scene
        The scene without its sweep.
    keys : tuple of str

    Raises
    ------
    SceneError, UsageError
        A key is unknown in the scene, cannot be varied, or has no value.
    ComponentError
        A component cannot be loaded.
    """

    def __init__(self, scene: Scene, keys: Sequence[str]) -> None:
        self.keys = tuple(keys)
        if not self.keys or len(set(self.keys)) < len(self.keys):
            raise UsageError(
                f"keys: expected different keys of the scene, got {', '.join(self.keys) or 'none'}."
            )
        self.scene = scene.unswept(self.keys)
        self._lock, self._closed = threading.Lock(), False
        own = np.array([[self.scene.value(key) for key in self.keys]], dtype=np.float64)
        self._sound = _SoundValues(self.scene, self.keys)
        self._swept = self._sound.take(own)
        self._form = DatasetForm(self.scene)
        self._open()

    def _open(self) -> None:
        self._process = os.getpid()
        self._many: Runner | None = None
        self._alone = open_scene(self.scene)
        self._point = self._one_point()

    def _one_point(self) -> OnePoint | None:
        """Return the loop over one point; None where points must run alone: see `one_point_of`."""
        if not isinstance(self._alone, PointRunner) or self._alone.loop is None:
            return None
        return one_point_of(self._alone.loop, self.keys, self._form)

    def __call__(self, values: ArrayLike) -> dict[str, Any]:
        """Run a point, or many: see `vibroimpact.runner`."""
        if not self._lock.acquire(blocking=False):
            raise UsageError(
                "runner: expected one call at a time, got another thread's. Make one for each thread."
            )
        try:
            if self._closed:
                raise UsageError("runner: expected one that is open, got one that was closed.")
            if self._process != os.getpid():  # open components belong to the parent of this fork
                self._open()
            points = self._points(values)
            if points.ndim == 1:
                return self._of_one(points.tolist())
            return self._of_many(points)
        finally:
            self._lock.release()

    def _points(self, values: ArrayLike) -> Floats:
        """Return values of one point, shape (key,), or of many, shape (point, key)."""
        try:
            points = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise UsageError(f"values: expected numbers, got {values!r:.60}.") from None
        count = len(self.keys)
        if points.ndim == 0 and count == 1:
            points = points.reshape(1)
        if points.ndim not in (1, 2) or points.shape[-1] != count or not len(points):
            names = ", ".join(self.keys)
            raise UsageError(
                f"values: expected shape ({count},) of one point, or (point, {count}) of some, for {names}, "
                f"got {points.shape}."
            )
        return points

    # ---- points ----

    def _of_one(self, values: list[float]) -> dict[str, Any]:
        if not self._sound.holds(values, values):
            self._sound.take(np.array([values]))
        found = None if self._point is None else self._point.run(values)
        if found is not None:
            return found
        record = self._alone.record_of(dict(zip(self.keys, values, strict=True)))
        dataset = self._form.dataset(independent_points({}, 1), [record], {})
        return {
            str(name): variable.values[0] if variable.dims[:1] == ("run",) else variable.values
            for name, variable in dataset.data_vars.variables.items()
            if name not in NOT_OF_THE_MOTION
        }

    def _of_many(self, points: Floats) -> dict[str, Any]:
        if not self._sound.holds(points.min(axis=0).tolist(), points.max(axis=0).tolist()):
            self._sound.take(points)
        if self._many is None:
            self._many = open_scene(self._swept)
        values = {key: np.ascontiguousarray(column) for key, column in zip(self.keys, points.T, strict=True)}
        columns = independent_points(values, len(points))
        records, _ = self._many.rows(columns)
        if isinstance(records, RunColumns):
            found = self._form.arrays(records)
        else:
            variables = DatasetForm(self._swept).dataset(columns, records, {}).data_vars.variables
            found = {str(name): variable.values for name, variable in variables.items()}
        return {name: array for name, array in found.items() if name not in NOT_OF_THE_MOTION}

    def close(self) -> None:
        """Free the components; later calls are refused."""
        self._closed = True
        for runner in (self._alone, self._many):
            if runner is not None:
                runner.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.scene, self.keys)


class _SoundValues:
    """Valid values of some keys of a scene without a sweep.

    All values between two checked values are valid, as the rules of sweeps are intervals.
    """

    def __init__(self, scene: Scene, keys: Sequence[str]) -> None:
        self._scene, self._keys = scene, tuple(keys)
        self._low, self._high = [math.inf] * len(keys), [-math.inf] * len(keys)
        # values between whole numbers are invalid, and components have other rules
        self._has_gaps = not scene.is_one_body or any(is_whole(scene.field(key)) for key in keys)

    def holds(self, low: Sequence[float], high: Sequence[float]) -> bool:
        """Return whether all values from the least to the largest of each key are known to be valid."""
        for least, most, first, last in zip(low, high, self._low, self._high, strict=True):
            if not first <= least <= most <= last:
                return False
        return True

    def take(self, points: Floats) -> Scene:
        """Check points, shape (point, key), like points of a campaign; return the scene that sweeps them.

        SceneError: the points are invalid; the message has one line for each problem.
        """
        swept = self._swept([sorted(set(column)) for column in points.T.tolist()])
        if not self._has_gaps:
            low = np.minimum(self._low, points.min(axis=0))
            high = np.maximum(self._high, points.max(axis=0))
            wide = np.where(np.isfinite(self._low), high - low, 0.0)
            # the checked range doubles each time, so that drifting values do not need a check each
            for beside in (wide, np.zeros_like(wide)):
                least = np.where(low < self._low, low - beside, low)
                most = np.where(high > self._high, high + beside, high)
                if self._is_sound(least, most):
                    self._low, self._high = least.tolist(), most.tolist()
                    break
        return swept

    def _is_sound(self, low: Floats, high: Floats) -> bool:
        try:
            self._swept([sorted(set(ends)) for ends in zip(low.tolist(), high.tolist(), strict=True)])
        except SceneError:
            return False
        return True

    def _swept(self, values: Sequence[Sequence[float]]) -> Scene:
        return self._scene.with_sweep(dict(zip(self._keys, values, strict=True)))
