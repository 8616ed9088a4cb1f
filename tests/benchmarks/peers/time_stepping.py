"""MuJoCo: steps of equal size, the stop a soft limit of a tendon that measures the contact point, all steps in C.

Each mode is a slide joint with its spring and dashpot; the force is a motor on a second tendon. A limit is a spring and
a dashpot that only push. A negative `solref` gives them directly, and the smallest `solimp` adds them to the other
forces. So a Kelvin-Voigt stop is the same model up to 1e-4 of the other forces.

A rigid stop is another model: a contact of ten steps, which becomes stiffer as steps become shorter. Its damping ratio
gives a rigid mass its restitution (equations.md 6.9). Impacts are interpolated crossings of the stop between two steps.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from peers.problems import Problem
from peers.ways import Clock, Found, Run, Way, observed
from vibroimpact.orchestrator.study.ways.equal_restitution import damping_ratio_of

STEPS_A_PERIOD = (500.0, 5_000.0)
CONTACT_STEPS = 10.0
"""Length of a contact that replaces a rigid impact, steps."""
IMPEDANCE = 1e-4
"""Smallest impedance that MuJoCo accepts."""
REST = 0.05
"""Length of a contact, over the period, above which it is a rest."""
INTEGRATORS = ("Euler", "RK4")


def model_of(problem: Problem, step: float, integrator: str) -> str:
    """Return the model in MuJoCo's XML."""
    stiffness, damping = _limit(problem, step)
    modes = range(problem.modes)
    bodies = "".join(
        f'<body><joint name="q{j}" type="slide" axis="1 0 0" stiffness="{float(problem.natural[j]) ** 2!r}" '
        f'damping="{float(problem.damping[j])!r}"/>'
        '<geom type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/></body>'
        for j in modes
    )
    contact = "".join(f'<joint joint="q{j}" coef="{float(problem.shape[j])!r}"/>' for j in modes)
    drive = "".join(f'<joint joint="q{j}" coef="{float(problem.force[j])!r}"/>' for j in modes)
    solimp = f"{IMPEDANCE} {IMPEDANCE} 1 0.5 1"
    return (
        f'<mujoco><option timestep="{step!r}" gravity="0 0 0" integrator="{integrator}"/>'
        f"<worldbody>{bodies}</worldbody><tendon>"
        f'<fixed name="contact" limited="true" range="-1e6 {float(problem.stop.position)!r}" '
        f'solreflimit="{-stiffness!r} {-damping!r}" solimplimit="{solimp}">{contact}</fixed>'
        f'<fixed name="drive">{drive}</fixed></tendon>'
        '<actuator><motor tendon="drive"/></actuator></mujoco>'
    )


def _limit(problem: Problem, step: float) -> tuple[float, float]:
    """Return stiffness and damping of the limit over the effective mass at the stop: 1/s^2 and 1/s."""
    share = float(problem.shape @ problem.shape)
    if not problem.is_rigid:
        return share * problem.stop.stiffness, share * problem.stop.damping
    ratio = damping_ratio_of(problem.stop.restitution)
    rate = 2.0 * math.acos(ratio) / (CONTACT_STEPS * step * math.sqrt(1.0 - ratio**2))
    return rate**2, 2.0 * ratio * rate


def opened(integrator: str, problem: Problem, steps: float, clock: Clock) -> Run:
    """Return a function that simulates a problem by `steps` steps a period."""
    import mujoco
    from mujoco import rollout

    # without this MuJoCo writes a log file into the current folder; the error of a failed motion shows it anyway
    mujoco.set_mju_user_warning(lambda _: None)
    count = math.ceil(problem.end / problem.period * steps)
    step = problem.end / count
    model: Any = mujoco.MjModel.from_xml_string(model_of(problem, step, integrator))
    data: Any = mujoco.MjData(model)
    n = problem.modes
    data.qpos[:], data.qvel[:] = problem.start[:n], problem.start[n:]
    spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, data, start, spec)
    # the force is constant over a step, with its value at the middle
    instants = (np.arange(count) + 0.5) * step
    force = np.cos(problem.angular_frequency * instants + problem.forcing_phase)[None, :, None]
    states = np.empty((1, count, start.size))

    def run() -> Found:
        clock.start()
        rollout.rollout(model, data, start[None, :], force, state=states)
        clock.check()
        q, p = states[0, :, 1 : 1 + n], states[0, :, 1 + n : 1 + 2 * n]
        gap = np.concatenate([[problem.shape @ problem.start[:n]], q @ problem.shape]) - problem.stop.position
        speed = np.concatenate([[problem.shape @ problem.start[n:]], p @ problem.shape])
        inside = gap > 0.0
        begins = np.flatnonzero(~inside[:-1] & inside[1:])
        part = -gap[begins] / (gap[begins + 1] - gap[begins])
        times = (begins + part) * step
        speeds = speed[begins] + (0.0 if problem.is_rigid else part * (speed[begins + 1] - speed[begins]))
        ends = np.append(np.flatnonzero(inside[:-1] & ~inside[1:]), count)
        lasts = np.array([ends[np.searchsorted(ends, b)] - b for b in begins]) * step
        seen = [(float(t), float(v)) for t, v in zip(times, speeds, strict=True)]
        rests = times[lasts > REST * problem.period] if len(times) else times
        return Found(observed(seen, (float(gap[-1] + problem.stop.position), float(speed[-1]))), rests)

    return run


def ways() -> list[Way]:
    """Return one way for each integrator."""

    def way(integrator: str) -> Way:
        return Way(
            f"MuJoCo {integrator}",
            "mujoco",
            "steps a period",
            lambda problem: STEPS_A_PERIOD,
            lambda problem, steps, clock: opened(integrator, problem, steps, clock),
        )

    return [way(integrator) for integrator in INTEGRATORS]
