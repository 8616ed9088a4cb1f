"""Figure of periodic orbits in the phase plane: stable solid, unstable dashed, each impact a jump of the velocity."""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import Drawing, Family, register, whole
from vibroimpact.analysis.figures.page import canvas, legend_outside
from vibroimpact.analysis.orbits.found import FoundOrbits
from vibroimpact.fmus.bodies.impacting_body import ImpactingBody
from vibroimpact.fmus.errors import DatasetError

_SAMPLES = 400
_COLOURS = ("#0F4C81", "#B5410B", "#3C7D3C", "#7A4B9A", "#8A6D00", "#555555")


def draw_orbits(orbits: FoundOrbits) -> Figure:
    """Draw orbits of one body: displacement of its observed point on x, velocity on y. DatasetError without orbits."""
    if not orbits:
        raise DatasetError("figure: expected orbits, got none.")
    figure = canvas(75)
    axis = figure.subplots()
    for number, orbit in enumerate(orbits):
        ends = np.append(orbit.phases, orbit.phases[0] + 2.0 * np.pi * orbit.periods)
        pieces = []
        for first, last in itertools.pairwise(ends):
            phases = np.linspace(first, last, _SAMPLES)
            phases[-1] = np.nextafter(last, 0.0)
            pieces.append(orbit.at(phases))
        x, v = (np.concatenate([*(piece[k] for piece in pieces), pieces[0][k][:1]]) for k in (0, 1))
        words = f"{orbit.name}, {orbit.stability}"
        style = "-" if orbit.is_stable else (0, (3, 1.5))
        axis.plot(x, v, linestyle=style, linewidth=0.9, color=_COLOURS[number % len(_COLOURS)], label=words)
    for position in _stops_of_the_point(orbits[0].body):
        axis.axvline(position, color="0.6", linewidth=0.6, zorder=0)
    unit = ("m", "m/s") if orbits.units == "SI" else ("-", "-")
    axis.set(xlabel=f"displacement ({unit[0]})", ylabel=f"velocity ({unit[1]})")
    legend_outside(figure, axis, ncols=2)
    return figure


def _stops_of_the_point(body: ImpactingBody) -> list[float]:
    """Return the positions of the stops at rest that limit the observed point, m, ascending."""
    size = float(np.abs(body.observed).max())
    return sorted(
        {
            contact.position
            for contact in body.contacts
            if not contact.motion and np.allclose(contact.shape, body.observed, rtol=0.0, atol=1e-9 * size)
        }
    )


register(
    Family(
        "orbits",
        "periodic orbits",
        {"portrait": Drawing(whole(draw_orbits))},
        type=FoundOrbits,
        is_of_results=False,
    )
)
