"""diffrax, compiled by JAX: Dopri8 and Kvaerno5 with events, one motion or many at once (vmapped).

One compiled loop is the whole motion with all its impacts. Newton's method finds events, as diffrax's pages advise. The
motions of a batch differ in the amplitude of the force, as in a sweep; the first has the amplitude of the problem.
"""

from __future__ import annotations

import math
import os
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from peers.flights import HELD_STEP, LEAVING_STEP, slow_rebound
from peers.problems import Phase, Problem
from peers.ways import ABSOLUTE, Clock, Found, Run, Way, observed, tolerances
from vibroimpact.orchestrator.study.observation import Floats

BATCH = 128
"""Motions simulated at once."""
SPREAD = 1e-3
"""Spread of the force's amplitude in a batch, relative."""
FIRST_STEP = 1e-2
"""First step of a flight that does not start on the stop, over the period."""
ROOT = 1e-10
"""Last step of the root search relative to the time; its convergence is quadratic."""
MOST_STEPS = 200_000
"""Largest number of steps of one flight."""
ROOM, MOST_RESTS = 400, 16
"""Largest numbers of impacts and of rests."""


def one_thread() -> None:
    """Set JAX to one thread and to double precision; to be called before JAX is first imported."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    os.environ["JAX_ENABLE_X64"] = "1"
    os.environ["JAX_PLATFORMS"] = "cpu"


class Numbers(NamedTuple):
    """The parameters of a problem, as arguments of a compiled function: rungs of a ladder share the function."""

    matrices: Floats
    loads: Floats
    constants: Floats
    rows: Floats
    event_loads: Floats
    event_constants: Floats
    shape: Floats
    direction: Floats
    start: Floats
    w: float
    shift: float
    end: float
    position: float
    restitution: float


def _numbers(problem: Problem) -> Numbers:
    pieces = problem.pieces
    numbers: Any = Numbers  # arrays with one row for each piece, then numbers
    found: Numbers = numbers(
        *(
            np.array([getattr(piece, name) for piece in pieces])
            for name in ("matrix", "load", "constant", "event_row", "event_load", "event_constant")
        ),
        problem.shape,
        problem.direction,
        problem.start,
        problem.angular_frequency,
        problem.forcing_phase,
        problem.end,
        problem.stop.position,
        problem.stop.restitution if problem.is_rigid else 0.0,
    )
    return found


@cache
def _compiled(modes: int, rigid: bool, method: str, batch: int) -> Any:
    """Return the compiled function from amplitudes, tolerance, slow rebound and numbers to each motion's results."""
    import diffrax
    import jax
    import jax.numpy as jnp
    import optimistix

    n, solver = modes, getattr(diffrax, method)()

    def slope(t: Any, y: Any, args: Any) -> Any:
        phase, size, p = args
        wave = size * jnp.cos(p.w * t + p.shift)
        return p.matrices[phase] @ y + p.loads[phase] * wave + p.constants[phase]

    def event(t: Any, y: Any, args: Any, **others: Any) -> Any:
        phase, size, p = args
        wave = size * jnp.cos(p.w * t + p.shift)
        return p.rows[phase] @ y + p.event_loads[phase] * wave + p.event_constants[phase]

    def struck(t: Any, y: Any, size: Any, slow: Any, p: Any) -> Any:
        """Return the state after a rigid impact, whether the body rests, the start of the rest, and the first step."""
        r, speed = p.restitution, p.shape @ y[n:]
        y = y.at[:n].add(p.direction * (p.position - p.shape @ y[:n]))
        still = y.at[n:].add(-p.direction * speed)
        pull = -event(t, still, (int(Phase.HELD), size, p))
        rests = (r * speed < slow) & (pull > 0.0)
        after = jnp.where(rests, still, y.at[n:].add(-p.direction * (1.0 + r) * speed))
        # any first step suits a rest; a bounce starts with half of its ballistic length
        first = jnp.where(rests | (pull <= 0.0), FIRST_STEP * _period(p), r * speed / pull)
        return after, rests, t + 2.0 * r * speed / (pull * (1.0 - r)), first

    def simulated(size: Any, tolerance: Any, slow: Any, p: Any) -> Any:
        end, period = p.end, _period(p)
        controller = diffrax.PIDController(rtol=tolerance, atol=ABSOLUTE * tolerance)
        roots: Any = optimistix.Newton(rtol=ROOT, atol=ROOT)

        def more(state: Any) -> Any:
            t, _, _, _, count, rests, _, _, good = state
            return (t < end) & good & (count < ROOM) & (rests < MOST_RESTS)

        def flight(state: Any) -> Any:
            t, y, phase, first, count, rests, impacts, starts, _ = state
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(slope),
                solver,
                t,
                # a rest is followed over a part of the period at a time, to see its release
                jnp.where(phase == Phase.HELD, jnp.minimum(t + HELD_STEP * period, end), end),
                jnp.minimum(first, end - t),
                y,
                args=(phase, size, p),
                event=diffrax.Event(event, roots, direction=True),
                stepsize_controller=controller,
                adjoint=diffrax.ForwardMode(),
                max_steps=MOST_STEPS,
                throw=False,
            )
            good = (found.result == diffrax.RESULTS.successful) | (
                found.result == diffrax.RESULTS.event_occurred
            )
            met = found.event_mask
            t, y = found.ts[-1], found.ys[-1]
            hits = met & (phase == Phase.FREE)
            impacts = impacts.at[count].set(jnp.where(hits, jnp.array([t, p.shape @ y[n:]]), impacts[count]))
            count = count + hits
            if rigid:
                after, stays, began, step = struck(t, y, size, slow, p)
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
            jnp.asarray(p.start),
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
    return jax.jit(jax.vmap(simulated, in_axes=(0, None, None, None)))


def opened(method: str, batch: int, problem: Problem, tolerance: float, clock: Clock) -> Run:
    """Return a function that simulates a problem with one solver of diffrax; a first run compiles it here."""
    import jax

    ready: Any = jax.block_until_ready
    function, numbers = _compiled(problem.modes, problem.is_rigid, method, batch), _numbers(problem)
    size: Any = np.float64(1.0) if batch == 1 else 1.0 + SPREAD * np.linspace(0.0, 1.0, batch)
    slow = slow_rebound(tolerance)

    def run() -> Found:
        clock.start()
        result = ready(function(size, tolerance, slow, numbers))
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

    ready(function(size, tolerance, slow, numbers))
    return run


def _period(p: Any) -> Any:
    return 2.0 * math.pi / p.w


def ways() -> list[Way]:
    """Return one motion by an explicit and by an implicit solver, and many by the explicit one.

    A batch by the implicit solver takes minutes on the beam, and a compiled run cannot be stopped.
    """

    def way(method: str, batch: int) -> Way:
        return Way(
            f"diffrax {method}" if batch == 1 else f"diffrax {method}, {batch} vmapped",
            "diffrax",
            "rtol",
            tolerances,
            lambda problem, tolerance, clock: opened(method, batch, problem, tolerance, clock),
            batch=batch,
        )

    return [way("Dopri8", 1), way("Kvaerno5", 1), way("Dopri8", BATCH)]
