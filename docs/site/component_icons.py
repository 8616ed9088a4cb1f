"""Draw the icons of the FMUs: `python docs/site/component_icons.py` writes icon.png next to each component's C file.

A tool shows an icon on the block of a diagram: a few thick lines on white, readable at 40 pixels too.
"""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

NATIVE = Path(__file__).resolve().parents[2] / "fmus" / "native"
#: Width and height, pixels; the drawing's own coordinates go from 0 to 10.
PIXELS = 160
LINE = 3.0
DARK, BLUE, RED, GREY = "#222222", "#2166ac", "#b2182b", "#9a9a9a"


def wall(axes: Axes, x: float, low: float, high: float, side: int, colour: str = DARK) -> None:
    """Draw a wall at x with its hatching on one side, -1 left or 1 right."""
    axes.plot([x, x], [low, high], color=colour, lw=LINE)
    for y in np.linspace(low + 0.6, high, 6):
        axes.plot([x, x + 0.7 * side], [y, y - 0.6], color=colour, lw=LINE / 2.0)


def spring(axes: Axes, left: float, right: float, y: float, turns: int = 4) -> None:
    """Draw a spring between two places."""
    lead = 0.15 * (right - left)
    x = np.linspace(left + lead, right - lead, 2 * turns + 1)
    zigzag = y + 0.7 * np.array([0.0, *([1.0, -1.0] * turns)[: 2 * turns - 1], 0.0])
    axes.plot([left, *x, right], [y, *zigzag, y], color=DARK, lw=LINE * 0.75, solid_joinstyle="round")


def mass(axes: Axes, left: float, low: float, size: float) -> None:
    """Draw a mass."""
    axes.add_patch(Rectangle((left, low), size, size, facecolor=BLUE, edgecolor=DARK, lw=LINE * 0.75))


def stop(axes: Axes, x: float, y: float) -> None:
    """Draw a stop that is hit from the left: a nose before a wall."""
    axes.add_patch(Rectangle((x - 0.9, y - 0.5), 0.9, 1.0, facecolor=RED, edgecolor=RED))
    wall(axes, x, y - 2.2, y + 2.2, 1, RED)


def oscillator(axes: Axes) -> None:
    """Draw a mass on a spring before a stop."""
    wall(axes, 0.9, 2.0, 8.0, -1)
    spring(axes, 0.9, 4.0, 5.0)
    mass(axes, 4.0, 3.7, 2.6)
    stop(axes, 9.0, 5.0)


def chain(axes: Axes) -> None:
    """Draw three masses on springs before a stop."""
    wall(axes, 0.8, 2.6, 7.4, -1)
    for left in (0.8, 3.1, 5.4):
        spring(axes, left, left + 1.2, 5.0, turns=2)
        mass(axes, left + 1.2, 4.45, 1.1)
    stop(axes, 9.2, 5.0)


def beam(axes: Axes) -> None:
    """Draw a bent beam, clamped on the left, with a stop above its tip."""
    wall(axes, 1.0, 1.8, 7.4, -1)
    s = np.linspace(0.0, 1.0, 60)
    bent = 4.2 + 2.0 * s**2 * (6.0 - 4.0 * s + s**2) / 3.0
    axes.plot(1.0 + 7.8 * s, np.full_like(s, 4.2), color=GREY, lw=LINE / 2.0, ls="--")
    axes.plot(1.0 + 7.8 * s, bent, color=BLUE, lw=2.4 * LINE, solid_capstyle="butt")
    axes.add_patch(Rectangle((7.9, 6.9), 0.9, 0.7, facecolor=RED, edgecolor=RED))
    axes.plot([6.4, 9.6], [7.6, 7.6], color=RED, lw=LINE)
    for x in np.linspace(6.6, 9.3, 6):
        axes.plot([x, x + 0.6], [7.6, 8.3], color=RED, lw=LINE / 2.0)


def impact_stop(axes: Axes) -> None:
    """Draw a ball on its way to a stop."""
    axes.add_patch(Circle((3.0, 5.0), 1.5, facecolor=BLUE, edgecolor=DARK, lw=LINE * 0.75))
    arrow = {"arrowstyle": "-|>", "color": DARK, "lw": LINE * 0.75, "mutation_scale": 14}
    axes.annotate("", (7.3, 5.0), (4.8, 5.0), arrowprops=arrow)
    stop(axes, 8.8, 5.0)


def replay(axes: Axes) -> None:
    """Draw samples joined by straight lines, with a bridged gap."""
    x = np.linspace(1.2, 8.8, 12)
    y = 5.0 + 2.6 * np.sin(1.15 * x) * np.exp(-0.12 * x)
    axes.plot([1.0, 1.0, 9.2], [8.4, 1.6, 1.6], color=DARK, lw=LINE * 0.75)
    axes.plot(x[:6], y[:6], color=BLUE, lw=LINE * 0.75, marker="o", ms=4.0)
    axes.plot(x[5:9:3], y[5:9:3], color=BLUE, lw=LINE / 2.0, ls=":")
    axes.plot(x[8:], y[8:], color=BLUE, lw=LINE * 0.75, marker="o", ms=4.0)


