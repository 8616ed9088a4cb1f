"""The estimated error of a study's reference holds against the same motion in 40 digits, for each solvable kind."""

from __future__ import annotations

import math
from typing import Any

import mpmath as mp
import pytest
from support.exact_impacts import DIGITS, ExactBody, ExactMotion, ExactSine, ExactStop, diagonal
from support.exact_modes import beam_root, beam_shape

import vibroimpact as vi
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy.study import studied_scene
from vibroimpact.orchestrator.study.references import reference_of


def mass(tables: dict[str, Any]) -> tuple[ExactBody, list[mp.mpf]]:
    """Return the oscillator of a scene, and the row of its displacement."""
    body, forcing = tables["body"], tables["forcing"]
    sine = ExactSine([forcing["amplitude"]], forcing["angular_frequency"])
    mass, damping, stiffness = ([[body[name]]] for name in ("mass", "damping", "stiffness"))
    displacement, velocity = ([body.get(f"{name}_start", 0.0)] for name in ("displacement", "velocity"))
    return ExactBody(mass, damping, stiffness, [sine], displacement, velocity), [mp.mpf(1)]


def beam(tables: dict[str, Any]) -> tuple[ExactBody, list[mp.mpf]]:
    """Return the clamped-free beam of a scene, forced and stopped at its tip, from the textbook's shapes."""
    body, forcing = tables["body"], tables["forcing"]
    modes = range(1, body["modes"] + 1)
    with mp.workdps(DIGITS):
        length, line = mp.mpf(body["length"]), mp.mpf(body["mass_per_length"])
        rate = mp.sqrt(mp.mpf(body["flexural_rigidity"]) / (line * length**4))
        natural = [beam_root("clamped_free", j) ** 2 * rate for j in modes]
        shape = [beam_shape("clamped_free", j, 1.0, 0) / mp.sqrt(line * length) for j in modes]
        damping = [2 * mp.mpf(body["damping_ratio"]) * w for w in natural]
        sine = ExactSine([mp.mpf(forcing["amplitude"]) * n for n in shape], forcing["angular_frequency"])
        unit, still = diagonal([1.0] * len(shape)), [0.0] * len(shape)
        stiffness = diagonal([w * w for w in natural])
        return ExactBody(unit, diagonal(damping), stiffness, [sine], still, still), shape


def oscillator(stop: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return {
        "body": {"mass": 1.0, "stiffness": 1.0, "damping": 0.2},
        "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
        "stop": [stop],
        "record": {"transient_periods": 10, "recorded_periods": 3},
    } | changes


def graze(excess: float) -> dict[str, Any]:
    """Return a scene that starts at rest at the far side of a free swing; its peak exceeds the stop by `excess`."""
    with mp.workdps(DIGITS):
        peak = mp.exp(-mp.mpf("0.1") * mp.pi / mp.sqrt(1 - mp.mpf("0.01")))
    body = {"mass": 1.0, "stiffness": 1.0, "damping": 0.2, "displacement_start": -1.0}
    return {
        "body": body,
        "forcing": {"amplitude": 1e-30, "angular_frequency": 1.5},
        "stop": [{"position": float(peak) - excess, "restitution": 0.7}],
        "record": {"recorded_periods": 1},
    }


SOFT = {"law": "kelvin_voigt", "position": 1e-4, "stiffness": 1e4, "damping": 1.0}
STRIP = {
    "body": {
        **{"kind": "beam", "modes": 3, "damping_ratio": 0.02, "length": 0.25},
        **{"flexural_rigidity": 0.9333, "mass_per_length": 0.108},
    },
    "forcing": {"amplitude": 0.3, "angular_frequency": 165.0},
}
CASES: dict[str, dict[str, Any]] = {
    "orbit": oscillator(
        {"position": 1.0, "restitution": 0.7}, record={"transient_periods": 40, "recorded_periods": 3}
    ),
    "other orbit": oscillator({"position": 0.3, "restitution": 0.8}),
    "chatter": oscillator(
        {"position": -0.2, "restitution": 0.6},
        body={"mass": 1.0, "stiffness": 1.0, "damping": 0.2, "displacement_start": -1.0},
        forcing={"amplitude": 0.05, "angular_frequency": 0.5},
        record={"recorded_periods": 1},
    ),
    **{f"graze of {excess:g}": graze(excess) for excess in (1e-2, 1e-3, 1e-4, 1e-5)},
    "Kelvin-Voigt": oscillator({"law": "kelvin_voigt", "position": 0.3, "stiffness": 1e2, "damping": 1.0}),
    **{
        f"Kelvin-Voigt, {stiffness:g} N/m": oscillator(
            {
                **{"law": "kelvin_voigt", "position": 0.3, "stiffness": stiffness},
                "damping": 0.06 * math.sqrt(stiffness),
            }
        )
        for stiffness in (1e4, 1e8, 1e12)
    },
    "beam on a Kelvin-Voigt stop": STRIP | {"stop": [SOFT], "record": {"recorded_periods": 2}},
    "beam on a rigid stop": STRIP
    | {"stop": [{"position": 1e-3, "restitution": 0.6}], "record": {"recorded_periods": 1}},
}


@pytest.mark.parametrize("name", CASES)
def test_the_estimated_error_of_a_reference_holds_in_40_digits(name: str) -> None:
    tables = CASES[name]
    scene = studied_scene(Scene.from_dict(tables))
    reference = reference_of(scene)
    assert not reference.chaotic
    assert ("closed form" in reference.name) == (name == "orbit")
    law = {key: value for key, value in tables["stop"][0].items() if key != "law"}
    body, row = beam(tables) if "kind" in tables["body"] else mass(tables)
    motion = ExactMotion(body, [ExactStop(row, **law)])
    # from time 0: such a run has all impacts, and the study compares only the recorded ones
    whole = scene.with_values(
        {
            "record.recorded_periods": scene.record.recorded_periods + scene.record.transient_periods,
            "record.transient_periods": 0,
        }
    )
    hits = vi.run(whole, progress=False).vibroimpact.impacts()
    sticks = vi.run(whole, progress=False).vibroimpact.sticks()
    end = float(sticks.stick_start.min()) if sticks.stick_start.size else math.inf
    exact = [hit for _ in range(int((hits.impact_time < end).sum())) if (hit := motion.next_impact())]
    own = reference.observation.impacts
    own = own[own[:, 0] < end]
    assert 0 < len(own) <= len(exact)
    exact = exact[-len(own) :]
    times = [abs(each.time - mp.mpf(hit[0])) for hit, each in zip(own, exact, strict=True)]
    speeds = [abs(each.velocity - mp.mpf(hit[1])) for hit, each in zip(own, exact, strict=True)]
    assert float(max(times)) / reference.scales.time <= reference.error["impact_time"]
    assert float(max(speeds)) / own[:, 1].max() <= reference.error["impact_velocity"]
    final = reference.observation.final
    if end == math.inf and final[0] < law["position"]:
        displacement, velocity = (mp.fdot(row, each) for each in motion.at(reference.scales.window[1]))
        size = reference.observation.displacement_range
        rate = 2.0 * math.pi / reference.scales.time
        off = max(abs(final[0] - displacement) / size, abs(final[1] - velocity) / (size * rate))
        assert float(off) <= reference.error["final_state"]


def test_a_graze_that_a_small_change_undoes_is_known_to_nothing() -> None:
    assert reference_of(studied_scene(Scene.from_dict(graze(1e-7)))).chaotic
