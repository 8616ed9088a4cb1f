"""Tasks of the virtual device: channels, sample clock, buffers and states, as NI-DAQmx has them."""

from __future__ import annotations

import queue
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.daqmx import DAQmxErrors, constants
from vibroimpact.hardware.virtual_rig.plant import TICK, Floats, Ticks
from vibroimpact.hardware.virtual_rig.profiles import Profile
from vibroimpact.hardware.virtual_rig.refusal import Refusal

FINITE = constants.AcquisitionType.FINITE.value
CONTINUOUS = constants.AcquisitionType.CONTINUOUS.value
ALLOW_REGENERATION = constants.RegenerationMode.ALLOW_REGENERATION.value
INPUT = constants.ChannelType.ANALOG_INPUT.value
OUTPUT = constants.ChannelType.ANALOG_OUTPUT.value
NEVER = 2**62
"""A tick that does not come."""
MOST_SAMPLES = 2**26
"""Samples of a buffer, of all its channels."""
FROM_FIRST = constants.ReadRelativeTo.FIRST_SAMPLE.value
FROM_POSITION = constants.ReadRelativeTo.CURRENT_READ_POSITION.value
FROM_NEWEST = constants.ReadRelativeTo.MOST_RECENT_SAMPLE.value
"""Where a read begins."""

# default input buffers of continuous tasks, samples per channel up to a rate (Hz)
_DEFAULT_BUFFERS = ((100.0, 1_000), (10_000.0, 10_000), (1e6, 100_000), (np.inf, 1_000_000))


class State(Enum):
    """Where a task is."""

    verified = "verified"
    reserved = "reserved"
    running = "running"


@dataclass(slots=True)
class Channel:
    """A virtual channel: an input or output of the device with a name, V.

    Attributes
    ----------
    output : int or None
        Of an input inside the device: the output that it measures.
    """

    name: str
    number: int
    low: float
    high: float
    device_range: float
    wiring: int = constants.TerminalConfiguration.DIFF.value
    output: int | None = None


@dataclass(slots=True)
class Clock:
    """A sample clock as it was asked for."""

    rate: float
    mode: int
    samples: int
    source: str = ""
    edge: int = constants.Edge.RISING.value


UNSET_CLOCK = Clock(1000.0, CONTINUOUS, 1000)
"""What the properties of a clock say before a program sets them."""


@dataclass(slots=True)
class EventStream:
    """Who hears of an event: numbers of samples, or the status at the end; None ends the stream."""

    heard: queue.SimpleQueue[int | None] = field(default_factory=queue.SimpleQueue)
    every: int = 0
    sent: int = 0


