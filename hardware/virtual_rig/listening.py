"""Events that programs listen to: every n samples, and the end of a task."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from vibroimpact.hardware.daqmx import METHODS, DAQmxErrors, constants, message_class
from vibroimpact.hardware.virtual_rig.answers import Answers
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.tasks import INPUT, EventStream

_ACQUIRED = constants.EveryNSamplesEventType.ACQUIRED_INTO_BUFFER.value
_GENERATED = constants.EveryNSamplesEventType.TRANSFERRED_FROM_BUFFER.value
# refusals of each direction: the other direction's event, a second listener
_OF_INPUTS = (
    DAQmxErrors.EVERY_N_SAMPS_TRANSFERRED_FROM_BUFFER_EVENT_NOT_SUPPORTED_BY_DEVICE,
    DAQmxErrors.EVERY_N_SAMPS_ACQ_INTO_BUFFER_EVENT_ALREADY_REGISTERED,
)
_OF_OUTPUTS = (
    DAQmxErrors.EVERY_N_SAMPLES_ACQ_INTO_BUFFER_EVENT_NOT_SUPPORTED_BY_DEVICE,
    DAQmxErrors.EVERY_N_SAMPS_TRANSFERRED_FROM_BUFFER_EVENT_ALREADY_REGISTERED,
)


class Listening(Answers):
    """Answers the calls that register and unregister events."""

    def listen(self, method: str, request: Any) -> tuple[EventStream, Callable[[int], Any]]:
        """Register a listener; return its stream and the function that makes a message of an event."""
        task = self._task(request)
        make = message_class(METHODS[method].output_type)
        with self._board.changed:
            task.refuse_running()
            if method == "RegisterDoneEvent":
                if task.ended is not None:
                    raise Refusal(DAQmxErrors.DONE_EVENT_ALREADY_REGISTERED, task.name)
                task.ended = EventStream()
                return task.ended, lambda status: make(status=status)
            kind = request.every_n_samples_event_type_raw or request.every_n_samples_event_type
            task.refuse_empty()
            other_way, taken = _OF_INPUTS if task.kind == INPUT else _OF_OUTPUTS
            if kind != (_ACQUIRED if task.kind == INPUT else _GENERATED):
                raise Refusal(other_way, task.name)
            if request.n_samples < 1:
                raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, "an event every 0 samples")
            if task.every is not None:
                raise Refusal(taken, task.name)
            task.every = EventStream(every=request.n_samples)
            return task.every, lambda count: make(every_n_samples_event_type_raw=kind, n_samples=count)

    def do_unregister_every_n_samples_event(self, request: Any, response: Any) -> None:
        """Remove a listener."""
        task = self._task(request)
        if task.every is not None:
            task.every.heard.put(None)
            task.every = None

    def do_unregister_done_event(self, request: Any, response: Any) -> None:
        """Remove a listener."""
        task = self._task(request)
        if task.ended is not None:
            task.ended.heard.put(None)
            task.ended = None


def messages_of(stream: EventStream, make: Callable[[int], Any]) -> Iterator[Any]:
    """Yield the messages of a stream until it ends."""
    while (heard := stream.heard.get()) is not None:
        yield make(heard)
