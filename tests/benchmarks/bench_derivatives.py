"""Cost of a partial derivative of a body, as a multiple of one evaluation of its right-hand side.

An evaluation sets all states and gets their derivatives. A derivative is one call with all derivatives of states as
unknowns. Its knowns are all states, or all states, continuous inputs and tunable parameters, or one of each of these.
Bodies fly beside all their stops, rest on one, or press all in. A loop in C makes the calls (`derivative_calls.c`).
The goal holds for the largest figure of all.

Run with `python tests/benchmarks/bench_derivatives.py`.
"""

from __future__ import annotations

import ctypes
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.component_fmu import HUNT_CROSSLEY, KELVIN_VOIGT, LOWER, RESTITUTION
from support.integrated import Integrated

from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.structure_file import structure_file

GOAL = 2.0
"""Most evaluations that a derivative takes."""
SECONDS, ROUNDS = 1e-4, 60
"""Duration of one loop, s, and number of loops of each kind, in turns; the quickest counts."""
TRIALS = 3
"""Most instances that are measured of each body: another program, or places in memory, can slow down one of them."""
PHASES: dict[str, dict[str, float]] = {
    "flies": {},
    "rests": {"law": RESTITUTION, "position": 0.0},
    "presses": {"law": KELVIN_VOIGT, "position": -0.01, "stiffness": 500.0, "damping": 0.2},
    "presses harder": {
        "law": HUNT_CROSSLEY,
        "position": -0.01,
        "stiffness": 500.0,
        "damping": 0.2,
        "exponent": 1.7,
    },
}


