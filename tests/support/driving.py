"""An observer of an output: an input that is wired to it, started with it."""

from __future__ import annotations

import threading
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.rig.acquisition import Acquisition
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.opening import Rig

LOOP = Input("loop", "Dev1/ai2", 10.0)
"""Wired to Dev1/ao0 in examples/rig/oscillator.toml."""
STEP = 20.0 / 2**16
"""V, of an output and of an input: what rounding adds to a jump, twice."""


class Observer:
    """Records what is put out, from a trigger or at once until it is left.

    Attributes
    ----------
    volts : ndarray of float, shape (sample,)
        When it has ended.
    """

    volts: NDArray[np.float64]

    def __init__(self, rig: Rig, rate: float, trigger: str = "") -> None:
        self._acquired = Acquisition(rig, [LOOP], rate, trigger=trigger)
        self._blocks: list[NDArray[np.float64]] = []
        self._rate = rate
        self._thread = threading.Thread(target=self._collect)

    def _collect(self) -> None:
        self._blocks += [block.volts[0] for block in self._acquired.blocks()]

    def __enter__(self) -> Observer:
        self._acquired.__enter__()
        self._acquired.start()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._acquired.stop()
        self._thread.join()
        self._acquired.__exit__(kind, error, trace)
        assert self._acquired.gaps == []
        self.volts = np.concatenate([np.empty(0), *self._blocks])

    @property
    def steepest(self) -> float:
        """The largest jump, V/s, without what rounding adds."""
        return float((np.abs(np.diff(self.volts)).max() - 2.0 * STEP) * self._rate)
