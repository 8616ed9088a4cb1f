"""diffrax, compiled by JAX: Dopri8 and Kvaerno5 with events, one motion or many at once (vmapped).

The whole motion with all its impacts is one compiled loop. The roots of events are found by Newton's method, as its pages advise;
the motions of a batch differ in the amplitude of the force, as in a sweep, and the first is the one that is asked for.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from peers.flights import HELD_STEP, LEAVING_STEP, slow_rebound
from peers.problems import Phase, Problem
from peers.ways import ABSOLUTE, Clock, Found, Run, Way, observed, tolerances
from vibroimpact.orchestrator.study.observation import Floats

BATCH = 128
"""Motions that are simulated at once."""
SPREAD = 1e-3
"""Of the force's amplitude in a batch, relative."""
FIRST_STEP = 1e-2
"""First step of a flight that does not start on the stop, over the period."""
ROOT = 1e-10
"""Last step of the search for a root, whose convergence is quadratic; relative to the time."""
MOST_STEPS = 200_000
"""Of one flight."""
ROOM, MOST_RESTS = 400, 16
"""Impacts and rests that there is room for."""


def one_thread() -> None:
    """Keep JAX to one thread and to double precision: before it is imported for the first time."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    os.environ["JAX_ENABLE_X64"] = "1"
    os.environ["JAX_PLATFORMS"] = "cpu"


def _compiled(problem: Problem, solver: Any, batch: int) -> Any:
    """Return the compiled function: amplitudes, tolerance and slow rebound to what became of each motion."""
    import diffrax
    import jax
    import jax.numpy as jnp
    import optimistix

    n, w, shift, period, end = (
        problem.modes,
        problem.angular_frequency,
        problem.forcing_phase,
        problem.period,
        problem.end,
    )
    pieces = problem.pieces
    matrices, loads, constants, rows = (
        jnp.array([getattr(piece, name) for piece in pieces])
        for name in ("matrix", "load", "constant", "event_row")
    )
    event_loads = jnp.array([piece.event_load for piece in pieces])
    event_constants = jnp.array([piece.event_constant for piece in pieces])
    shape, direction = jnp.array(problem.shape), jnp.array(problem.direction)
    rigid, position = problem.is_rigid, problem.stop.position
    r = problem.stop.restitution if rigid else 0.0

    def slope(t: Any, y: Any, args: Any) -> Any:
        phase, size = args
        return matrices[phase] @ y + loads[phase] * (size * jnp.cos(w * t + shift)) + constants[phase]

    def event(t: Any, y: Any, args: Any, **others: Any) -> Any:
        phase, size = args
        wave = size * jnp.cos(w * t + shift)
        return rows[phase] @ y + event_loads[phase] * wave + event_constants[phase]

    def struck(t: Any, y: Any, size: Any, slow: Any) -> Any:
        """Return the state after a rigid impact, whether the body rests, when the rest began, the first step."""
        speed = shape @ y[n:]
        y = y.at[:n].add(direction * (position - shape @ y[:n]))
        still = y.at[n:].add(-direction * speed)
        pull = -event(t, still, (int(Phase.HELD), size))
        rests = (r * speed < slow) & (pull > 0.0)
        after = jnp.where(rests, still, y.at[n:].add(-direction * (1.0 + r) * speed))
        # a rest may be in no hurry; a bounce begins with half of its ballistic length
        first = jnp.where(rests | (pull <= 0.0), FIRST_STEP * period, r * speed / pull)
        return after, rests, t + 2.0 * r * speed / (pull * (1.0 - r)), first

    def simulated(size: Any, tolerance: Any, slow: Any) -> Any:
        controller = diffrax.PIDController(rtol=tolerance, atol=ABSOLUTE * tolerance)
        roots = optimistix.Newton(rtol=ROOT, atol=ROOT)

        def more(state: Any) -> Any:
            t, _, _, _, count, rests, _, _, good = state
            return (t < end) & good & (count < ROOM) & (rests < MOST_RESTS)

        def flight(state: Any) -> Any:
            t, y, phase, first, count, rests, impacts, starts, _ = state
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(slope),
                solver,
                t,
                # the force of a rest is watched over a part of the period at a time
                jnp.where(phase == Phase.HELD, jnp.minimum(t + HELD_STEP * period, end), end),
                jnp.minimum(first, end - t),
                y,
                args=(phase, size),
                event=diffrax.Event(event, roots, direction=True),
                stepsize_controller=controller,
                adjoint=diffrax.ForwardMode(),
                max_steps=MOST_STEPS,
                throw=False,
            )
            good = (found.result == diffrax.RESULTS.successful) | (found.result == diffrax.RESULTS.event_occurred)
            met = found.event_mask
            t, y = found.ts[-1], found.ys[-1]
            hits = met & (phase == Phase.FREE)
            impacts = impacts.at[count].set(jnp.where(hits, jnp.array([t, shape @ y[n:]]), impacts[count]))
            count = count + hits
            if rigid:
                after, stays, began, step = struck(t, y, size, slow)
                y = jnp.where(hits, after, y)
                starts = starts.at[rests].set(jnp.where(hits & stays, began, starts[rests]))
                rests = rests + (hits & stays)
                leaves = LEAVING_STEP * period
                first = jnp.where(hits, step, jnp.where(met, leaves, FIRST_STEP * period))
                phase = jnp.where(hits & stays, Phase.HELD, jnp.where(met, Phase.FREE, phase))
            else:
                onward = jnp.array([Phase.PRESSED, Phase.FREE, Phase.SLACK, Phase.FREE])
                phase = jnp.where(met, onward[phase], phase)
                first = FIRST_STEP * period * jnp.array([1.0, 1.0, 1e-3, 1e-1])[phase]
            return t, y, phase, first, count, rests, impacts, starts, good

        state = (
            jnp.zeros(()),
            jnp.array(problem.start),
            jnp.array(int(Phase.FREE)),
            jnp.array(FIRST_STEP * period),
            jnp.array(0),
            jnp.array(0),
            jnp.full((ROOM + 1, 2), jnp.nan),
            jnp.full(MOST_RESTS + 1, jnp.nan),
            jnp.array(True),
        )
        _, y, _, _, count, rests, impacts, starts, good = jax.lax.while_loop(more, flight, state)
        return y, count, rests, impacts, starts, good

    if batch == 1:
        return jax.jit(simulated)
    return jax.jit(jax.vmap(simulated, in_axes=(0, None, None)))


def opened(method: str, batch: int, problem: Problem, tolerance: float, clock: Clock) -> Run:
    """Return what simulates a problem with one solver of diffrax; it is compiled here, by a first run."""
    import diffrax
    import jax

    function = _kept(problem, method, batch, getattr(diffrax, method)())
    size: Any = np.float64(1.0) if batch == 1 else 1.0 + SPREAD * np.linspace(0.0, 1.0, batch)
    slow = slow_rebound(tolerance)

    def run() -> Found:
        clock.start()
        result = jax.block_until_ready(function(size, tolerance, slow))
        y, count, rests, impacts, starts, good = (
            np.asarray(part) if batch == 1 else np.asarray(part)[0] for part in result
        )
        clock.check()
        failure = "" if good else "a flight, or the search for its end, failed"
        if count >= ROOM or rests >= MOST_RESTS:
            failure = "more impacts or rests than there is room for"
        rows: Floats = impacts[: int(count)]
        seen = [(float(t), float(v)) for t, v in rows]
        return Found(observed(seen, problem.contact(y), failure), starts[: int(rests)], batch)

    run()
    return run


_COMPILED: dict[tuple[int, str, int], Any] = {}


def _kept(problem: Problem, method: str, batch: int, solver: Any) -> Any:
    """Return the compiled function of a problem, which all tolerances share."""
    key = (id(problem), method, batch)
    if key not in _COMPILED:
        _COMPILED[key] = _compiled(problem, solver, batch)
    return _COMPILED[key]


def ways() -> list[Way]:
    """Return one motion and many, by an explicit and by an implicit solver."""

    def way(method: str, batch: int) -> Way:
        return Way(
            f"diffrax {method}" if batch == 1 else f"diffrax {method}, {batch} vmapped",
            "diffrax",
            "rtol",
            tolerances,
            lambda problem, tolerance, clock: opened(method, batch, problem, tolerance, clock),
        )

    return [way(method, batch) for method in ("Dopri8", "Kvaerno5") for batch in (1, BATCH)]
