"""Scenes of oscillators with sweeps, drawn by hypothesis, as texts."""

from __future__ import annotations

from hypothesis import strategies as st

MOST_IMPACTS = 300
"""Limit of the impacts of one point; many of the drawn scenes reach it."""

OSCILLATOR = """
[body]
mass = {mass}
stiffness = {stiffness}
{damping}
displacement_start = {displacement}
{forcing}
[[stop]]
position = 1.0
{law}
{second}
[record]
{record}
[execution]
how = "{how}"
impact_limit = {limit}
[sweep]
{sweep}
"""
LAWS = ("restitution = 0.7", "restitution = 0.0", 'law = "kelvin_voigt"\nstiffness = 50.0\ndamping = 0.5')
SECOND = ("", '[[stop]]\nposition = -1.5\nside = "lower"\nrestitution = 0.9')
FORCED = (
    "transient_periods = 2\nrecorded_periods = 3",
    "recorded_periods = 2\nextrema = false\nimpacts = false",
)
FREE = ("transient_time = 1.0\nrecorded_time = 9.0", "recorded_time = 5.0\nimpacts = false")
SWEPT = ("body.mass", "stop[1].position", "body.velocity_start")
STARTS = ("body.velocity_start", "forcing.phase")
"""Keys that cannot be the direction of a branch."""
SWEPT_FORCED = (*SWEPT, "forcing.amplitude", "forcing.phase")


@st.composite
def oscillators(draw: st.DrawFn, how: str, laws: tuple[str, ...] = LAWS) -> str:
    """Draw an oscillator with one or two stops, forced, pressed or free, and a sweep with or without a path."""
    kind = draw(st.sampled_from(("forced", "constant", "free")))
    frequency = 0.0 if kind == "constant" else draw(st.floats(0.3, 3.0))
    amplitude, phase = draw(st.floats(-8.0, 8.0)), draw(st.sampled_from((0.0, 1.0, -4.0)))
    forcing = f"[forcing]\namplitude = {amplitude}\nangular_frequency = {frequency}\nphase = {phase}"
    key = draw(st.sampled_from(SWEPT_FORCED if kind == "forced" else SWEPT))
    low = draw(st.floats(0.8, 1.2))
    paths = ("independent", "up", "down", "up-down")
    path = draw(st.sampled_from(paths[:1] if key in STARTS else paths))
    sweep = f'"{key}" = {{ start = {low}, stop = {low + 1.0}, points = 4, path = "{path}" }}'
    return OSCILLATOR.format(
        mass=1.0,
        stiffness=draw(st.sampled_from((1.0, 4.0))),
        damping=draw(st.sampled_from(("damping_ratio = 0.1", "damping = 0.3", ""))),
        displacement=draw(st.sampled_from((0.0, 0.8))),
        forcing="" if kind == "free" else forcing,
        law=draw(st.sampled_from(laws)),
        second=draw(st.sampled_from(SECOND)),
        record=draw(st.sampled_from(FORCED if kind == "forced" else FREE)),
        limit=MOST_IMPACTS,
        how=how,
        sweep=sweep,
    )
