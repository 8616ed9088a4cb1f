"""Tasks of the virtual device: channels, sample clock, buffers and states, as in NI-DAQmx."""

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
"""A tick that is never reached."""
MOST_SAMPLES = 2**26
"""Maximum samples of a buffer, of all its channels."""
FROM_FIRST = constants.ReadRelativeTo.FIRST_SAMPLE.value
FROM_POSITION = constants.ReadRelativeTo.CURRENT_READ_POSITION.value
FROM_NEWEST = constants.ReadRelativeTo.MOST_RECENT_SAMPLE.value
"""Origins of a read, by NI's numbers."""

# default input buffers of continuous tasks: samples per channel, up to a rate (Hz)
_DEFAULT_BUFFERS = ((100.0, 1_000), (10_000.0, 10_000), (1e6, 100_000), (np.inf, 1_000_000))


class State(Enum):
    """The state of a task."""

    verified = "verified"
    reserved = "reserved"
    running = "running"


@dataclass(slots=True)
class Channel:
    """A virtual channel: an input or output of the device with a name, V.

    Attributes
    ----------
    output : int or None
        The output that an input inside the device measures.
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
    """A sample clock with its requested values."""

    rate: float
    mode: int
    samples: int
    source: str = ""
    edge: int = constants.Edge.RISING.value


UNSET_CLOCK = Clock(1000.0, CONTINUOUS, 1000)
"""Properties of a clock before a program sets them."""


@dataclass(slots=True)
class EventStream:
    """The listener of an event: sample counts, or the status at the end; None ends the stream."""

    heard: queue.SimpleQueue[int | None] = field(default_factory=queue.SimpleQueue)
    every: int = 0
    sent: int = 0


class Task:
    """Common state of input and output tasks.

    Attributes
    ----------
    state : State
    kept : bool
        Reserved by `TaskControl`; the reservation outlasts a stop.
    start : int or None
        Tick of the first edge of its clock; None: it does not run, or waits for a trigger.
    rate : float
        Rate of the running clock, Hz; it differs from the requested rate by the clock error.
    source : Task or None
        The task whose clock it shares.
    edges_before : int
        Edges of the clock before the task began.
    count : int
        Elapsed edges of the clock, each with the samples of all channels.
    sampled : list of int
        Samples of each channel of an input; of multiplexed inputs the first have more.
    triggered : bool
        The awaited trigger edge has occurred, or the task waits for none.
    done : bool
        It has ended by itself.
    failure : Refusal or None
        The reason of its end; None: no failure.
    implicit : bool
        It was started by a read, and stops when all its samples are read.
    timing, clocked : Clock, bool
        The properties of its sample clock, and whether it has one.
    relative, offset, overwrites : int, int, bool
        The origin and offset of a read, and whether unread samples may be overwritten.
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
        self.requested_buffer: int | None = None
        self.regeneration = ALLOW_REGENERATION
        self.buffer: NDArray[Any] = np.empty((0, 0))
        self.sampled: list[int] = []
        self.position = 0  # samples per channel read or written by the program
        self.every: EventStream | None = None
        self.ended: EventStream | None = None

    # ---- set up ----

    def refuse_running(self) -> None:
        """Raise Refusal for a change while the task runs."""
        if self.state is State.running:
            raise Refusal(DAQmxErrors.CAN_NOT_PERFORM_OP_WHILE_TASK_RUNNING, self.name)

    def refuse_empty(self) -> None:
        """Raise Refusal for a task without channels."""
        if not self.channels:
            raise Refusal(DAQmxErrors.CAN_NOT_PERFORM_OP_WHEN_NO_CHANS_IN_TASK, self.name)

    def add(self, kind: int, channels: list[Channel]) -> None:
        """Add all the channels, or none of them."""
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
        """Rate of its sample clock, Hz: the timebase over the integer that comes nearest to the requested rate."""
        return self.profile.clock_rate(self.timing.rate, self.highest_rate)

    @property
    def holder(self) -> str:
        """The task as the holder of a resource, in words: name, channels and state."""
        word = "ai" if self.kind == INPUT else "ao"
        names = ", ".join(f"{self.device}/{word}{channel.number}" for channel in self.channels)
        doing = "runs" if self.state is State.running and not self.done else "is reserved"
        return f"task {self.name!r}, which {doing} ({names})"

    def set_clock(self, clock: Clock) -> None:
        """Give the task a sample clock; `checks.verify` refuses unsupported settings."""
        self.refuse_running()
        self.refuse_empty()
        self.timing, self.clocked = clock, True

    def set_buffer(self, samples: int | None) -> None:
        """Set the buffer size in samples per channel; None: the default of NI's driver."""
        self.refuse_running()
        self.refuse_empty()
        if samples is not None and samples < 1:
            raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a buffer of {samples} samples per channel")
        self.requested_buffer = samples

    def refuse_large_buffer(self, samples: int) -> None:
        """Raise Refusal for a buffer above `MOST_SAMPLES`."""
        if samples > MOST_SAMPLES // len(self.channels):
            raise Refusal(DAQmxErrors.PAL_MEMORY_FULL, f"{samples} samples of {len(self.channels)} channels")

    @property
    def highest_rate(self) -> float:
        """Highest sample rate with its channels, Hz."""
        if self.kind == OUTPUT:
            return self.profile.output_rate
        return self.profile.highest_rate(len(self.channels))

    @property
    def skew(self) -> int:
        """Ticks between the samples of two channels."""
        return round(self.profile.skew() / TICK) if self.kind == INPUT else 0

    @property
    def length(self) -> int:
        """Length of the buffer, samples per channel."""
        return int(self.buffer.shape[1])

    @property
    def needed(self) -> int | None:
        """Samples per channel of a finite task; None of a continuous one."""
        return self.clock.samples if self.clock is not None and self.clock.mode == FINITE else None

    def default_buffer(self) -> int:
        """Return the length of an input buffer, samples per channel."""
        assert self.clock is not None
        if self.requested_buffer:
            return self.requested_buffer
        if self.clock.mode == FINITE:
            return self.clock.samples
        usual = next(size for rate, size in _DEFAULT_BUFFERS if self.clock.rate <= rate)
        return max(usual, self.clock.samples)

    # ---- run ----

    def begin(self) -> None:
        """Enter the running state, with no edge of the clock elapsed."""
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
        """Stop; an implicit reservation is released."""
        self.state = State.reserved if self.kept else State.verified
        self.last_start = self.last_start if self.start is None else self.start
        self.start = None
        if self.kind == OUTPUT:
            self.count = self.position = 0
            self.buffer = np.empty((0, 0))

    def finish(self, failure: Refusal | None = None) -> None:
        """End the task by itself."""
        self.done, self.failure = True, failure
        if self.ended is not None:
            self.ended.heard.put(failure.code if failure else 0)

    @property
    def is_over(self) -> bool:
        """Whether it has ended or has no further edges; always so without a clock."""
        return self.done or self.state is not State.running or self.clock is None

    @property
    def ticking(self) -> bool:
        """Whether edges of its clock are to come."""
        return self.start is not None and not self.done

    def edge(self, number: Any) -> Any:
        """Return the ticks of clock edges, by their numbers; also for a task that has just stopped."""
        start = self.last_start if self.start is None else self.start
        place = np.asarray(number) + self.edges_before
        return start + np.rint(place / (self.rate * TICK)).astype(np.int64)

    def follow(self, other: Task) -> None:
        """Share the clock of another task, from its next edge on."""
        self.start, self.rate, self.source = other.start, other.rate, other
        self.edges_before = other.edges_before + other.count - self.count

    def retune(self, rate: float) -> None:
        """Change the rate from the next edge on."""
        following = int(self.edge(self.count))
        self.start = following - round((self.count + self.edges_before) / (rate * TICK))
        self.rate = rate

    @property
    def limit(self) -> int:
        """The last tick before its buffer runs empty or overflows."""
        whole = self.needed
        last = self.position + self.length if self.kind == INPUT else self.position
        bound = self.kind == INPUT or not self.regenerates
        if not bound or (whole is not None and last >= whole):
            return NEVER
        return int(self.edge(last)) - 1

    def edges_until(self, tick: int) -> int:
        """Return the number of edges up to and including a tick."""
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
        """Return the number of edges that its clock passes on up to a tick; it stops once an output has run empty."""
        edges = self.edges_until(tick)
        return min(edges, self.position) if self.kind == OUTPUT and not self.regenerates else edges

    def report(self, count: int) -> None:
        """Report the number of elapsed clock edges to the listener."""
        self.count = count
        stream = self.every
        if stream is not None:
            while stream.sent + stream.every <= count:
                stream.sent += stream.every
                stream.heard.put(stream.every)

    # ---- outputs ----

    @property
    def room(self) -> int:
        """Free space of the buffer, samples per channel."""
        return min(max(self.length - (self.position - self.count), 0), self.length)

    @property
    def regenerates(self) -> bool:
        """Whether samples are repeated when there are no new ones."""
        return bool(self.regeneration == ALLOW_REGENERATION)

    def write(self, samples: Floats) -> None:
        """Append samples, shape (channel, sample), that fit into the free space."""
        places = (self.position + np.arange(samples.shape[1])) % self.length
        self.buffer[:, places] = samples
        self.position += samples.shape[1]

    def generated(self, until: int) -> tuple[Ticks, Floats, bool]:
        """Return ticks and values of the edges up to a tick, and whether the buffer ran empty."""
        due = self.due(until)
        starved = not self.regenerates and self.edges_until(until) > self.position
        numbers = np.arange(self.count, due)
        # samples written before the start repeat even if they do not fill the buffer
        round_length = min(self.length, self.position) if self.position < self.length else self.length
        return self.edge(numbers), self.buffer[:, numbers % max(round_length, 1)], starved

    # ---- inputs ----

    @property
    def available(self) -> int:
        """Samples per channel that can be read."""
        return self.count - self.position

    @property
    def overrun(self) -> bool:
        """Whether unread samples are lost, which ends the task."""
        return self.available > self.length and not self.overwrites

    def seek(self) -> None:
        """Move the read position to the origin and offset that the program has set."""
        if self.relative != FROM_POSITION or self.offset:
            origin = {FROM_FIRST: 0, FROM_POSITION: self.position, FROM_NEWEST: self.count}[self.relative]
            if origin + self.offset < 0:
                raise Refusal(
                    DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a read from sample {origin + self.offset}", read=0
                )
            self.position = origin + self.offset
        self.refuse_overwritten()

    def refuse_overwritten(self) -> None:
        """Raise Refusal where newer samples have overwritten those to be read."""
        if self.available > self.length:
            raise Refusal(DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE, self.name, read=0)

    def samples_until(self, tick: int) -> list[Ticks]:
        """Return the sample ticks of each channel up to a tick."""
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
        """Return the next samples, shape (channel, sample), and advance the read position."""
        places = (self.position + np.arange(count)) % self.length
        self.position += count
        taken: NDArray[np.int16] = self.buffer[:, places]
        return taken

    @property
    def steps(self) -> Floats:
        """V per step of the converter, by channel; shape (channel, 1)."""
        ranges = np.array([[channel.device_range] for channel in self.channels])
        return ranges / 2.0 ** (self.profile.bits - 1)