def gain(axes: Axes) -> None:
    """Draw the triangle of an amplifier between two lines."""
    axes.plot([0.8, 9.2], [5.0, 5.0], color=DARK, lw=LINE * 0.75)
    corners = [(2.8, 1.9), (2.8, 8.1), (7.8, 5.0)]
    axes.add_patch(
        Polygon(corners, facecolor=BLUE, edgecolor=DARK, lw=LINE * 0.75, joinstyle="round", zorder=3)
    )


def structure(axes: Axes) -> None:
    """Draw two masses that a spring joins, and a ball between them."""
    for x in (0.9, 7.0):
        axes.add_patch(Rectangle((x, 2.8), 2.1, 4.4, facecolor=BLUE, edgecolor=DARK, lw=LINE * 0.75))
    spring(axes, 3.0, 7.0, 6.2, turns=3)
    axes.add_patch(Circle((5.8, 4.0), 1.0, facecolor=GREY, edgecolor=RED, lw=LINE * 0.75))


def sensor(axes: Axes) -> None:
    """Draw a probe before a body that moves."""
    axes.add_patch(Rectangle((0.9, 3.9), 4.0, 2.2, facecolor=GREY, edgecolor=DARK, lw=LINE * 0.75))
    axes.add_patch(Rectangle((7.6, 2.0), 1.4, 6.0, facecolor=BLUE, edgecolor=DARK, lw=LINE * 0.75))
    arrow = {"arrowstyle": "<|-|>", "color": DARK, "lw": LINE / 2.0, "mutation_scale": 10}
    axes.annotate("", (7.7, 5.0), (4.8, 5.0), arrowprops=arrow)


def load_cell(axes: Axes) -> None:
    """Draw the pulse of an impact, and the ring after it."""
    axes.plot([1.0, 1.0, 9.2], [8.8, 3.6, 3.6], color=DARK, lw=LINE * 0.75)
    x = np.linspace(0.0, 1.0, 40)
    axes.plot(1.6 + 2.2 * x, 3.6 + 4.6 * np.sin(np.pi * x), color=RED, lw=LINE)
    axes.plot(
        3.8 + 5.2 * x, 3.6 - 1.8 * np.sin(6.0 * np.pi * x) * np.exp(-2.2 * x), color=BLUE, lw=LINE * 0.75
    )


def exciter(axes: Axes) -> None:
    """Draw a coil on a core that pulls at a body."""
    axes.add_patch(Rectangle((1.6, 1.0), 6.8, 1.4, facecolor=GREY, edgecolor=DARK, lw=LINE * 0.75))
    axes.add_patch(Rectangle((4.2, 2.4), 1.6, 3.0, facecolor=GREY, edgecolor=DARK, lw=LINE * 0.75))
    for y in np.linspace(2.9, 4.9, 4):
        axes.plot([3.4, 6.6], [y - 0.2, y + 0.2], color=RED, lw=LINE, solid_capstyle="round")
    axes.add_patch(Rectangle((1.2, 7.4), 7.6, 1.3, facecolor=BLUE, edgecolor=DARK, lw=LINE * 0.75))
    arrow = {"arrowstyle": "-|>", "color": DARK, "lw": LINE * 0.75, "mutation_scale": 12}
    axes.annotate("", (5.0, 5.6), (5.0, 7.5), arrowprops=arrow)


def noise(axes: Axes) -> None:
    """Draw a noisy line around a straight one."""
    x = np.linspace(0.8, 9.2, 40)
    rough = np.array([math.fmod(7919.0 * (k + 1) ** 2, 104729.0) / 104729.0 - 0.5 for k in range(40)])
    axes.plot(x, 5.0 + 4.5 * rough, color=BLUE, lw=LINE / 2.0, solid_joinstyle="round")
    axes.plot([0.8, 9.2], [5.0, 5.0], color=DARK, lw=LINE * 0.75)


def analog_input(axes: Axes) -> None:
    """Draw a curve and its steps."""
    x = np.linspace(0.0, 1.0, 60)
    axes.plot([1.0, 1.0, 9.2], [8.6, 1.4, 1.4], color=DARK, lw=LINE * 0.75)
    axes.plot(1.2 + 7.6 * x, 5.0 - 2.6 * np.cos(1.5 * np.pi * x), color=GREY, lw=LINE * 0.75)
    places = np.linspace(0.0, 1.0, 9)
    levels = 5.0 - np.round(2.6 * np.cos(1.5 * np.pi * places) / 0.9) * 0.9
    axes.step(1.2 + 7.6 * places, levels, where="post", color=BLUE, lw=LINE)


ICONS = (
    *(oscillator, chain, beam, structure, impact_stop, replay, gain),
    *(sensor, load_cell, exciter, noise, analog_input),
)


def main() -> None:
    """Write all icons."""
    matplotlib.use("agg")
    for draw in ICONS:
        figure = Figure(figsize=(PIXELS / 100.0, PIXELS / 100.0), dpi=100.0)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0.0, 10.0), ylim=(0.0, 10.0))
        axes.axis("off")
        draw(axes)
        path = NATIVE / draw.__name__ / "icon.png"
        # without the version of matplotlib: equal drawings give equal files
        figure.savefig(path, metadata={"Software": None})
        print(path.relative_to(NATIVE.parents[1]), path.stat().st_size)


if __name__ == "__main__":
    main()
