"""One instance on a server: batches of calls of its FMU, and their answers."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from queue import SimpleQueue
from typing import Any

from vibroimpact.fmus.errors import ComponentError, LostComponentError
from vibroimpact.orchestrator.remote.address import SCHEME, FmuServer
from vibroimpact.orchestrator.remote.channel import (
    CONNECT_SECONDS,
    RETRY_SECONDS,
    grpc,
    is_absent,
    loss_of,
    metadata_for,
    open_channel,
)
from vibroimpact.orchestrator.remote.protocol import HASH_KEY, RUN, Answer, Batch

#: Longest interval at which a call under way is compared with its deadline, s.
LOOK_SECONDS = 1.0
#: Longest time for a server to start a process and to load the FMU there, s.
START_SECONDS = 60.0


class Session:
    """A stream to a server, which has one instance as long as the stream lives.

    Parameters
    ----------
    server : FmuServer
    name : str
        Name of the component, for messages.
    """

    def __init__(self, server: FmuServer, name: str) -> None:
        self._server, self._name = server, name
        self._channel: Any = None
        self._stream: Any = None
        self._deadline = math.inf
        self._deadline_watch: threading.Thread | None = None
        self._is_late = False

    @property
    def is_open(self) -> bool:
        """Whether the stream has neither been closed nor failed."""
        return self._channel is not None

    def begin(self, first: Sequence[Any]) -> Any:
        """Open the stream with its first calls; return their answer.

        A server that is not there is waited for. Raises ComponentError: no server, a refusal, or a failure.
        """
        server, end = self._server, time.monotonic() + CONNECT_SECONDS
        metadata = metadata_for(server.address, (HASH_KEY, server.sha256))
        self._channel = open_channel(server.address, server.certificate)
        call = self._channel.stream_stream(RUN, lambda batch: batch.SerializeToString(), Answer.FromString)
        while True:
            self._requests: SimpleQueue[Any] = SimpleQueue()
            self._stream = call(iter(self._requests.get, None), metadata=metadata)
            try:
                return self._exchanged(first, max(START_SECONDS, server.seconds), "Instantiate", math.nan)
            except grpc.RpcError as error:
                if is_absent(error) and time.monotonic() < end:
                    time.sleep(RETRY_SECONDS)
                    continue
                raise self._failure(error, "Instantiate", math.nan) from None

    def ask(self, calls: Sequence[Any], function: str, at: float) -> Any:
        """Send calls and return their answer.

        Parameters
        ----------
        calls : sequence of Call
        function : str
            Name of the call that the others go with, for messages.
        at : float
            Time of the run, s, for messages.

        Raises
        ------
        ComponentError
            The stream has failed; it is closed.
        """
        try:
            return self._exchanged(calls, self._server.seconds, function, at)
        except grpc.RpcError as error:
            raise self._failure(error, function, at) from None

    def _exchanged(self, calls: Sequence[Any], seconds: float, function: str, at: float) -> Any:
        self._begin_watch(seconds)
        try:
            self._requests.put(Batch(calls=calls))
            return next(self._stream)
        except StopIteration:
            where = self._where(function, at)
            self.close()
            what = f"{where}: expected an answer, got the end of its stream."
            raise LostComponentError(what, instance=self._name, function=function, time=at) from None
        finally:
            self._deadline = math.inf

    def _begin_watch(self, seconds: float) -> None:
        """Set the deadline of the calls under way; a thread ends a stream that misses it."""
        if self._deadline_watch is None:
            self._deadline_watch = threading.Thread(target=self._look, args=(self._channel,), daemon=True)
            self._deadline_watch.start()
        self._deadline = time.monotonic() + seconds

    def _look(self, channel: Any) -> None:
        while self._channel is channel:
            time.sleep(min(LOOK_SECONDS, self._server.seconds / 4.0))
            if time.monotonic() > self._deadline and self._channel is channel:
                self._is_late = True
                self._stream.cancel()

    def _failure(self, error: Any, function: str, at: float) -> ComponentError:
        """Close the stream and return the error of its failure."""
        late = self._server.seconds if self._is_late else 0.0
        found = loss_of(error, self._where(function, at), late)
        self.close()
        return type(found)(found.message, instance=self._name, function=function, time=at)

    def _where(self, function: str, at: float) -> str:
        when = "" if math.isnan(at) else f" at time {at:.17g}"
        return f"{self._name}: {function} of {SCHEME}{self._server.address}{when}"

    def close(self) -> None:
        """End the stream, and so the instance."""
        channel, self._channel = self._channel, None
        if channel is not None:
            self._stream.cancel()
            self._requests.put(None)
            channel.close()
