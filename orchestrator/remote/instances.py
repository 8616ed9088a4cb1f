"""Instances of FMUs elsewhere: the instances of an importer, whose functions are called on a server."""

from __future__ import annotations

from typing import Any

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.instance import Instance, Wrapper
from vibroimpact.orchestrator.fmi.instance2 import Instance2
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.remote.address import SCHEME, FmuServer
from vibroimpact.orchestrator.remote.functions import RemoteFunctions
from vibroimpact.orchestrator.remote.protocol import INSTANTIATE, Call
from vibroimpact.orchestrator.remote.session import Session


class RemoteGroup(VariableGroup):
    """A group whose values are set when they are needed, except where their acceptance is asked for."""

    __slots__ = ()

    def try_set(self) -> bool:
        """Write the buffer to the variables at once: see `VariableGroup.try_set`."""
        assert isinstance(self.instance, _Remote)
        with self.instance.functions.at_once():
            return super().try_set()


class _Remote(Instance):
    """The parts of an instance that differ for an FMU elsewhere."""

    runs_here = False
    group_type = RemoteGroup

    def _take(self, server: FmuServer, name: str) -> None:
        """Prepare the session; the instance is made there when this one is."""
        self._server = server
        self._session = Session(server, name)
        self.functions = RemoteFunctions(self.fmi_version, self._send, self._refuse_waiting)

    def _load(self, fmu: UnpackedFmu) -> None:
        """Load no library: the server has it."""

    def _function(self, name: str, result: Any = None) -> Function:
        if name == "FreeInstance":
            return self._close
        found = self.functions.named(name)
        return found if self.wrap is None else self.wrap(self.prefix + name, found)

    def _instantiate(self) -> None:
        flags = [getattr(self, flag, False) for flag in ("event_mode", "may_return_early", "_updates")]
        answer = self._session.begin([Call(function=INSTANTIATE, texts=[self.name], numbers=flags)])
        (result,) = self._results(answer, 1)
        if result.status:
            function = "Instantiate" if self.fmi_version == "2.0" else "InstantiateCoSimulation"
            self._session.close()
            self.fail(function, f"made no instance of {SCHEME}{self._server.address}", ComponentFileError)
        self._pointer.value = 1  # not NULL: it exists

    def _send(self, calls: list[Any]) -> Any:
        function = next(
            (c.function for c in reversed(calls) if not c.function.startswith("Get")), calls[-1].function
        )
        if not self._session.is_open:
            self.fail(function, f"was called without a connection to {SCHEME}{self._server.address}")
        answer = self._session.ask(calls, self.prefix + function, self.time)
        return self._results(answer, len(calls))

    def _results(self, answer: Any, most: int) -> Any:
        """Return the results in an answer, and take its log lines."""
        self.log.add(answer.log)
        self.changed_rounding = self.changed_rounding or answer.changed_rounding
        if answer.refusal or not 1 <= len(answer.results) <= most:
            self._session.close()
            got = answer.refusal or f"{len(answer.results)} results of {most} calls"
            raise ComponentFileError(
                f"{self.name}: expected an answer of {SCHEME}{self._server.address}, got {got}."
            )
        return answer.results

    def _refuse_waiting(self, status: int, function: str) -> None:
        self.check(status, function)
        self.fail(function, "was the last of several calls that were made")

    def _close(self, pointer: object) -> None:
        self._session.close()

    def free(self) -> None:
        """End the instance on the server."""
        super().free()
        self._session.close()


class RemoteInstance2(_Remote, Instance2):
    """An instance of an FMI 2.0 FMU on a server."""

    def __init__(
        self,
        server: FmuServer,
        fmu: UnpackedFmu,
        name: str,
        *,
        log: LogTail | None = None,
        wrap: Wrapper | None = None,
        waits: bool = False,
        reuse: bool = False,
    ) -> None:
        self._take(server, name)
        super().__init__(fmu, name, log=log, wrap=wrap, waits=waits)


class RemoteInstance3(_Remote, Instance3):
    """An instance of an FMI 3.0 FMU on a server."""

    def __init__(
        self,
        server: FmuServer,
        fmu: UnpackedFmu,
        name: str,
        *,
        event_mode: bool = False,
        early_return: bool = False,
        updates: bool = False,
        log: LogTail | None = None,
        wrap: Wrapper | None = None,
    ) -> None:
        self._take(server, name)
        self._updates = updates
        super().__init__(fmu, name, event_mode=event_mode, early_return=early_return, log=log, wrap=wrap)
