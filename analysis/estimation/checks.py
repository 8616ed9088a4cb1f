"""What is asked of a channel before anything is estimated from it."""

from __future__ import annotations

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.recording.units import measured_unit, unit_label
from vibroimpact.fmus.errors import EstimationError

_OTHER_UNITS = {"m s-1": "a velocity", "m s-2": "an acceleration", "N": "a force"}


def check_displacement(channel: Channel) -> None:
    """Refuse a channel that is no displacement: at impacts velocities jump, accelerations and forces have spikes.

    Raises
    ------
    EstimationError
        Its unit is that of a velocity, an acceleration or a force.
    """
    si = measured_unit(channel.unit).si
    if si in _OTHER_UNITS:
        raise EstimationError(
            f"{channel.name}: expected a displacement, got {_OTHER_UNITS[si]} ({unit_label(channel.unit)}). "
            "Measure the displacement, or integrate before the import."
        )
