"""Does `vibroimpact accuracy` recommend the cheapest adequate setting, and does that setting meet its tolerance?

Three scenes: an oscillator on a rigid stop, an oscillator on a Hertz stop, and a beam of eight modes on a Kelvin-Voigt
stop. The command runs as a user types it, with a tolerance and `--write`. Then, in a fresh process:

- the recommendation and all adequate methods of the study are timed (medians, in turns); the goal is at most 1.5 times
  the cheapest;
- the written scene is compared with a reference outside of the study. It integrates the modal equations with scipy's
  DOP853, restarted at each touch and release.

Run with `python tests/benchmarks/bench_accuracy.py [--repetitions 9]`.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp

from vibroimpact.fmus.core import beam_modes
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.window import recorded_window
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, OscillatorBody
from vibroimpact.orchestrator.scene.models import HertzStop, KelvinVoigtStop, RestitutionStop
from vibroimpact.orchestrator.study.accuracy.study import studied_scene
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.references import observed, scales_of
from vibroimpact.orchestrator.study.ways.all_ways import ways_of

EXAMPLES = Path(__file__).parents[2] / "examples"
TOLERANCE = 1e-6
GOAL = 1.5
MOST_TOUCHES = 10_000
UNSEEN = {"rtol": 1e-12, "atol": 1e-15}
SCENES = {
    "oscillator, rigid stop": (EXAMPLES / "single_run.toml").read_text(encoding="utf-8"),
    "oscillator, Hertz stop": """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping = 0.2
[forcing]
amplitude = 1.0
angular_frequency = 0.9
[[stop]]
law = "hertz"
position = 0.5
stiffness = 1e3
[record]
transient_periods = 30
recorded_periods = 5
""",
    "beam of 8 modes, Kelvin-Voigt stop": """
