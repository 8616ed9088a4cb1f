"""Single mistakes in scenes, with the message of each.

A mistake has a text of the scene, the text in its place, and the line of its message; "..." stands for the rest of the
line.
"""

from __future__ import annotations

OF_AN_OSCILLATOR = [
    ("mass = 1.0", "mass = 0", "body.mass: expected a number > 0, got 0."),
    ("mass = 1.0", "mass = true", "body.mass: expected a number > 0, got true."),
    ("mass = 1.0", "mass = nan", "body.mass: expected a number > 0, got nan."),
    ("mass = 1.0", "mass = inf", "body.mass: expected a number > 0, got inf."),
    ("mass = 1.0", f"mass = 1{'0' * 400}", "body.mass: expected a number > 0, got a number near 1e400."),
    (
        "mass = 1.0",
        'mass = "1 kg"',
        'body.mass: expected a number > 0, got "1 kg". Write the number alone, without quotes; '
        "the unit of this key is kg in an SI scene.",
    ),
    ("mass = 1.0\n", "", "body.mass: expected a number > 0, got nothing. Add mass = ... to [body]."),
    (
        "stiffness = 1.0",
        "stifness = 1.0",
        'body.stifness: expected a known key, got the unknown key "stifness". Did you mean stiffness?',
    ),
    (
        "restitution = 0.7",
        "restitution = 1.2",
        "stop[1].restitution: expected 0 <= r <= 1, got 1.2. Use 1 for an elastic stop, 0 for a dead one.",
    ),
    (
        "restitution = 0.7",
        'restitution = 0.7\nside = "uper"',
        'stop[1].side: expected "upper" or "lower", got "uper". Did you mean "upper"?',
    ),
    (
        "restitution = 0.7",
        'restitution = 0.7\nlaw = "hertz"\nstiffness = 1e3',
        'stop[1].restitution: expected a known key, got the unknown key "restitution". '
        'It belongs to law = "restitution".',
    ),
    (
        "restitution = 0.7",
        "restitution = 0.7\nstiffness = 1e3",
        'stop[1].stiffness: expected a known key, got the unknown key "stiffness". '
        'It belongs to law = "kelvin_voigt", "hertz" or "hunt_crossley".',
    ),
    (
        "stiffness = 1.0",
        "stiffness = 1.0\nmasses = [1.0]",
        'body.masses: expected a known key, got the unknown key "masses". It belongs to kind = "chain".',
    ),
    (
        "restitution = 0.7",
        'restitution = 0.7\nlaw = "hertzz"\nexponent = 1.5',
        'stop[1].law: expected "restitution", "kelvin_voigt", "hertz" or "hunt_crossley", got "hertzz". '
        'Did you mean "hertz"?',
    ),
    (
        "mass = 1.0",
        'kind = "chan"\nmasses = [1.0]',
        'body.kind: expected "oscillator", "chain", "beam", "modes" or "matrices", got "chan". Did you mean "chain"?',
    ),
    (
        "damping = 0.1",
        "damping = 0.1\ndamping_ratio = 0.05",
        "body.damping: expected damping or damping_ratio, got both. Remove one.",
    ),
    (
        "stiffness = 1.0\ndamping = 0.1",
        "stiffness = 0\ndamping_ratio = 0.1",
        "body.damping_ratio: expected a stiffness > 0 beside a damping_ratio, got a stiffness of 0. "
        "The ratio is to 2 sqrt(stiffness mass); give damping instead.",
    ),
    (
        "angular_frequency = 0.8",
        "frequency = 0.8",
        "forcing.frequency: expected no frequency in Hz in a nondimensional scene, got one. "
        'Hz is an SI unit: give angular_frequency in radians per unit of time, or units = "SI".',
    ),
    (
        'units = "nondimensional"',
        'units = "imperial"',
        'scene.units: expected "SI" or "nondimensional", got "imperial". '
        "A scene has one system of units for all of its numbers.",
    ),
    (
        "recorded_periods = 5",
        "recorded_periods = 5.0",
        "record.recorded_periods: expected a whole number from 1 to 100000000, got 5.0.",
    ),
    (
        "transient_periods = 10",
        "transient_time = 10",
        "record.transient_time: expected transient_periods in a forced scene, got transient_time = 10. "
        "A forced scene counts forcing periods: give transient_periods.",
    ),
    (
        "recorded_periods = 5",
        "recorded_periods = 5\ntime_series = { rate = 1e8 }",
        "record.time_series.rate: expected at most 100000000 samples per run, got 3.93e+09. "
        "Lower the rate or the recorded periods.",
    ),
    (
        "recorded_periods = 5",
        'recorded_periods = 5\ntime_series = { rate = 1, variables = ["velocty"] }',
        'record.time_series.variables[1]: expected a variable name, got "velocty". Did you mean "velocity"?',
    ),
    (
        "position = 1.0",
        "position = -0.5",
        "body.displacement_start: expected a start on the free side of stop[1] (displacement <= -0.5), "
        "got 0.0. Start on the stop or away from it, or move the stop.",
    ),
    (
        "[[stop]]",
        "[stop]",
        "stop: expected [[stop]] tables, got a table. Write [[stop]], with two brackets, for each stop.",
    ),
]
OF_A_CHAIN = [
    (
        "masses = [1.0, 2.0, 0.5]",
        "masses = [1.0, -2.0, 0.5]",
        "body.masses[2]: expected a number > 0, got -2.0...",
    ),
    (
        "masses = [1.0, 2.0, 0.5]",
        "masses = []",
        "body.masses: expected an array of 1 to 64 numbers > 0, got an...",
    ),
    (
        "masses = [1.0, 2.0, 0.5]",
        "masses = 3",
        "body.masses: expected an array of 1 to 64 numbers > 0, got 3....",
    ),
    (
        "dampings = 0.1",
        "damping_ratio = 0.1",
        "body.damping_ratio: expected a known key, got the unknown key...",
    ),
    (
        "dampings = 0.1",
        'dampings = "0.1"',
        "body.dampings: expected an array of numbers >= 0, or one number...",
    ),
    (
        "stiffnesses = [3.0, 1.0, 2.0]",
        "stiffnesses = [3.0, 1.0]",
        "body.stiffnesses: expected an array of 3, one number for each mass, got an array of 2. "
        "This scene has 3 masses.",
    ),
    (
        "dampings = 0.1",
        "dampings = 0.1\ndisplacement_start = [0.1]",
        "body.displacement_start: expected an array of 3, one number for each mass, got an array of 1....",
    ),
    (
        "dampings = 0.1",
        "dampings = 0.1\ndisplacement_start = [0, 0.2, 0]",
        "body.displacement_start[2]: expected a start on the free side of stop[1] (displacement <= 0.1), got 0.2...",
    ),
    (
        "dampings = 0.1",
        "dampings = 0.1\nobserved_mass = 4",
        "body.observed_mass: expected a mass of the chain, 1 to 3, got 4....",
    ),
    ("mass = 2", "mass = 4", "stop[1].mass: expected a mass of the chain, 1 to 3, got 4...."),
    (
        "mass = 2",
        "location = 0.5",
        "stop[1].location: expected location for a beam, got it beside a chain. Say which mass by mass.",
    ),
    (
        "amplitude = [0.5, 0.0, 0.1]",
        "amplitude = 0.5",
        "forcing.amplitude: expected an array of 3, one amplitude for each mass, got 0.5. "
        "A force on the last mass alone: amplitude = [0, 0, 1].",
    ),
    (
        "amplitude = [0.5, 0.0, 0.1]",
        "amplitude = [0.5]",
        "forcing.amplitude: expected an array of 3, one number for each mass, got an array of 1....",
    ),
    (
        "amplitude = [0.5, 0.0, 0.1]",
        'kind = "base_acceleration"\namplitude = [0.5, 0.0, 0.1]',
        "forcing.amplitude: expected one number for a chain under base_acceleration, got an array of 3....",
    ),
    (
        "amplitude = [0.5, 0.0, 0.1]",
        'kind = "uniform"\namplitude = 1.0',
        'forcing.kind: expected "force" or "base_acceleration" for a chain, got "uniform"....',
    ),
    (
        "[record]",
        "[sensor]\nlocation = 0.5\n[record]",
        "sensor.location: expected a location in a scene of a beam, got one beside a chain. "
        "Remove it; observed_mass in [body] says which mass.",
    ),
    (
        "[record]",
        "[[stop]]\nposition = 0.2\nmass = 2\nrestitution = 1\n[record]",
        "stop[2].side: expected another place or side than that of stop[1], got two upper stops at one place...",
    ),
    (
        "recorded_periods = 5",
        'recorded_periods = 5\ntime_series = { rate = 1, variables = ["displacement[4]"] }',
        'record.time_series.variables[1]: expected a variable name, got "displacement[4]". Did you mean...',
    ),
    (
        "recorded_periods = 5",
        'recorded_periods = 5\ntime_series = { rate = 1, variables = ["velocity", "velocity"] }',
        'record.time_series.variables: expected each variable once, got "velocity" 2 times.',
    ),
    ("restitution = 0.7", "restitution = 0.7\nstiffness = 1", "stop[1].stiffness: expected a known key..."),
    ("restitution = 0.7", 'law = "hertz"', "stop[1].stiffness: expected a number > 0, got nothing...."),
    (
        "restitution = 0.7",
        'law = "hunt_crossley"\nstiffness = 1\nexponent = 0.5',
        "stop[1].exponent: expected a number from 1 to 10, got 0.5.",
    ),
]
OF_A_BEAM = [
    ("modes = 3", "modes = 65", 'body.modes: expected a whole number from 1 to 64, or "auto", got 65.'),
    (
        "damping_ratio = [0.01, 0.02, 0.03]",
        "damping_ratio = [0.01, -0.02, 0.03]",
        "body.damping_ratio[2]: expected a number >= 0, got -0.02....",
    ),
    (
        "damping_ratio = [0.01, 0.02, 0.03]",
        "damping_ratio = [0.01, 0.02]",
        "body.damping_ratio: expected an array of 3, one number for each mode, got an array of 2. "
        "This scene has 3 modes.",
    ),
    (
        "modes = 3",
        'modes = 3\nboundary = "clamped"',
        'body.boundary: expected "clamped-free", "clamped-clamped", "clamped-pinned" or "pinned-pinned"...',
    ),
    (
        "modes = 3",
        "modes = 3\nrayleigh = { mas = 1 }",
        'body.rayleigh.mas: expected a known key, got the unknown key "mas". Did you mean mass?',
    ),
    (
        "modes = 3",
        "modes = 3\ndisplacement_start = [0, 0, 0, 1]",
        "body.displacement_start: expected at most 3 numbers, one for each mode, got an array of 4....",
    ),
    (
        "density = 2700\n",
        "",
        "body: expected width, thickness, youngs_modulus, density, or flexural_rigidity and mass_per_length, "
        "or frequency and mass_per_length, ...",
    ),
    (
        "density = 2700\n",
        "density = 2700\nmass_per_length = 1.0\n",
        "body: expected width, thickness, youngs_modulus, density, or flexural_rigidity and mass_per_length, "
        "or frequency and mass_per_length, "
        "got width, thickness, youngs_modulus, density beside mass_per_length. Remove those of one way.",
    ),
    (
        "location = 0.8",
        "location = 0.0",
        "stop[1].location: expected a point where a clamped-free beam moves, got 0.0. 0.0 is the clamped end.",
    ),
    (
        "location = 0.8",
        "mass = 1",
        "stop[1].mass: expected mass for a chain, got it beside a beam. Say where...",
    ),
    ("location = 0.8", "location = 1.5", "stop[1].location: expected a number from 0 to 1, got 1.5...."),
    (
        "amplitude = 0.05",
        'amplitude = 0.05\nkind = "mode"',
        "forcing.mode: expected a mode of the beam, 1 to 3, got nothing. Add mode = ... to [forcing]....",
    ),
    (
        "amplitude = 0.05",
        'amplitude = 0.05\nkind = "uniform"\nlocation = 0.5',
        'forcing.location: expected location for a beam with kind = "force", got it beside a beam under uniform....',
    ),
    (
        "amplitude = 0.05",
        "amplitude = [0.05]",
        "forcing.amplitude: expected one number for a beam under force...",
    ),
    (
        "[record]",
        "[sensor]\nlocation = 0\n[record]",
        "sensor.location: expected a point where a clamped-free beam moves, got 0.0....",
    ),
    (
        "recorded_periods = 5",
        'recorded_periods = 5\ntime_series = { rate = 1, variables = ["modal_energy[4]"] }',
        'record.time_series.variables[1]: expected a variable name, got "modal_energy[4]". Did you mean...',
    ),
    (
        "position = 0.001",
        "position = -0.001",
        "body.displacement_start: expected a start on the free side...",
    ),
]
