"""The refusals of the virtual rig, with the codes of NI-DAQmx."""

from __future__ import annotations

from vibroimpact.hardware.daqmx import DAQmxErrors, DAQmxWarnings

STOPPED_BEFORE_DONE = int(DAQmxWarnings.STOPPED_BEFORE_DONE.value)
TEXTS = {
    DAQmxWarnings.STOPPED_BEFORE_DONE: "A finite task was stopped before all of its samples were there",
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
    DAQmxErrors.INVALID_ATTRIBUTE_VALUE: "Requested value is not a supported value for this property",
    DAQmxErrors.INVALID_ROUTING_SOURCE_TERMINAL_NAME_ROUTING: "The device has no such terminal",
    DAQmxErrors.TRIG_WHEN_ON_DEMAND_SAMP_TIMING: "A trigger needs a sample clock",
    DAQmxErrors.PAL_MEMORY_FULL: "There is no room for so large a buffer",
    DAQmxErrors.INVALID_TIMEOUT_VAL: "A timeout is a number of seconds >= 0, or -1 to wait for ever",
    DAQmxErrors.TIMEOUT_EXCEEDED: "The wait was over before what it waited for",
    DAQmxErrors.INVALID_NUMBER_SAMPLES_TO_READ: "A read takes a number of samples >= 0, or -1 for all that are there",
    DAQmxErrors.ONE_CHAN_READ_FOR_MULTI_CHAN_TASK: "One number cannot hold the samples of several channels",
    DAQmxErrors.SPECIFIED_ATTR_NOT_VALID: "The attribute is of another type",
    DAQmxErrors.ATTRIBUTE_INCONSISTENT_ACROSS_CHANNELS_ON_DEVICE: "The channels do not have the same value",
    DAQmxErrors.INVALID_CHAN_NAME: "Names and channels do not go together",
    DAQmxErrors.INVALID_RANGE_OF_OBJECTS_SYNTAX_IN_STRING: "A range of names is written as in Dev1/ai0:3",
    DAQmxErrors.RANGE_SYNTAX_NUMBER_TOO_BIG: "A list of names is too long",
    DAQmxErrors.TASK_NOT_IN_DATA_NEIGHBORHOOD: "The rig has no saved task",
    DAQmxErrors.INVALID_GLOBAL_CHAN: "The rig has no saved channel",
    DAQmxErrors.CUSTOM_SCALE_DOES_NOT_EXIST: "The rig has no scale",
    DAQmxErrors.M_STUDIO_OPERATION_DOES_NOT_SUPPORT_DEVICE_CONTEXT: "The property belongs to the task, not to one of "
    "its devices",
    DAQmxErrors.DONE_EVENT_ALREADY_REGISTERED: "The event is registered already",
    DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT: "The virtual rig does not model this",
    DAQmxErrors.CAN_NOT_PERFORM_OP_WHEN_NO_CHANS_IN_TASK: "The task has no channels",
    DAQmxErrors.CAN_NOT_PERFORM_OP_WHILE_TASK_RUNNING: "The task is running",
    DAQmxErrors.CANNOT_PERFORM_OP_WHEN_TASK_NOT_RUNNING: "The task is not running",
    DAQmxErrors.PAL_RESOURCE_RESERVED: "Another task has reserved what this one needs",
    DAQmxErrors.OUTPUT_BUFFER_EMPTY: "Nothing was written to the output buffer",
    DAQmxErrors.CHAN_ALREADY_IN_TASK: "The channel is in the task already",
    DAQmxErrors.INCONSISTENT_CHANNEL_DIRECTIONS: "A task has inputs or outputs, not both",
    DAQmxErrors.WRITE_NUM_CHANS_MISMATCH: "Write cannot be performed, because the number of channels in the data does "
    "not match the number of channels in the task",
    DAQmxErrors.CANNOT_WRITE_WHEN_AUTO_START_FALSE_AND_TASK_NOT_RUNNING: "A task without a sample clock writes when "
    "it runs or starts by itself",
    DAQmxErrors.ANALOG_MULTI_SAMP_WRITE_NOT_SUPPORTED: "A task without a sample clock writes one sample at a time",
    DAQmxErrors.SAMPLES_CAN_NOT_YET_BE_WRITTEN: "There was no room for all samples in the output buffer in time",
    DAQmxErrors.EVERY_N_SAMPLES_EVENT_NOT_SUPPORTED_FOR_NON_BUFFERED_TASKS: "Events need a sample clock",
    DAQmxErrors.EVERY_N_SAMPS_ACQ_INTO_BUFFER_EVENT_ALREADY_REGISTERED: "The event is registered already",
    DAQmxErrors.EVERY_N_SAMPS_TRANSFERRED_FROM_BUFFER_EVENT_ALREADY_REGISTERED: "The event is registered already",
    DAQmxErrors.EVERY_N_SAMPLES_ACQ_INTO_BUFFER_EVENT_NOT_SUPPORTED_BY_DEVICE: "Outputs do not acquire samples",
    DAQmxErrors.EVERY_N_SAMPS_TRANSFERRED_FROM_BUFFER_EVENT_NOT_SUPPORTED_BY_DEVICE: "Inputs do not generate samples",
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
        NI's code.
    text : str
    read, written : int or None
        Samples per channel that were moved before the failure.
    """

    def __init__(
        self, error: DAQmxErrors, what: str = "", *, read: int | None = None, written: int | None = None
    ) -> None:
        self.code = int(error.value)
        self.text = text_of(self.code) + (f": {what}." if what else ".")
        self.read, self.written = read, written
        super().__init__(self.text)

    def after(self, *, read: int | None = None, written: int | None = None) -> Refusal:
        """Return the same refusal with the samples per channel that the call has moved before."""
        again = Refusal(DAQmxErrors(self.code), read=read, written=written)
        again.text = self.text
        return again


def text_of(code: int) -> str:
    """Return the text of a code; empty for a code that NI-DAQmx does not have.

    >>> text_of(-200089), text_of(-12345)
    ('The name is that of another task', '')
    """
    known: dict[int, str] = {int(error.value): text for error, text in TEXTS.items()}
    names: dict[int, str] = {
        int(error.value): error.name.replace("_", " ").capitalize()
        for error in (*DAQmxWarnings, *DAQmxErrors)
    }
    return known.get(code, names.get(code, ""))