[scene]
units = "nondimensional"
[body]
kind = "beam"
length = 1.0
flexural_rigidity = 1.0
mass_per_length = 1.0
modes = 8
damping_ratio = 0.05
[forcing]
amplitude = 1.0
angular_frequency = 4.5
[[stop]]
law = "kelvin_voigt"
position = 0.02
stiffness = 100.0
damping = 0.5
[record]
transient_periods = 30
recorded_periods = 5
""",
}


class Modal:
    """The equations of motion of a body with one upper stop, written independently: equations.md 1.1, 6.1."""

    def __init__(self, scene: Scene) -> None:
        body, forcing = scene.body, scene.forcing
        (self.stop,) = scene.stops
        assert forcing is not None
        if isinstance(body, OscillatorBody):
            scale = 1.0 / math.sqrt(body.mass)
            self.shape = self.force = np.array([scale])
            self.square, self.damping = (
                np.array([body.stiffness / body.mass]),
                np.array([body.damping / body.mass]),
            )
        else:
            assert isinstance(body, BeamBody)
            modes = beam_modes("clamped_free", body.size)
            rates = modes.eigenvalues**2  # of unit rigidity, mass and length
            self.shape = self.force = modes.shapes(1.0)[0]
            self.square = rates**2
            self.damping = 2.0 * float(body.damping_ratio) * rates  # type: ignore[arg-type]
        self.amplitude, self.frequency = forcing.scalar_amplitude, forcing.angular_frequency
        self.phase = float_parameters(scene, None)["forcing.phase"]

    def pressing(self, depth: float, rate: float) -> float:
        """Return the force of the stop."""
        stop = self.stop
        if isinstance(stop, KelvinVoigtStop):
            return stop.stiffness * depth + stop.damping * rate
        assert isinstance(stop, HertzStop)
        return float(stop.stiffness * max(depth, 0.0) ** 1.5)

    def motion(self, end: float) -> tuple[list[tuple[float, float, float]], np.ndarray[Any, Any]]:
        """Return time, speed and end of each contact that has ended, and the state at the end."""
        modes = len(self.shape)
        rigid = isinstance(self.stop, RestitutionStop)
        position, touching, contact_start = self.stop.position, False, (0.0, 0.0)

        def rates(t: float, y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
            q, p = y[:modes], y[modes:]
            load = self.force * self.amplitude * math.cos(self.frequency * t + self.phase)
            if touching:
                load = load - self.shape * self.pressing(
                    float(self.shape @ q) - position, float(self.shape @ p)
                )
            return np.concatenate([p, load - self.damping * p - self.square * q])

        def reaches(t: float, y: np.ndarray[Any, Any]) -> float:
            return float(self.shape @ y[:modes]) - position

        def lets_go(t: float, y: np.ndarray[Any, Any]) -> float:
            return self.pressing(float(self.shape @ y[:modes]) - position, float(self.shape @ y[modes:]))

        reaches.terminal = lets_go.terminal = True  # type: ignore[attr-defined]
        reaches.direction, lets_go.direction = 1.0, -1.0  # type: ignore[attr-defined]
        t, y = 0.0, np.zeros(2 * modes)
        touches: list[tuple[float, float, float]] = []
        for _ in range(MOST_TOUCHES):
            event = lets_go if touching else reaches
            found = solve_ivp(rates, (t, end), y, method="DOP853", events=event, **UNSEEN)
            t, y = float(found.t[-1]), found.y[:, -1].copy()
            if found.status == 0:
                return touches, y
            if touching:
                touching = False
                touches.append((*contact_start, t))
                continue
            speed = float(self.shape @ y[modes:])
            contact_start = (t, speed)
            if rigid:
                touches.append((*contact_start, t))
                restitution = self.stop.restitution  # type: ignore[union-attr]
                y[modes:] -= (1.0 + restitution) * speed * self.shape / (self.shape @ self.shape)
            touching = not rigid
        raise RuntimeError(f"expected at most {MOST_TOUCHES} touches, got more by {t}")


def unseen(scene: Scene) -> Observation:
    """Return the observation of a scene by the independent integration."""
    begin, end = recorded_window(scene, float_parameters(scene, None))
    modal = Modal(scene)
    touches, state = modal.motion(end)
    rows = np.array([(t, speed, 1.0) for t, speed, over in touches if begin < over <= end]).reshape(-1, 3)
    modes = len(modal.shape)
    final = (float(modal.shape @ state[:modes]), float(modal.shape @ state[modes:]))
    return Observation(rows, final=final)


def judged(
    scene_file: Path, tuned: Path, labels: list[str], chosen: str, repetitions: int
) -> dict[str, float]:
    """Time the adequate methods in turns, and compare the written scene with the independent reference."""
    scene = studied_scene(load_scene(scene_file))
    trials = {way.label: way.open(None) for way in ways_of(scene) if way.label in labels}
    times: dict[str, list[float]] = {label: [] for label in trials}
    for turn in range(repetitions + 1):
        for label, trial in trials.items():
            began = time.perf_counter()
            trial.run()
            if turn:
                times[label].append(time.perf_counter() - began)
    for trial in trials.values():
        trial.close()
    medians = {label: statistics.median(each) for label, each in times.items()}
    written = load_scene(tuned).with_values({"record.impacts": True, "record.extrema": True})
    errors = errors_of(observed(written), unseen(written), scales_of(written))
    worst = math.inf if errors.failure else max(errors.of["impact_time"], errors.of["impact_velocity"])
    return {"cost": medians[chosen], "cheapest": min(medians.values()), "error": worst, "ways": len(medians)}


def study(name: str, text: str, repetitions: int) -> str:
    """Return a row of the table."""
    with tempfile.TemporaryDirectory() as folder:
        scene, data, tuned = (Path(folder, file) for file in ("scene.toml", "study.nc", "tuned.toml"))
        scene.write_text(text, encoding="utf-8")
        command = [str(Path(sys.executable).with_name("vibroimpact")), "accuracy", str(scene)]
        began = time.perf_counter()
        subprocess.run(
            [*command, "--tolerance", str(TOLERANCE), "--write", str(tuned), "-o", str(data)],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        seconds = time.perf_counter() - began
        with xr.open_dataset(data) as found:
            adequate = (found.error + found.attrs["reference_error"] <= TOLERANCE) & ~found.is_model.astype(
                bool
            )
            labels = [
                f"{way}, {knob} {setting:.3g}" if knob else way
                for way, knob, setting in zip(
                    *(found[key].values[adequate.values] for key in ("name", "knob", "setting")), strict=True
                )
            ]
            chosen = str(found.attrs["chosen"])
        request = json.dumps([str(scene), str(tuned), labels, chosen, repetitions])
        child = subprocess.run(
            [sys.executable, __file__, "--child", request], check=True, capture_output=True, text=True
        )
        anew = json.loads(child.stdout)
    ratio = anew["cost"] / anew["cheapest"]
    met = "met" if ratio <= GOAL and anew["error"] <= TOLERANCE else "MISSED"
    return (
        f"| {name} | {seconds:.0f} s | {chosen} | {anew['cost'] * 1e3:.3g} ms | {ratio:.2f} of {anew['ways']:.0f} | "
        f"{anew['error']:.1e} | {met} |"
    )


def main() -> int:
    """Print the table; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        scene, tuned, labels, chosen, repetitions = json.loads(options.child)
        print(json.dumps(judged(Path(scene), Path(tuned), labels, chosen, repetitions)))
        return 0
    print(
        f"| scene | study | recommended for {TOLERANCE:g} | anew | over the cheapest | error, unseen | goals |"
    )
    print("|---|---|---|---|---|---|---|")
    rows = []
    for name, text in SCENES.items():
        rows.append(study(name, text, options.repetitions))
        print(rows[-1], flush=True)
    missed = sum("MISSED" in row for row in rows)
    met = len(rows) - missed
    print(f"The recommendation was adequate and at most {GOAL:g} times the cheapest in {met} of {len(rows)}.")
    return 0 if missed == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
