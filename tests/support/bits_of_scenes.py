"""Seventy scenes of every kind, and the bits of their results in version 0.2.

`PYTHONPATH=tests python -m support.bits_of_scenes` writes `bits_of_scenes.json` anew: only for an intended change of
bits.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import scipy
import xarray as xr

import vibroimpact as vi
from support.places import EXAMPLES
from support.replay_scenes import BOARD, hit
from support.scenes import BEAM, CHAIN, FORCED, YIELDING
from support.serial_pool import campaign_here
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.fmus.shipped import package_folder
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene

KEPT = Path(__file__).with_suffix(".json")

SERIES = (
    "record.time_series={rate=7, variables="
    "['displacement','velocity','acceleration','contact_force','energy.kinetic']}"
)
SHORT = ("record.transient_periods=20", "record.recorded_periods=10")
RIGID = "stop=[{position=0.8, restitution=%s}]"
HERTZ = "stop=[{law='hertz', position=0.6, stiffness=200.0}]"
HUNT = "stop=[{law='hunt_crossley', position=0.6, stiffness=150.0, damping=0.3}]"
VOIGT = "stop=[{law='kelvin_voigt', position=0.6, stiffness=80.0, damping=0.4%s}]"
TWO = "stop=[{position=0.7, restitution=0.8}, {side='lower', position=-0.9, restitution=0.6}]"
SWEEP = "sweep={'forcing.angular_frequency'={start=0.6, stop=1.3, points=9%s}}"
COUPLED = ("execution.how=coupled", "execution.macro_step=0.05")

Written = tuple[str | Path, tuple[str, ...]]


def _of(text: str | Path, *changes: str) -> Written:
    return text, changes


def _example(name: str, *changes: str) -> Written:
    return EXAMPLES / f"{name}.toml", changes


THESIS: dict[str, Written] = {
    f"figure {name}": _example(f"thesis/figure_{name}", *changes)
    for name, changes in {
        "2_4a": SHORT,
        "2_4d": SHORT,
        "2_8": SHORT,
        "2_11": ("record.transient_periods=50", "record.recorded_periods=100"),
        "2_18": SHORT,
        "2_7": ("record.recorded_time=20.0", "sweep={}"),
        "4_5": SHORT,
        "6_4": (*SHORT, "sweep={}"),
        "6_5b": (),
        "6_6d": SHORT,
        "6_11": (*SHORT, "sweep={}"),
        "6_13": SHORT,
        "6_15": SHORT,
        "7_8a": SHORT,
        "7_10": SHORT,
        "7_11": SHORT,
    }.items()
}

SCENES: dict[str, Written] = THESIS | {
    "forced": _of(FORCED, SERIES),
    "free decay": _example("free_decay", "record.recorded_time=10.0"),
    "chatter": _example("chatter"),
    "two stops": _example("two_stops", *SHORT),
    "single run": _example("single_run"),
    "dead stop": _of(FORCED, RIGID % 0.0, SERIES),
    "elastic stop": _of(FORCED, RIGID % 1.0),
    "restitution that falls with speed": _of(FORCED, RIGID % "0.9, yield_velocity=0.05"),
    "both sides": _of(FORCED, TWO, SERIES),
    "shaken base": _of(FORCED, "forcing.kind=base_acceleration", SERIES),
    "phase": _of(FORCED, "forcing.phase=1.3"),
    "weight": _of(
        FORCED, "forcing.angular_frequency=0", "record={recorded_time=20.0}", RIGID % 0.6, "body.damping=0.01"
    ),
    "overdamped": _of(FORCED, "body.damping=4.0", "stop=[{position=0.05, restitution=0.5}]"),
    "no spring": _of(FORCED, "body.stiffness=0", TWO),
    "slopes": _of(
        FORCED, "body.frequency_slope=-0.05", "body.damping_slope=0.01", "body.damping_reciprocal=0.001"
    ),
    "Kelvin-Voigt": _of(FORCED, VOIGT % "", SERIES),
    "surface that comes back": _of(FORCED, VOIGT % ", relaxation_time=0.5"),
    "Hertz": _of(FORCED, HERTZ, SERIES),
    "Hunt-Crossley": _of(FORCED, HUNT, SERIES),
    "chain": _of(CHAIN),
    "chain with energies": _of(
        CHAIN,
        "record.time_series={rate=9, variables=['displacement[1]','modal_energy[2]','energy.contact_loss']}",
    ),
    "chain of two modes": _of(CHAIN, "body.modes=2"),
    "chain on two stops": _of(
        CHAIN,
        "stop=[{position=0.1, mass=2, restitution=0.7}, {side='lower', position=-0.05, mass=3, restitution=0.4}]",
    ),
    "chain on a spring": _of(CHAIN, f"stop=[{{position=0.1, mass=2, {YIELDING.replace(chr(10), ', ')}}}]"),
    "beam": _of(BEAM),
    "beam with energies": _of(
        BEAM,
        "record.time_series={rate=500, variables=['modal_displacement[2]','energy.damping_loss','contact_force[1]']}",
    ),
    "beam by collocation": _of(BEAM, "body.impact_projection=collocation"),
    "beam on a ball": _of(BEAM, "stop=[{law='hertz', position=0.0005, location=0.8, stiffness=1e8}]"),
    "beam with residual": _of(
        BEAM,
        "body.residual=true",
        "stop=[{law='kelvin_voigt', position=0.0005, location=0.8, stiffness=1e5}]",
    ),
    "beam that is shaken": _of(BEAM, "forcing.kind=base_acceleration", "forcing.amplitude=3.0"),
    "measured beam": _of(
        BEAM,
        "sensor={gain=1000.0}",
        "noise={seed=5, sensor=0.01}",
        "daq={rate=2000.0, bits=12, range=10.0, skew=1e-5, clock_error=30}",
        "record.time_series={variables=['sensor.displacement','sensor.velocity']}",
    ),
    "measured oscillator": _example("measuring_chain", "record.recorded_time=0.05"),
    "coupled": _example("coupled_p11", *SHORT),
    "coupled, held inputs": _of(FORCED, *COUPLED, "execution.exchange=jacobi"),
    "coupled, iterated": _of(FORCED, *COUPLED, "execution.exchange=iterated"),
    "coupled Hertz": _of(FORCED, *COUPLED, HERTZ),
    "coupled chain": _of(CHAIN, *COUPLED),
    "coupled beam": _of(BEAM, "execution.how=coupled", "execution.macro_step=0.002"),
    "guarded": _of(FORCED, *COUPLED, "execution.guard=true"),
    "two versions": _example("mixed_versions", "record.transient_time=20.0", "record.recorded_time=20.0"),
    "cradle": _example("newtons_cradle", "record.recorded_time=3.0"),
    "two oscillators": _example("two_oscillators", "record.recorded_time=20.0"),
    "pounding": _example("pounding", "record.recorded_time=3.0"),
    "sweep": _of(FORCED, SWEEP % ""),
    "sweep, up and down": _of(FORCED, SWEEP % ", path='up-down'", TWO),
    "sweep of all periods": _of(FORCED, SWEEP % "", "record.each_period=false"),
    "sweep of a chain": _of(CHAIN, SWEEP % ""),
    "sweep of a chain up": _of(CHAIN, SWEEP % ", path='up'"),
    "sweep of a beam": _of(BEAM, "sweep={'forcing.frequency'={start=20.0, stop=30.0, points=9}}"),
    "sweep of a Hertz stop": _of(FORCED, HERTZ, SWEEP % ""),
    "sweep, fused": _of(FORCED, SWEEP % "", "execution.how=fused"),
    "sweep, coupled": _of(FORCED, SWEEP % "", *COUPLED),
    "sweep of drawn values": _of(
        FORCED,
        "sweep={sample={design='sobol', points=8}, 'body.mass'={distribution='uniform', low=0.9, high=1.1}}",
    ),
    "campaign, up and down": _of(FORCED, SWEEP % ", path='up-down'", TWO),
    "campaign of two keys": _of(
        FORCED,
        "sweep={'forcing.angular_frequency'={start=0.6, stop=1.3, points=9, path='up'},"
        " 'stop[1].restitution'={values=[0.5, 0.7, 0.9]}}",
    ),
    "campaign that goes where motion jumps": _of(
        FORCED,
        "sweep={'stop[1].position'={start=0.4, stop=1.4, points=5, adaptive={tolerance=0.05, at_most=20}}}",
    ),
    "replay": _of(BOARD),
    "replay, coupled": _of(BOARD, "execution.how=coupled"),
}
LANES = (
    "sweep",
    "sweep of all periods",
    "sweep of a chain",
    "sweep of a beam",
    "sweep of drawn values",
    "campaign of two keys",
)
"""Scenes whose points run in the lanes of the vector registers."""


def scene_of(name: str) -> Scene:
    """Return a scene of the table."""
    text, changes = SCENES[name]
    return load_scene(text, changes) if isinstance(text, Path) else parse_scene(text, name, changes)


def dataset_of(name: str) -> xr.Dataset:
    """Return the dataset of a scene of the table: a run, a campaign in this process, or a replay."""
    scene = scene_of(name)
    with tempfile.TemporaryDirectory() as folder:
        if name.startswith("replay"):
            return vi.replay(scene, hit(Path(folder)))
        if not name.startswith("campaign"):
            return vi.run(scene, progress=False)
        with pytest.MonkeyPatch.context() as patch:
            campaign_here(patch, scene.to_toml(), Path(folder) / "campaign", runner=DEFAULT_RUNNER)
        return open_dataset(Path(folder) / "campaign").load()


def digest(dataset: xr.Dataset) -> str:
    """Return a fingerprint of all numbers of a dataset, except for the times of its points."""
    found = hashlib.sha256()
    for name in sorted(map(str, dataset.variables)):
        values = dataset[name].values
        if name != "point_seconds" and values.dtype.kind in "fiub":
            found.update(f"{name} {values.dtype} {values.shape}".encode())
            canonical = np.where(values != values, np.nan, values) if values.dtype.kind == "f" else values
            found.update(np.ascontiguousarray(canonical).tobytes())
    return found.hexdigest()[:16]


def fingerprint() -> str:
    """Return a hash of the C core's compiler, numpy, scipy, and the bits of sines, powers and linear algebra here.

    All of them differ between machines, and change the last bits of motions or of a replay's comparison.
    """
    x = np.linspace(0.1, 20.0, 4001)
    parts = [np.sin(x), np.cos(x), np.exp(-x), np.log(x), np.sqrt(x), x**0.3, np.sinh(x), np.arctan2(x, 2.0)]
    matrix = np.sin(np.outer(x[:12], x[:12])) + 12.0 * np.eye(12)
    parts += [np.linalg.eigh(matrix + matrix.T)[0], np.linalg.solve(matrix, x[:12])]
    library = next((package_folder() / "built").glob("*vibroimpact_core*")).read_bytes()
    compilers = sorted(set(re.findall(rb"(?:GCC: \(|clang version )[^\0]+", library)))
    libraries = f"{np.__version__} {scipy.__version__}".encode()
    return hashlib.sha256(b"".join([*compilers, libraries, *(part.tobytes() for part in parts)])).hexdigest()[
        :16
    ]


def kept() -> Mapping[str, str]:
    """Return the saved digests of a machine like this one; empty without such digests."""
    machines: dict[str, dict[str, str]] = json.loads(KEPT.read_text(encoding="ascii"))
    return machines.get(fingerprint(), {})


def main() -> None:
    """Write the digests of all scenes from this machine; digests of other machines are removed."""
    parser = argparse.ArgumentParser(prog="python -m support.bits_of_scenes", description=main.__doc__)
    parser.parse_args()
    digests = {name: digest(dataset_of(name)) for name in SCENES}
    KEPT.write_text(json.dumps({fingerprint(): digests}, indent=1) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
