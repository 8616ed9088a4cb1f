"""Figure of a planned output before a program drives it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.page import LINE, MARK, Floats, canvas
from vibroimpact.analysis.figures.style import page_style

Stretch = tuple[str, Floats, Floats]
"""A title, instants (s) and voltages (V)."""


def draw_planned_drive(begins: Floats, frequencies: Floats, stretches: Sequence[Stretch]) -> Figure:
    """Draw the frequency of an output over its time, and stretches of its voltage sample by sample.

    Parameters
    ----------
    begins : ndarray of float, shape (step + 1,)
        Start of each step, and end of the last step, s.
    frequencies : ndarray of float, shape (step,)
        Hz.
    stretches : sequence of (str, ndarray, ndarray)
        Title, instants (s) and voltages (V); each stretch has its own panel.
    """
    with page_style():
        figure = canvas(45 + 32 * len(stretches))
        axes = np.atleast_1d(figure.subplots(1 + len(stretches), 1))
        axes[0].stairs(frequencies, begins, baseline=None, color=LINE, linewidth=0.8)
        axes[0].set(xlabel="time (s)", ylabel="frequency (Hz)")
        for axis, (title, time, volts) in zip(axes[1:], stretches, strict=True):
            axis.plot(time, volts, color=LINE, linewidth=0.6, rasterized=True)
            for change in begins[(begins > time[0]) & (begins < time[-1])]:
                axis.axvline(change, color=MARK, linewidth=0.5, linestyle="--")
            axis.set_title(title, fontsize=7.5, loc="left", pad=2)
            axis.set(xlabel="time (s)", ylabel="output (V)")
            axis.margins(x=0.0)
    return figure