def bodies(contacts: int) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield the name, component and options of the export of each body with up to so many stops."""
    yield "oscillator", "Oscillator", {"contacts": 1}
    for masses in (3, 16, 64):
        yield f"chain of {masses}", "Chain", {"masses": masses, "contacts": contacts}
    for modes in (1, 4, 16, 64):
        yield f"beam of {modes}", "Beam", {"modes": modes, "contacts": contacts}
    for modes in (2, 64):
        rates = 3.0 * np.arange(1, modes + 1)
        shapes = np.sqrt(2.0) * np.cos(np.outer(np.arange(contacts), np.arange(1, modes + 1)))
        arrays = {"mode.angular_frequency": rates, "mode.contact_shape": shapes, "mode.force": shapes[0]}
        content = structure_file({**arrays, "mode.observed_shape": shapes[0]})
        options = {"modes": modes, "contacts": contacts, "structure": content, "model_exchange": True}
        yield f"structure of {modes}", "Structure", options


def compiled() -> ctypes.CDLL:
    """Return the loops in C."""
    with tempfile.TemporaryDirectory() as folder:
        built = Path(folder, "derivative_calls.so")
        command = [os.environ.get("CC", "cc"), "-O2", "-shared", "-fPIC", "-o", str(built)]
        subprocess.run([*command, str(Path(__file__).with_name("derivative_calls.c"))], check=True)
        return ctypes.CDLL(str(built))


def begun(component: str, version: str, path: Path, phase: str, contacts: int) -> Integrated:
    """Return an instance in continuous-time mode that flies beside all its stops, rests on the first or presses all."""
    it = Integrated(component, version, path)
    beside = {"law": KELVIN_VOIGT, "side": LOWER, "position": -1.0, "stiffness": 500.0}
    for k in range(1, contacts + 1):
        chosen = PHASES[phase] if k == 1 or phase.startswith("presses") else beside
        it.set({f"contact[{k}].{key}": value for key, value in (chosen or beside).items()})
        if component == "Chain":
            it.set({f"contact[{k}].mass_number": 1})
    start = {"Oscillator": "displacement_start", "Chain": "displacement_start[1]"}
    start["Beam"] = "modal_displacement_start[1]"
    if component in start:
        it.set({start[component]: 0.0})
    it.set({"forcing.angular_frequency": 3.0, "force[1]" if component == "Chain" else "force": 5e3})
    it.begin()
    held = it.get("contact[1].force") > 0.0
    if held != (phase != "flies"):
        raise SystemExit(f"expected a body that {phase}, got another.")
    return it


def ends_of(it: Integrated) -> tuple[list[str], dict[str, list[list[str]]]]:
    """Return the unknowns of an instance, and its sets of knowns."""
    derivatives = [unknown.variable for unknown in it.description.derivatives]
    states = [v.derivative.name for v in derivatives]
    real = [v for v in it.description.modelVariables if v.type in {"Real", "Float64"}]
    inputs = [v.name for v in real if v.causality == "input" and v.variability == "continuous"]
    tunable = [v.name for v in real if v.variability == "tunable" and "stop[" not in v.name]
    return [v.name for v in derivatives], {
        "states": [states],
        "all": [states + inputs + tunable],
        "one": [[states[0]], [states[-1]], *([name] for name in (*inputs[:4], *tunable[:4]))],
    }


def quickest(runs: dict[str, Callable[[int], int]]) -> dict[str, float]:
    """Return the seconds of one call of each loop, which takes a number of calls, at its quickest."""
    calls: dict[str, int] = {}
    best = dict.fromkeys(runs, math.inf)
    for name, run in runs.items():
        began = time.perf_counter()
        if run(100) != 0:
            raise SystemExit(f"{name}: expected calls that succeed, got an error.")
        calls[name] = max(10, int(100 * SECONDS / (time.perf_counter() - began)))
    for _ in range(ROUNDS):
        for name, run in runs.items():
            began = time.perf_counter()
            run(calls[name])
            best[name] = min(best[name], (time.perf_counter() - began) / calls[name])
    return best


def costs(loops: ctypes.CDLL, it: Integrated) -> tuple[float, dict[str, float]]:
    """Return the seconds of an evaluation, and the cost of the dearest derivative of each kind in evaluations."""
    unknowns, kinds = ends_of(it)
    states = (ctypes.c_double * len(unknowns))()
    prefix = "fmi3" if it.new else "fmi2"
    library, instance, size = it.fmu.dll, ctypes.c_void_p(it.fmu.component), ctypes.c_size_t
    it.fmu.getContinuousStates(states, len(unknowns))
    get = "GetContinuousStateDerivatives" if it.new else "GetDerivatives"
    both = [
        ctypes.cast(getattr(library, prefix + name), ctypes.c_void_p) for name in ("SetContinuousStates", get)
    ]
    found = (ctypes.c_double * len(unknowns))()

    def evaluate(calls: int) -> int:
        return int(
            loops.evaluations(*both, instance, states, found, size(len(unknowns)), ctypes.c_long(calls))
        )

    def derivative(name: str, chosen: list[str]) -> Callable[[int], int]:
        most = max(len(unknowns), len(chosen))
        references = [
            (ctypes.c_uint32 * len(names))(*(it.references[one] for one in names))
            for names in (unknowns, chosen)
        ]
        seed, sensitivity = (ctypes.c_double * most)(*np.cos(np.arange(most))), (ctypes.c_double * most)()
        call = ctypes.cast(getattr(library, f"{prefix}Get{name}Derivative"), ctypes.c_void_p)
        arguments = [call, instance, references[0], size(len(unknowns)), references[1], size(len(chosen))]
        loop = loops.derivatives3 if it.new else loops.derivatives2
        further = [ctypes.c_int(name == "Adjoint")] if it.new else []
        return lambda calls: int(loop(*arguments, seed, sensitivity, ctypes.c_long(calls), *further))

    runs: dict[str, Callable[[int], int]] = {"evaluation": evaluate}
    for kind, sets in kinds.items():
        for chosen in sets:
            for name in ("Directional", "Adjoint") if it.new else ("Directional",):
                runs[f"{kind} {name.lower()} {chosen[0] if kind == 'one' else ''}"] = derivative(name, chosen)
    times = quickest(runs)
    one = times.pop("evaluation")
    dearest: dict[str, float] = {}
    for key, seconds in times.items():
        kind = " ".join(key.split()[:2])
        dearest[kind] = max(dearest.get(kind, 0.0), seconds / one)
    return one, dearest


def main() -> None:
    """Measure, print a line for each body and phase, and end in an error where the goal was missed."""
    loops, worst = compiled(), 0.0
    print(f"{'body':18} {'stops':>5} {'phase':>15}  FMI  evaluation, ns   evaluations of a derivative")
    with tempfile.TemporaryDirectory() as folder:
        for most in (1, 8):
            for name, component, options in bodies(most):
                contacts = options["contacts"]
                for version in ("2.0", "3.0"):
                    path = export_fmu(
                        component, Path(folder, f"{name}-{contacts}-{version}.fmu"), fmi=version, **options
                    )
                    for phase in PHASES:
                        one, dearest = math.inf, {"": math.inf}
                        for _ in range(TRIALS):
                            it = begun(component, version, path, phase, contacts)
                            again, found = costs(loops, it)
                            it.fmu.freeInstance()
                            one = min(one, again)
                            dearest = {
                                kind: min(cost, dearest.get(kind, cost)) for kind, cost in found.items()
                            }
                            if max(dearest.values()) <= GOAL:
                                break
                        worst = max(worst, *dearest.values())
                        texts = ", ".join(f"{kind} {cost:.1f}" for kind, cost in dearest.items())
                        print(
                            f"{name:18} {contacts:5d} {phase:>15}  {version} {1e9 * one:8.0f}   {texts}",
                            flush=True,
                        )
    print(f"A derivative takes at most {worst:.1f} evaluations (goal {GOAL:g}).")
    if worst > GOAL:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
