"""Number of modes of the thesis's beams on compliant stops, and the benefit of residual vectors.

The scenes are those of `examples/thesis` with beams and stops, from rest. Each stop is a Kelvin-Voigt stop at the tip
or at 0.6 of the length. Its stiffness is a multiple of the beam's static stiffness there.

For each tolerance the table has the fewest modes that `modes = "auto"` finds, natural modes alone and with residual
vectors. The last column is the processor time of the second run over the first (medians, in turns). The numbers of
modes are the same on each machine.

Run with `python tests/benchmarks/bench_modes.py [--repetitions 5]`.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.preparation import with_found_modes

THESIS = Path(__file__).parents[2] / "examples" / "thesis"
BEAMS = ("figure_7_10", "figure_7_11", "stiff_beam")
PLACES = (1.0, 0.6)
STIFFNESS_RATIOS = (10.0, 1000.0)
TOLERANCES = (1e-2, 1e-3, 1e-4)
PERIODS = 20
MANY = 400
"""Modes in the sum of the static flexibility."""


def scene_of(name: str, place: float, ratio: float, impacts: bool) -> Scene:
    """Return a thesis beam on a compliant stop, with an automatic number of modes."""
    document = parse_toml((THESIS / f"{name}.toml").read_text(encoding="utf-8"))
    body = document["body"]
    modes = beam_modes("clamped_free", MANY)
    flexibility = float((modes.shapes(place) ** 2 / modes.eigenvalues**4).sum())
    static = body["flexural_rigidity"] / body["length"] ** 3 / flexibility
    stiffness = ratio * static
    period = 1.0 / document["forcing"]["frequency"]
    (stop,) = document["stop"]
    position = stop["position"] * (place**2 * (3.0 - place) / 2.0)
    law = {"law": "kelvin_voigt", "stiffness": stiffness, "damping": 2e-4 * stiffness * period}
    document["stop"] = [{"position": position, "side": stop["side"], "location": place, **law}]
    document["record"] = {"recorded_periods": PERIODS, "impacts": impacts}
    document["body"] = body | {"modes": "auto"}
    document["execution"] = {"tolerance": TOLERANCES[0]}
    return Scene.from_dict(document, name)


def found(scene: Scene, tolerance: float, residual: bool) -> Scene | None:
    """Return the scene with the fewest modes that meet a tolerance; None where 64 modes do not meet it."""
    try:
        return with_found_modes(
            scene.with_values({"execution.tolerance": tolerance, "body.residual": residual})
        )
    except SceneError:
        return None


def seconds(scenes: list[Scene], repetitions: int) -> list[float]:
    """Run scenes in turns; return the median processor time of each, s."""
    runners = [open_runner(scene, "fused") for scene in scenes]
    times: list[list[float]] = [[] for _ in scenes]
    for turn in range(repetitions + 1):
        for place, runner in enumerate(runners):
            began = time.process_time()
            runner.run({})
            if turn:
                times[place].append(time.process_time() - began)
    for runner in runners:
        runner.close()
    return [statistics.median(each) for each in times]


def main() -> None:
    """Print the table and a sentence."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repetitions", type=int, default=5)
    repetitions = parser.parse_args().repetitions
    print("| beam | stop at | stiffness | impacts count | tolerance | modes | with residual vectors | time |")
    print("|---|---|---|---|---|---|---|---|")
    ratios = []
    for name in BEAMS:
        for place in PLACES:
            for stiffness in STIFFNESS_RATIOS:
                for impacts in (False, True):
                    scene = scene_of(name, place, stiffness, impacts)
                    for tolerance in TOLERANCES:
                        both = [found(scene, tolerance, residual) for residual in (False, True)]
                        counts = ["> 32" if one is None else f"{one.body.size}" for one in both]
                        ratio = ""
                        if None not in both:
                            natural, residual = seconds([one for one in both if one], repetitions)
                            ratios.append(residual / natural)
                            ratio = f"{ratios[-1]:.2f}"
                        what = "yes" if impacts else "no"
                        row = [name, f"{place:g}", f"{stiffness:g}", what, f"{tolerance:g}", *counts, ratio]
                        print(f"| {' | '.join(row)} |", flush=True)
    print(
        f"With residual vectors a run that meets the tolerance takes {statistics.median(ratios):.2f} times the time "
        f"(median; {min(ratios):.2f} to {max(ratios):.2f} over {len(ratios)} scenes)."
    )


if __name__ == "__main__":
    main()
