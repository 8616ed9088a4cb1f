"""Whether a fault is detected, by quick tests or by `hard-cases`, and whether it changes any result at all."""

from __future__ import annotations

import hashlib
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from support.places import EXAMPLES, ROOT, TESTS

from mutants._copies import DoesNotCompile, copy_with
from mutants._faults import Fault

QUICK = (
    *(
        "reference/test_structure_reference.py",
        "reference/test_flow_examples.py",
        "reference/test_impact_examples.py",
    ),
    *("reference/test_simultaneous_impacts.py", "reference/test_chatter_and_release.py"),
    *("reference/test_impact_projection.py", "reference/test_chain_modes.py", "unit/fmus/core/test_modes.py"),
    *("property/test_lanes_property.py", "property/test_lanes_of_points_property.py"),
    *(
        "property/test_contact_law_property.py",
        "hard_cases/test_grazing_in_lanes.py",
        "hard_cases/test_balls.py",
    ),
    *("hard_cases/test_structures_grazing.py", "hard_cases/test_structures_stops.py"),
    *("hard_cases/test_structures_compliant.py",),
    *("hard_cases/test_long_rests.py", "hard_cases/test_structures_extremes.py"),
    *("unit/fmus/native/test_oscillator_fmu.py", "unit/fmus/native/test_chain_fmu.py"),
    *("unit/fmus/native/test_beam_fmu.py",),
)
"""Tests of references and laws that take half a minute together."""
SECONDS = 60
"""Largest processor time of a check of a fault, s."""
HARD_CASES = "from vibroimpact.orchestrator.commands.cli import main; main()"
PROBE = "from mutants._trial import main; main()"


def noticed(fault: Fault | None) -> str | None:
    """Return the check that detects a fault, `no result` if it changes no result, None if it survives.

    Raises
    ------
    DoesNotCompile
    """
    with tempfile.TemporaryDirectory(prefix="mutant-") as name:
        folder = Path(name)
        python = [sys.executable, "-W", "ignore"]
        path = os.pathsep.join([str(copy_with(fault, folder)), str(TESTS)])
        environment = os.environ | {"PYTHONPATH": path, "VIBROIMPACT_CACHE": str(folder / "cache")}
        (folder / "cache").mkdir(mode=0o700)

        def ends_well(*command: str) -> bool:
            def limit() -> None:
                resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))

            done = subprocess.run(
                [*python, *command],
                cwd=folder,
                env=environment,
                capture_output=True,
                preexec_fn=limit,
                timeout=20 * SECONDS,
            )
            return done.returncode == 0

        tests = [str(TESTS / one) for one in QUICK]
        pytest = ("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-c", str(ROOT / "pyproject.toml"))
        if not ends_well(*pytest, "--rootdir", str(ROOT), "-m", "not long", *tests):
            return "quick tests"
        if not ends_well("-c", HARD_CASES, "hard-cases"):
            return "hard-cases"
        if fault is None:
            return None
        results = (
            subprocess.run(
                [*python, "-c", PROBE], cwd=folder, env=other, capture_output=True, text=True
            ).stdout
            for other in (environment, environment | {"PYTHONPATH": str(TESTS)})
        )
        return "no result" if len(set(results)) == 1 else None


def tried(faults: Iterable[Fault]) -> str | None:
    """Try the first fault that compiles and changes a result; return it if it survives."""
    for fault in faults:
        try:
            answer = noticed(fault)
        except DoesNotCompile:
            continue
        if answer != "no result":
            return None if answer else f"survived: {fault.described()}"
    return "no fault that changes a result"


def main() -> None:
    """Print a digest of the results of all examples of one body, and of random bodies in lanes."""
    import numpy as np
    from support.lane_points import drawn, run

    from vibroimpact import run as run_scene
    from vibroimpact.fmus.errors import VibroimpactError
    from vibroimpact.orchestrator.scene import load_scene

    digest = hashlib.sha256()
    for path in sorted(EXAMPLES.rglob("*.toml")):
        try:
            scene = load_scene(path)
            if not scene.is_lone_body or scene.run_count > 1000:
                continue
            found = run_scene(scene, progress=False)
        except VibroimpactError as error:
            digest.update(str(error).encode())
            continue
        for name in sorted(set(map(str, found.variables)) - {"point_seconds"}):
            if found[name].dtype.kind in "fiu":
                digest.update(np.ascontiguousarray(found[name].values).tobytes())
    for modes, contacts in ((1, 1), (1, 2), (2, 1), (4, 2), (8, 2)):
        for rows in run(drawn(40, modes, contacts, 5)).rows:
            digest.update(np.ascontiguousarray(rows).tobytes())
    print(digest.hexdigest())
