"""What the virtual rig refuses, with the codes of NI-DAQmx."""

from __future__ import annotations

from vibroimpact.hardware.daqmx import DAQmxErrors

TEXTS = {
    DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE: "The program read too late: samples were overwritten in the input buffer. "
    "Read more often or enlarge the buffer",
    DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES: "The output ran out of samples and stopped. Write more "
    "often or enlarge the buffer",
    DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE: "Some or all of the samples requested have not yet been acquired",
    DAQmxErrors.SAMPLES_WILL_NEVER_BE_AVAILABLE: "The samples requested will never be acquired: the task is finite",
    DAQmxErrors.INVALID_DEVICE_ID: "The rig has no such device",
    DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST: "The device has no such channel",
    DAQmxErrors.INVALID_AO_DATA_WRITE: "A value to write is not a number or beyond the range of the channel",
    DAQmxErrors.DEV_CANNOT_BE_ACCESSED: "The device does not answer",
    DAQmxErrors.WAIT_UNTIL_DONE_DOES_NOT_INDICATE_DONE: "The task is not done",
    DAQmxErrors.DUPLICATE_TASK: "The name is that of another task",
    DAQmxErrors.INVALID_TASK: "There is no such task",
    DAQmxErrors.INVALID_ATTRIBUTE_VALUE: "The device has no such value",
    DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT: "The virtual rig does not model this",
    DAQmxErrors.CAN_NOT_PERFORM_OP_WHEN_NO_CHANS_IN_TASK: "The task has no channels",
    DAQmxErrors.CAN_NOT_PERFORM_OP_WHILE_TASK_RUNNING: "The task is running",
    DAQmxErrors.CANNOT_PERFORM_OP_WHEN_TASK_NOT_RUNNING: "The task is not running",
    DAQmxErrors.PAL_RESOURCE_RESERVED: "Another task has reserved what this one needs",
    DAQmxErrors.OUTPUT_BUFFER_EMPTY: "Nothing was written to the output buffer",
    DAQmxErrors.CHAN_ALREADY_IN_TASK: "The channel is in the task already",
    DAQmxErrors.INCONSISTENT_CHANNEL_DIRECTIONS: "A task has inputs or outputs, not both",
    DAQmxErrors.WRITE_NUM_CHANS_MISMATCH: "The number of values does not go with the channels of the task",
    DAQmxErrors.CANNOT_WRITE_WHEN_AUTO_START_FALSE_AND_TASK_NOT_RUNNING: "A task without a sample clock writes when "
    "it runs or starts by itself",
    DAQmxErrors.ANALOG_MULTI_SAMP_WRITE_NOT_SUPPORTED: "A task without a sample clock writes one sample at a time",
    DAQmxErrors.SAMPLES_CAN_NOT_YET_BE_WRITTEN: "There was no room for all samples in the output buffer in time",
    DAQmxErrors.EVERY_N_SAMPLES_EVENT_NOT_SUPPORTED_FOR_NON_BUFFERED_TASKS: "Events need a sample clock",
    DAQmxErrors.EVERY_N_SAMPS_EVENT_ALREADY_REGISTERED: "The event is registered already",
    DAQmxErrors.READ_NO_INPUT_CHANS_IN_TASK: "The task has no inputs",
    DAQmxErrors.WRITE_NO_OUTPUT_CHANS_IN_TASK: "The task has no outputs",
    DAQmxErrors.CHAN_NOT_IN_TASK: "The task has no such channel",
    DAQmxErrors.READ_BUFFER_TOO_SMALL: "The array to read into is too small",
}


class Refusal(Exception):
    """A call that the rig refuses.

    Attributes
    ----------
    code : int
        NI's.
    text : str
    read, written : int or None
        Samples per channel that moved before.
    """

    def __init__(
        self, error: DAQmxErrors, what: str = "", *, read: int | None = None, written: int | None = None
    ) -> None:
        self.code = int(error.value)
        self.text = text_of(self.code) + (f": {what}." if what else ".")
        self.read, self.written = read, written
        super().__init__(self.text)

    def after(self, *, read: int | None = None, written: int | None = None) -> Refusal:
        """Return the same with the samples per channel that a call has moved before."""
        again = Refusal(DAQmxErrors(self.code), read=read, written=written)
        again.text = self.text
        return again


def text_of(code: int) -> str:
    """Return the words for a code."""
    known = {int(error.value): text for error, text in TEXTS.items()}
    return known.get(code, f"NI-DAQmx error {code}")
