"""The worst faults to miss: too small to be seen, or present only in one kind of body or in lanes."""

from __future__ import annotations

from soak._kinds import SEED_STRIDE

from mutants._faults import NATIVE, Fault
from mutants._trial import tried

CHOSEN = {
    "restitution below 1 is off by 1e-9": (
        "core/contact/contact_law.c",
        "    return law->restitution;",
        "    return law->restitution * (law->restitution < 1.0 ? 1.0 - 1e-9 : 1.0);",
    ),
    "restitution falls with speed by another exponent": (
        "core/contact/contact_law.c",
        "sqrt(sqrt(approach_velocity / law->yield_velocity))",
        "pow(approach_velocity / law->yield_velocity, 0.25 + 1e-9)",
    ),
    "a summed chatter ends 1e-6 too late": (
        "core/body/chatter.c",
        "vi_max(0.0, sum.duration)",
        "vi_max(0.0, sum.duration * (1.0 + 1e-6))",
    ),
    "a summed chatter is summed without its slope": (
        "core/body/chatter.c",
        "- t * t / 3.0 * (b->slope / b->pressure)",
        "- t * t / 3.0 * (0.0 * b->slope / b->pressure)",
    ),
    "a graze counts as an impact": (
        "core/body/chatter.c",
        "return approach * approach <= 2.0 * fabs(acceleration) * resolution;",
        "return approach * approach <= 0.0 * fabs(acceleration) * resolution;",
    ),
    "the impulse of a summed chatter is off by 1e-6": (
        "core/body/modal/structure/impact.c",
        "(1.0 + restitution) * rebound / (view.mobility",
        "(1.0 + restitution) * (1.0 + 1e-6) * rebound / (view.mobility",
    ),
    "the wanted change of velocity is off by 1e-9": (
        "core/body/modal/structure/impact.c",
        "(1.0 + restitution[k]) * approach[k]",
        "(1.0 + restitution[k]) * (1.0 + 1e-9) * approach[k]",
    ),
    "impacts count nothing as loss": (
        "core/body/modal/structure/impact.c",
        "energies->contact_loss += before - vi_structure_kinetic(s) + work;",
        "energies->contact_loss += 0.0 * (before + work);",
    ),
    "rebound in lanes of AVX2 alone is off by 1e-9": (
        "core/lanes/rounds.h",
        "const vector after = restitution * approach;",
        "const vector after = restitution * approach * (VI_WIDTH == 4 ? 1.0 - 1e-9 : 1.0);",
    ),
    "rebound in lanes of one mode is off by 1e-9": (
        "core/lanes/rounds.h",
        "const vector after = restitution * approach;",
        "const vector after = restitution * approach * (1.0 - 1e-9);",
    ),
    "short returns in lanes are found from the middle of a pair": (
        "core/lanes/rounds.h",
        "#define SHORTEST_RETURN 0.125",
        "#define SHORTEST_RETURN 0.0",
    ),
    "lanes look at the curve of a pair too boldly": (
        "core/lanes/rounds.h",
        "0.125 * smaller(smaller(curve, end_curve) - error[i >= VI_NEAR_PAIRS], none);",
        "0.0125 * smaller(smaller(curve, end_curve) - error[i >= VI_NEAR_PAIRS], none);",
    ),
    "lanes of several modes take every rise for a steady one": (
        "core/lanes/many_search.h",
        "0.125 * (spread * length)",
        "0.0 * (spread * length)",
    ),
    "lanes of several modes look at the cubic of a cell too boldly": (
        "core/lanes/many_tables.c",
        "vi_min(fourth * (square * square) / 384.0, ",
        "vi_min(fourth * (square * square) / 384000.0, ",
    ),
    "samples of several modes in lanes are off by 1e-8": (
        "core/lanes/many_samples.h",
        "x[k] = m->term[k][0] + motion.added;",
        "x[k] = (m->term[k][0] + motion.added) * (1.0 + 1e-8);",
    ),
    "restitution that falls with speed is off by 1e-9 in lanes": (
        "core/lanes/rounds.h",
        "restitution / root(root(approach / yields))",
        "restitution / root(root(approach / yields * (1.0 + 4e-9)))",
    ),
    "the phase of a cell in lanes turns the other way": (
        "core/lanes/cells.h",
        "return (state){q, p, s->cosine * c - s->sine * n, s->sine * c + s->cosine * n};",
        "return (state){q, p, s->cosine * c - s->sine * n, s->sine * c - s->cosine * n};",
    ),
    "the low part of the period is lost": (
        "core/motion/clock.c",
        "clock->period_low = (fma(-clock->period, angular_frequency, TWO_PI) + TWO_PI_LOW) / angular_frequency;",
        "clock->period_low = 0.0;",
    ),
    "the decay of a mode is off by 1e-9": (
        "core/motion/flow.c",
        "mode->decay = damping / (2.0 * mass);",
        "mode->decay = damping / (2.0 * mass) * (1.0 + 1e-9);",
    ),
    "modes of uniform chains alone are off by 1e-9": (
        "core/modes/chain_modes.c",
        "const double scale = 2.0 * sqrt(chain->stiffness[0] / chain->mass[0]);",
        "const double scale = 2.0 * (1.0 + 1e-9) * sqrt(chain->stiffness[0] / chain->mass[0]);",
    ),
    "shapes of chains alone are off by 1e-9": (
        "core/modes/chain_modes.c",
        "const double size = 2.0 / sqrt((double)of * chain->mass[0]);",
        "const double size = 2.0 * (1.0 + 1e-9) / sqrt((double)of * chain->mass[0]);",
    ),
    "a power law is damped 1e-9 more": (
        "core/body/modal/coupled_flow.c",
        "return press->stiffness * (power + press->damping * drag);",
        "return press->stiffness * (power + press->damping * (1.0 + 1e-9) * drag);",
    ),
    "a relaxing surface comes back 1e-6 faster": (
        "core/body/modal/structure/events.c",
        "tau = contact->relaxation_time;",
        "tau = contact->relaxation_time * (1.0 - 1e-6);",
    ),
    "quadratic damping is off by 1e-9": (
        "core/motion/amplitude.c",
        "double added = law->damping_slope * amplitude;",
        "double added = law->damping_slope * (1.0 + 1e-9) * amplitude;",
    ),
    "the rate of a chirp has 16 digits only": (
        "core/signals/chirp.c",
        "return (vi_chirp){logarithmic, phase, angular_frequency, vi_twofold_quotient(change, twofold(duration))};",
        "return (vi_chirp){logarithmic, phase, angular_frequency, twofold(change.high / duration)};",
    ),
    "the density of a random force is one percent off at the end of its band": (
        "core/signals/random.c",
        "return sqrt(value * PI / r->interval) / (square * square);",
        "return sqrt(value * PI / r->interval) / square;",
    ),
    "a flight over intervals of a random force takes a sixteenth of its bound": (
        "core/body/modal/structure/random_flight.c",
        "bound += fabs(shape[j]) * most[j];",
        "bound += 0.0625 * fabs(shape[j]) * most[j];",
    ),
}
"""For each fault: the file, a text that occurs once in it, and the text in its place."""
CASES, SECONDS = len(CHOSEN), 900.0


def fault_of(name: str) -> Fault:
    """Return a chosen fault."""
    file, old, new = CHOSEN[name]
    start = (NATIVE / file).read_text(encoding="utf-8").index(old)
    return Fault(file, start, start + len(old), new, name)


def check(seed: int) -> str | None:
    """Try a fault; return it if it survives."""
    return tried([fault_of(list(CHOSEN)[seed % SEED_STRIDE])])
