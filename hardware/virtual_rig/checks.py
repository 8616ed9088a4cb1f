"""Checks of the settings of a task, made when it is verified, as by NI's driver, not when a value is set."""

from __future__ import annotations

from vibroimpact.hardware.daqmx import DAQmxErrors
from vibroimpact.hardware.virtual_rig.names import is_signal, is_terminal
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.tasks import CONTINUOUS, FINITE, Clock, Task

LONGEST = 4e9
"""Maximum duration of a finite task, s; the last tick still fits into its integer."""
LOWEST_RATE = 0.01
"""Minimum rate of a sample clock, Hz; a board's minimum is its timebase over 2**32."""
_SAMPLE_CLOCKS = ("ai/SampleClock", "ao/SampleClock")


def verify(task: Task) -> None:
    """Raise Refusal for settings that the device does not support."""
    task.refuse_empty()
    if task.clock is not None:
        _verify_clock(task, task.clock)
    if task.trigger:
        _verify_trigger(task)


def _verify_clock(task: Task, clock: Clock) -> None:
    _refuse_rate(task, clock.rate)
    if clock.mode not in (FINITE, CONTINUOUS):
        raise Refusal(DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, f"sample mode {clock.mode}")
    if not 2 <= clock.samples <= LONGEST * clock.rate:
        raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"{clock.samples} samples per channel")
    if clock.source and not is_terminal(task.device, clock.source, *_SAMPLE_CLOCKS):
        raise Refusal(DAQmxErrors.INVALID_ROUTING_SOURCE_TERMINAL_NAME_ROUTING, repr(clock.source[:60]))


def _refuse_rate(task: Task, rate: float) -> None:
    highest, count = task.highest_rate, len(task.channels)
    if LOWEST_RATE <= rate <= highest:
        return
    bound = f"at least {LOWEST_RATE:g}" if rate < LOWEST_RATE else f"at most {highest:g}"
    channels = "1 channel" if count == 1 else f"{count} channels"
    raise Refusal(
        DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a rate of {rate:g} Hz with {channels}; expected {bound} Hz"
    )


def _verify_trigger(task: Task) -> None:
    if not task.clocked:
        raise Refusal(DAQmxErrors.TRIG_WHEN_ON_DEMAND_SAMP_TIMING, task.name)
    if not is_terminal(task.device, task.trigger, "ai/StartTrigger", "ao/StartTrigger"):
        raise Refusal(DAQmxErrors.INVALID_ROUTING_SOURCE_TERMINAL_NAME_ROUTING, repr(task.trigger[:60]))


def refuse_outside_clock(task: Task) -> None:
    """Refuse to start on a clock from an external terminal: nothing drives one."""
    source = task.timing.source if task.clocked else ""
    if source and not is_signal(task.device, source, *_SAMPLE_CLOCKS):
        raise Refusal(DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, f"a clock from {source}")
