"""A scene of components, and single mistakes in it with the message of each (as in `scene_mistakes`)."""

from __future__ import annotations

COUPLED = """\
[component.a]
fmu = "Oscillator"
parameters = { mass = 2, "contact[1].law" = "restitution" }
[component.b]
fmu = "Oscillator"
fmi = "2.0"
[[connection]]
from = "b.displacement"
to = "a.force"
gain = 0.5
gain_unit = "N/m"
[record]
transient_time = 1.0
recorded_time = 2.0
[execution]
macro_step = 0.1
"""

OF_COMPONENTS = [
    (
        'fmi = "2.0"',
        "tolerance = 1e-6",
        'component.b.tolerance: expected tolerance beside an FMU file only, got tolerance = 1e-06 beside "Oscillator". '
        "It is exact, or has a parameter contact_tolerance: remove tolerance.",
    ),
    (
        'gain_unit = "N/m"\n',
        "",
        "connection[1]: expected the same unit at both ends, got m (b.displacement) to N (a.force). "
        'Give the gain with its unit: gain_unit = "N/m".',
    ),
    (
        '"N/m"',
        '"N.s/m"',
        "connection[1].gain_unit: expected a unit that turns m (b.displacement) into N (a.force), "
        'got "N.s/m". Give the gain with its unit: gain_unit = "N/m".',
    ),
    (
        '"N/m"',
        '"N*m"',
        'connection[1].gain_unit: expected a product of SI units such as "N.s/m", "kg.m2/s2" or "1", got '
        '"N*m". Join symbols by dots, write exponents directly behind them, divide by one symbol or '
        "parenthesis.",
    ),
    ("gain = 0.5", "gain = nan", "connection[1].gain: expected a finite number, got nan."),
    (
        '"b.displacement"',
        '"b.displacment"',
        'connection[1].from: expected a variable of Oscillator.fmu after b., got "b.displacment". '
        "Did you mean b.displacement?",
    ),
    (
        '"b.displacement"',
        '"c.displacement"',
        "connection[1].from: expected a component of this scene before the first dot, "
        'got "c.displacement". Known here: a, b.',
    ),
    (
        '"b.displacement"',
        '"displacement"',
        'connection[1].from: expected a variable COMPONENT.VARIABLE, got "displacement". '
        'For example "ball.h"; the component ends at the first dot.',
    ),
    (
        '"b.displacement"',
        '"a.base_acceleration"',
        "connection[1].from: expected an output, a local variable or a parameter, "
        "got the input a.base_acceleration. Connect the output that feeds it.",
    ),
    (
        '"a.force"',
        '"a.mass"',
        "connection[1].to: expected an input or a tunable parameter, got the parameter a.mass. "
        "Start values go into the parameters of the component.",
    ),
    (
        '"b.displacement"',
        '"b.contact[1].count"',
        "connection[1]: expected two variables of one type, "
        "got Integer (b.contact[1].count) to Float64 (a.force).",
    ),
    (
        '"b.displacement"',
        '"a.record.rows"',
        "connection[1]: expected two variables of one shape, got 512 x 8 (a.record.rows) to a single value (a.force).",
    ),
    ("mass = 2", "mass = nan", "component.a.parameters.mass: expected a finite number >= 0, got nan."),
    ("mass = 2", "mass = true", "component.a.parameters.mass: expected a finite number >= 0, got true."),
    (
        "mass = 2",
        "mas = 2",
        'component.a.parameters.mas: expected a variable of Oscillator.fmu, got "mas". Did you mean mass?',
    ),
    (
        "mass = 2",
        "forcing.amplitude = 2",
        'component.a.parameters.forcing: expected a variable of Oscillator.fmu, got "forcing". '
        'Put the whole name in quotes: "forcing.amplitude".',
    ),
    (
        '"restitution"',
        '"externl"',
        'component.a.parameters."contact[1].law": expected one of "none" (0), "restitution" (1), '
        '"kelvin_voigt" (2), "hertz" (3), "hunt_crossley" (4), "external" (5), "external_force" (6), '
        '"pair" (7), '
        'got "externl". Did you mean external?',
    ),
    (
        "mass = 2",
        "velocity = 2",
        "component.a.parameters.velocity: expected a variable with a start value, "
        "got the output velocity (Float64). Parameters, inputs and start states have one.",
    ),
    (
        "mass = 2",
        "impact_limit = 1.5",
        "component.a.parameters.impact_limit: expected a whole number >= 0, got 1.5.",
    ),
    (
        '"2.0"',
        "2.0",
        'component.b.fmi: expected "3.0" or "2.0", in quotes, got 2.0.',
    ),
    (
        "macro_step = 0.1",
        "",
        "execution.macro_step: expected a number > 0 where components are connected, got nothing. "
        "Add macro_step = ... to [execution]: the time between two exchanges of values.",
    ),
    (
        "macro_step = 0.1",
        "macro_step = 1e-12",
        "execution.macro_step: expected at most 10000000000 steps per run, got 3e+12. Make it longer.",
    ),
    (
        "macro_step = 0.1",
        'macro_step = 0.1\nhow = "fused"',
        'execution.how: expected "auto" or "coupled" in a general scene, got "fused". '
        "Only the short form ([body] and [[stop]]) runs fused.",
    ),
    (
        "macro_step = 0.1",
        'macro_step = 0.1\nexchange = "gauss-seidel"',
        'execution.exchange: expected "jacobi", "gauss_seidel" or "iterated", got "gauss-seidel". '
        'Did you mean "gauss_seidel"?',
    ),
    (
        "recorded_time = 2.0",
        "recorded_periods = 2",
        'record.recorded_periods: expected a known key, got the unknown key "recorded_periods". '
        "Did you mean recorded_time?",
    ),
    (
        "recorded_time = 2.0",
        'recorded_time = 2.0\nvariables = ["a.velocity"]',
        "record.rate: expected a number > 0 beside variables, got nothing. "
        "Add rate = ... to [record]: samples per unit of time.",
    ),
    (
        "recorded_time = 2.0",
        'recorded_time = 2.0\nrate = 1\nvariables = ["a.velocity", "a.velocity"]',
        'record.variables[2]: expected each variable once, got "a.velocity". '
        "It would be a second a_velocity in the dataset.",
    ),
    (
        "recorded_time = 2.0",
        'recorded_time = 2.0\nrate = 1e9\nvariables = ["a.velocity"]',
        "record.rate: expected at most 100000000 samples per run, got 2e+09. "
        "Lower the rate or the recorded time.",
    ),
]
