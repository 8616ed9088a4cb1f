"""The server of a virtual rig: NI's service and the control service, on this machine only."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent import futures
from contextlib import contextmanager
from typing import Any, NoReturn

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.surroundings import refuse_few_descriptors, refuse_no_loopback
from vibroimpact.hardware.daqmx import CHANNEL_OPTIONS, METHODS, SERVICE, DAQmxErrors, grpc, message_class
from vibroimpact.hardware.virtual_rig import control
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.calls import Call, Calls
from vibroimpact.hardware.virtual_rig.listening import messages_of
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.settings import RigSettings

HOST = "127.0.0.1"
DESCRIPTORS = 16
"""Descriptors that the server and one program on it open: 12 measured on Linux."""
THREADS = 64
"""Maximum concurrent calls; each event that a program listens to occupies one."""


class RigServer:
    """A virtual rig, served until it is closed, at `address`, `host:port`; port 0 is any free one.

    A wrong plant raises SceneError or UsageError; a taken port, or a machine without the means of a rig, UsageError.
    """

    def __init__(self, settings: RigSettings, port: int = 0) -> None:
        refuse_few_descriptors(DESCRIPTORS, "a virtual rig")
        refuse_no_loopback("a virtual rig is reached")
        self._server = grpc.server(
            futures.ThreadPoolExecutor(THREADS, thread_name_prefix="rig"),
            options=[*CHANNEL_OPTIONS, ("grpc.so_reuseport", 0)],
        )
        try:
            taken = self._server.add_insecure_port(f"{HOST}:{port}")
        except RuntimeError:
            taken = 0
        if not taken:
            raise UsageError(f"--port: expected a free port, got {port}, which is taken. Use --port 0.")
        self.address = f"{HOST}:{taken}"
        self.board = Board(settings)
        handlers = (_Handler(SERVICE, self._ni_handler), _Handler(control.SERVICE, self._control_handler))
        self._calls, self._controls = Calls(self.board), control.Controls(self.board, self.vanish)
        self._server.add_generic_rpc_handlers(handlers)
        self._server.start()

    def wait(self) -> None:
        """Serve until the process is interrupted."""
        self._server.wait_for_termination()

    def close(self) -> None:
        """End all calls, all tasks and the plant."""
        stopped = self._server.stop(0.2)
        self.board.close()
        stopped.wait()

    def vanish(self) -> None:
        """End all calls at once, as if the machine of the server had failed."""
        threading.Thread(target=self._server.stop, args=(None,), name="rig end").start()

    # ---- NI's service ----

    def _ni_handler(self, method: str) -> Any:
        if method not in METHODS:
            return None
        make = message_class(METHODS[method].input_type)
        if method in ("RegisterEveryNSamplesEvent", "RegisterDoneEvent"):
            return grpc.unary_stream_rpc_method_handler(
                lambda request, context: self._listen(method, request, context),
                make.FromString,
                lambda message: message.SerializeToString(),
            )
        call = self._calls.answer(method)
        return grpc.unary_unary_rpc_method_handler(
            lambda request, context: self._answered(method, call, request, context), make.FromString
        )

    def _answered(self, method: str, call: Call | None, request: Any, context: Any) -> bytes:
        response = message_class(METHODS[method].output_type)()
        self._calls.caller.active = context.is_active
        try:
            if call is None:
                raise Refusal(DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, f"the call {method}")
            whole = call(request, response)
        except Refusal as refusal:
            _abort(context, refusal)
        return response.SerializeToString() if whole is None else whole

    def _listen(self, method: str, request: Any, context: Any) -> Iterator[Any]:
        try:
            stream, make = self._calls.listen(method, request)
        except Refusal as refusal:
            _abort(context, refusal)
        context.add_callback(lambda: stream.heard.put(None))
        context.send_initial_metadata(())  # without it the client waits for ever
        yield from messages_of(stream, make)

    # ---- the control service ----

    def _control_handler(self, method: str) -> Any:
        call = self._controls.calls.get(method)
        if call is None:
            return None

        def answered(request: bytes, context: Any) -> bytes:
            try:
                return control.encoded(call(control.decoded(request)))
            except (ValueError, Refusal) as error:
                context.abort(grpc.StatusCode.INVALID_ARGUMENT, str(error))
                raise

        return grpc.unary_unary_rpc_method_handler(answered)


class _Handler(grpc.GenericRpcHandler):  # type: ignore[misc]  # grpc carries no types
    """Finds the function that answers a method of a service by its name."""

    def __init__(self, service: str, find: Callable[[str], Any]) -> None:
        self._prefix, self._find = f"/{service}/", find

    def service(self, handler_call_details: Any) -> Any:
        """Return the handler of a call; None for another service."""
        method: str = handler_call_details.method
        return self._find(method.removeprefix(self._prefix)) if method.startswith(self._prefix) else None


def _abort(context: Any, refusal: Refusal) -> NoReturn:
    """End a call with an error of NI's."""
    metadata = [("ni-error", str(refusal.code))]
    if refusal.read is not None:
        metadata.append(("ni-samps-per-chan-read", str(refusal.read)))
    if refusal.written is not None:
        metadata.append(("ni-samps-per-chan-written", str(refusal.written)))
    context.set_trailing_metadata(metadata)
    context.abort(grpc.StatusCode.UNKNOWN, refusal.text)
    raise refusal


@contextmanager
def served(settings: RigSettings, port: int = 0) -> Iterator[RigServer]:
    """Serve a rig for the duration of the block."""
    server = RigServer(settings, port)
    try:
        yield server
    finally:
        server.close()
