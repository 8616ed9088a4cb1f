"""One instance of an FMI 3.0 co-simulation FMU."""

from __future__ import annotations

from ctypes import c_bool, c_char_p, c_double, c_size_t, c_void_p

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.clock_calls import ClockedInstance
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.fmi.log import LogTail, callback


class Instance3(ClockedInstance):
    """An instance of an FMI 3.0 FMU.

    Parameters
    ----------
    event_mode : bool
        Handle events: event mode and early return.
    early_return : bool
        Let the FMU end a step early (always so in event mode).
    updates : bool
        The FMU may call back within a step. The callback is in C; it asks for nothing.
    """

    fmi_version = "3.0"
    prefix = "fmi3"
    state_word = "FMUState"

    def __init__(
        self,
        fmu: UnpackedFmu,
        name: str,
        *,
        event_mode: bool = False,
        early_return: bool = False,
        updates: bool = False,
        log: LogTail | None = None,
        wrap: Wrapper | None = None,
    ) -> None:
        super().__init__(fmu, name, log=log, wrap=wrap)
        self.event_mode = event_mode
        self.may_return_early = early_return or event_mode
        self._update = callback("update") if updates else c_void_p()
        self._instantiate()
        self._keep_rounding()
        self._bind_life()
        self._bind_events()
        self._bind_states()

    def _instantiate(self) -> None:
        instantiate = self._function("InstantiateCoSimulation", c_void_p)
        flags = (c_bool(False), c_bool(False), c_bool(self.event_mode), c_bool(self.may_return_early))
        texts = (c_char_p(t.encode()) for t in (self.name, self.fmu.token, f"{self.fmu.resources}/"))
        no_variables = (c_void_p(), c_size_t(0))
        pointer = instantiate(
            *texts, *flags, *no_variables, self.log.environment, callback("fmi3"), self._update
        )
        if not pointer:
            self.fail("InstantiateCoSimulation", f"made no instance of {self.fmu.shown}", ComponentFileError)
        self._pointer.value = pointer

    def enter_initialization(self, start_time: float, tolerance: float | None = None) -> None:
        """Enter initialization mode at `start_time`, s, with a relative tolerance; None: the FMU's own."""
        self.time = start_time
        given = (c_bool(tolerance is not None), c_double(tolerance or 0.0))
        no_end = (c_bool(False), c_double(0.0))
        status = self._enter_initialization(self._pointer, *given, c_double(start_time), *no_end)
        self.check(status, "EnterInitializationMode")