class Task:
    """What inputs and outputs have in common.

    Attributes
    ----------
    state : State
    kept : bool
        Reserved by `TaskControl`, so that it stays so when it stops.
    start : int or None
        Tick of the first edge of its clock; None: it does not run, or waits for a trigger.
    rate : float
        Of the clock that runs, Hz; not quite what was asked for, where the clock is in error.
    source : Task or None
        Whose clock it has.
    edges_before : int
        Edges of the clock that were over when the task began.
    count : int
        Edges of the clock that are over, with the samples of all channels.
    sampled : list of int
        Samples of each channel of an input; of inputs one after the other the first have more.
    triggered : bool
        The edge that it waits for has come, or it waits for none.
    done : bool
        It has ended by itself.
    failure : Refusal or None
        Why it has ended.
    implicit : bool
        A read has started it, so that it stops when all of it is read.
    timing, clocked : Clock, bool
        The properties of its sample clock, and whether it has one.
    relative, offset, overwrites : int, int, bool
        Where a read begins, and whether unread samples may be written over.
    """

    def __init__(self, name: str, device: str, profile: Profile) -> None:
        self.name, self.device, self.profile = name, device, profile
        self.kind = 0
        self.channels: list[Channel] = []
        self.timing, self.clocked = UNSET_CLOCK, False
        self.relative, self.offset, self.overwrites = FROM_POSITION, 0, False
        self.trigger, self.trigger_edge = "", constants.Edge.RISING.value
        self.state, self.kept = State.verified, False
        self.start: int | None = None
        self.source: Task | None = None
        self.rate, self.edges_before, self.last_start = 0.0, 0, 0
        self.count = 0
        self.done = self.implicit = self.triggered = False
        self.failure: Refusal | None = None
        self.asked_buffer: int | None = None
        self.regeneration = ALLOW_REGENERATION
        self.buffer: NDArray[Any] = np.empty((0, 0))
        self.sampled: list[int] = []
        self.position = 0  # samples per channel that the program has read or written
        self.every: EventStream | None = None
        self.ended: EventStream | None = None

    # ---- set up ----

    def refuse_running(self) -> None:
        """Refuse a change while the task runs."""
        if self.state is State.running:
            raise Refusal(DAQmxErrors.CAN_NOT_PERFORM_OP_WHILE_TASK_RUNNING, self.name)

    def refuse_empty(self) -> None:
        """Refuse what needs channels."""
        if not self.channels:
            raise Refusal(DAQmxErrors.CAN_NOT_PERFORM_OP_WHEN_NO_CHANS_IN_TASK, self.name)

    def add(self, kind: int, channels: list[Channel]) -> None:
        """Add channels, or none of them."""
        self.refuse_running()
        if self.kind not in (0, kind):
            raise Refusal(DAQmxErrors.INCONSISTENT_CHANNEL_DIRECTIONS, self.name)
        both = [*self.channels, *channels]
        for place, channel in enumerate(both):
            if any(channel.name == other.name or channel.number == other.number for other in both[:place]):
                raise Refusal(DAQmxErrors.CHAN_ALREADY_IN_TASK, channel.name)
        self.kind, self.channels = kind, both

    @property
    def clock(self) -> Clock | None:
        """Its sample clock; None: it reads and writes on demand."""
        return self.timing if self.clocked else None

    @property
    def clock_rate(self) -> float:
        """Rate of its sample clock, Hz: the timebase over the whole number that is nearest to the rate asked for."""
        return self.profile.clock_rate(self.timing.rate, self.highest_rate)

    @property
    def holder(self) -> str:
        """The task in words, as one that holds what another one needs: name, channels, and what it does."""
        word = "ai" if self.kind == INPUT else "ao"
        names = ", ".join(f"{self.device}/{word}{channel.number}" for channel in self.channels)
        doing = "runs" if self.state is State.running and not self.done else "is reserved"
        return f"task {self.name!r}, which {doing} ({names})"

    def set_clock(self, clock: Clock) -> None:
        """Give the task a sample clock; `checks.verify` refuses what the device does not have of it."""
        self.refuse_running()
        self.refuse_empty()
        self.timing, self.clocked = clock, True

    def set_buffer(self, samples: int | None) -> None:
        """Ask for a buffer of so many samples per channel; None: the size that NI's driver takes."""
        self.refuse_running()
        self.refuse_empty()
        if samples is not None and samples < 1:
            raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a buffer of {samples} samples per channel")
        self.asked_buffer = samples

    def refuse_large_buffer(self, samples: int) -> None:
        """Refuse a buffer that has no room."""
        if samples > MOST_SAMPLES // len(self.channels):
            raise Refusal(DAQmxErrors.PAL_MEMORY_FULL, f"{samples} samples of {len(self.channels)} channels")

    @property
    def highest_rate(self) -> float:
        """Of its channels, Hz."""
        if self.kind == OUTPUT:
            return self.profile.output_rate
        return self.profile.highest_rate(len(self.channels))

    @property
    def skew(self) -> int:
        """Ticks between the samples of two channels."""
        return round(self.profile.skew() / TICK) if self.kind == INPUT else 0

    @property
    def length(self) -> int:
        """Samples per channel of the buffer."""
        return int(self.buffer.shape[1])

    @property
    def needed(self) -> int | None:
        """Samples per channel of a finite task; None of a continuous one."""
        return self.clock.samples if self.clock is not None and self.clock.mode == FINITE else None

    def default_buffer(self) -> int:
        """Return the samples per channel that an input buffer has."""
        assert self.clock is not None
        if self.asked_buffer:
            return self.asked_buffer
        if self.clock.mode == FINITE:
            return self.clock.samples
        usual = next(size for rate, size in _DEFAULT_BUFFERS if self.clock.rate <= rate)
        return max(usual, self.clock.samples)

    # ---- run ----

    def begin(self) -> None:
        """Be running, with no edge of the clock over."""
        if self.kind == INPUT and self.clock is not None:
            self.refuse_large_buffer(self.default_buffer())
        if self.every is not None and self.clock is None:
            raise Refusal(DAQmxErrors.EVERY_N_SAMPLES_EVENT_NOT_SUPPORTED_FOR_NON_BUFFERED_TASKS, self.name)
        self.state, self.done, self.failure = State.running, False, None
        self.count = self.edges_before = 0
        self.source = None
        if self.every is not None:
            self.every.sent = 0
        if self.kind == INPUT and self.clock is not None:
            self.position = 0
            self.sampled = [0] * len(self.channels)
            self.buffer = np.zeros((len(self.channels), self.default_buffer()), dtype=np.int16)

    def stop(self) -> None:
        """Stop; what was reserved by itself is given back."""
        self.state = State.reserved if self.kept else State.verified
        self.last_start = self.last_start if self.start is None else self.start
        self.start = None
        if self.kind == OUTPUT:
            self.count = self.position = 0
            self.buffer = np.empty((0, 0))

    def finish(self, failure: Refusal | None = None) -> None:
        """End by itself."""
        self.done, self.failure = True, failure
        if self.ended is not None:
            self.ended.heard.put(failure.code if failure else 0)

    @property
    def is_over(self) -> bool:
        """Whether nothing of it is to come: without a clock, nothing ever is."""
        return self.done or self.state is not State.running or self.clock is None

    @property
    def ticking(self) -> bool:
        """Whether edges of its clock are to come."""
        return self.start is not None and not self.done

    def edge(self, number: Any) -> Any:
        """Return the ticks of edges of the clock, by their numbers; also of one that has just stopped."""
        start = self.last_start if self.start is None else self.start
        place = np.asarray(number) + self.edges_before
        return start + np.rint(place / (self.rate * TICK)).astype(np.int64)

    def follow(self, other: Task) -> None:
        """Have the clock of another task, from its next edge on."""
        self.start, self.rate, self.source = other.start, other.rate, other
        self.edges_before = other.edges_before + other.count - self.count

    def retune(self, rate: float) -> None:
        """Go on at another rate from the next edge on."""
        following = int(self.edge(self.count))
        self.start = following - round((self.count + self.edges_before) / (rate * TICK))
        self.rate = rate

    @property
    def limit(self) -> int:
        """The last tick before its buffer runs empty or over."""
        whole = self.needed
        last = self.position + self.length if self.kind == INPUT else self.position
        bound = self.kind == INPUT or not self.regenerates
        if not bound or (whole is not None and last >= whole):
            return NEVER
        return int(self.edge(last)) - 1

    def edges_until(self, tick: int) -> int:
        """Return how many edges there are up to a tick, it included."""
        assert self.start is not None
        if tick < self.start:
            return 0
        count = max(int((tick - self.start) * TICK * self.rate) + 2 - self.edges_before, 0)
        while count > 0 and int(self.edge(count - 1)) > tick:
            count -= 1
        if self.source is not None:
            count = min(count, self.source.due(tick) + self.source.edges_before - self.edges_before)
        return count if self.needed is None else min(count, self.needed)

    def due(self, tick: int) -> int:
        """Return how many edges its clock gives up to a tick: none, once an output has run empty."""
        edges = self.edges_until(tick)
        return min(edges, self.position) if self.kind == OUTPUT and not self.regenerates else edges

    def tell(self, count: int) -> None:
        """Say to the listener that so many edges are over."""
        self.count = count
        stream = self.every
        if stream is not None:
            while stream.sent + stream.every <= count:
                stream.sent += stream.every
                stream.heard.put(stream.every)

    # ---- outputs ----

    @property
    def room(self) -> int:
        """Samples per channel that can be written."""
        return min(max(self.length - (self.position - self.count), 0), self.length)

    @property
    def regenerates(self) -> bool:
        """Whether samples go out again when there are no new ones."""
        return bool(self.regeneration == ALLOW_REGENERATION)

    def write(self, samples: Floats) -> None:
        """Append samples, shape (channel, sample), for which there is room."""
        places = (self.position + np.arange(samples.shape[1])) % self.length
        self.buffer[:, places] = samples
        self.position += samples.shape[1]

    def generated(self, until: int) -> tuple[Ticks, Floats, bool]:
        """Return ticks and values of the edges up to a tick, and whether the buffer ran empty."""
        due = self.due(until)
        starved = not self.regenerates and self.edges_until(until) > self.position
        numbers = np.arange(self.count, due)
        # what was written before the start and is shorter than the buffer goes round by itself
        round_length = min(self.length, self.position) if self.position < self.length else self.length
        return self.edge(numbers), self.buffer[:, numbers % max(round_length, 1)], starved

    # ---- inputs ----

    @property
    def available(self) -> int:
        """Samples per channel that can be read."""
        return self.count - self.position

    @property
    def overrun(self) -> bool:
        """Whether samples that nobody has read are lost, which ends the task."""
        return self.available > self.length and not self.overwrites

    def seek(self) -> None:
        """Let the next read begin where the program wants it to."""
        if self.relative != FROM_POSITION or self.offset:
            origin = {FROM_FIRST: 0, FROM_POSITION: self.position, FROM_NEWEST: self.count}[self.relative]
            if origin + self.offset < 0:
                raise Refusal(
                    DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a read from sample {origin + self.offset}", read=0
                )
            self.position = origin + self.offset
        self.refuse_overwritten()

    def refuse_overwritten(self) -> None:
        """Refuse to read samples that newer ones have taken the place of."""
        if self.available > self.length:
            raise Refusal(DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE, self.name, read=0)

    def samples_until(self, tick: int) -> list[Ticks]:
        """Return for each channel the ticks of its samples up to a tick."""
        found = []
        for place, count in enumerate(self.sampled):
            late = self.skew * place
            found.append(self.edge(np.arange(count, self.edges_until(tick - late))) + late)
        return found

    def keep(self, place: int, codes: NDArray[np.int16]) -> None:
        """Put samples of a channel into the buffer."""
        count = codes.size
        kept = codes[-self.length :]
        last = self.sampled[place] + count
        self.buffer[place, np.arange(last - kept.size, last) % self.length] = kept
        self.sampled[place] = last

    def take(self, count: int) -> NDArray[np.int16]:
        """Return the next samples, shape (channel, sample), which count as read."""
        places = (self.position + np.arange(count)) % self.length
        self.position += count
        taken: NDArray[np.int16] = self.buffer[:, places]
        return taken

    @property
    def steps(self) -> Floats:
        """V for a step of the converter, of each channel; shape (channel, 1)."""
        ranges = np.array([[channel.device_range] for channel in self.channels])
        return ranges / 2.0 ** (self.profile.bits - 1)
