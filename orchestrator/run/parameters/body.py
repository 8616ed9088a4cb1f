"""From a scene to its body's FMU: which one, its parameters, and the state that a continuation carries."""

from __future__ import annotations

from vibroimpact.orchestrator.run.parameters.beam import beam_floats, beam_integers
from vibroimpact.orchestrator.run.parameters.chain import chain_floats, chain_integers
from vibroimpact.orchestrator.run.parameters.contact import contact_floats, contact_integers
from vibroimpact.orchestrator.run.parameters.oscillator import oscillator_floats, oscillator_start
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.models import BeamBody, ChainBody, OscillatorBody

FMU_NAMES = {"oscillator": "Oscillator", "chain": "Chain", "beam": "Beam"}


def float_parameters(scene: Scene, start: tuple[float, ...] | None) -> dict[str, float]:
    """Return the real parameters of the body's FMU, by variable name, SI.

    Parameters
    ----------
    scene : Scene
        A scene of the short form.
    start : tuple of float or None
        State carried over from the run before, at forcing phase 0: of an oscillator displacement (m) and
        velocity (m/s), else the values of `state_variables`. What lies beyond a rigid stop (the stop moved)
        is put on it, at rest. None: the scene's own start.
    """
    parameters = _own_floats(scene) | contact_floats(scene)
    if scene.forcing is not None:
        parameters["forcing.angular_frequency"] = scene.forcing.angular_frequency
        parameters["forcing.phase"] = scene.forcing.phase
    if scene.execution.contact_tolerance is not None:
        parameters["contact_tolerance"] = scene.execution.contact_tolerance
    if start is not None:
        parameters |= _carried(scene, start)
        if scene.period is not None:
            parameters["forcing.phase"] = 0.0
    return parameters


def _own_floats(scene: Scene) -> dict[str, float]:
    body = scene.body
    if isinstance(body, OscillatorBody):
        return oscillator_floats(body, scene)
    return chain_floats(body, scene) if isinstance(body, ChainBody) else beam_floats(body, scene)


def _carried(scene: Scene, start: tuple[float, ...]) -> dict[str, float]:
    if isinstance(scene.body, OscillatorBody):
        return oscillator_start(scene, start)
    # what finds the shapes of a beam takes time to load, and only a continuation of structures needs it
    from vibroimpact.orchestrator.run.carried_state import on_free_side

    names = _start_variables(scene)
    return dict(zip(names, on_free_side(scene, scene.body, start), strict=True))


def integer_parameters(scene: Scene) -> dict[str, int]:
    """Return the integer and enumeration parameters of the body's FMU."""
    parameters = {"impact_limit": scene.execution.impact_limit}
    if isinstance(scene.body, ChainBody):
        parameters |= chain_integers(scene.body, scene)
    elif isinstance(scene.body, BeamBody):
        parameters |= beam_integers(scene.body, scene)
    return parameters | contact_integers(scene)


def state_variables(scene: Scene) -> tuple[str, ...]:
    """Return the outputs that are the whole state of a structure: displacements, then velocities.

    Of a chain those of its masses, of a beam those of its modes. Empty for an oscillator, whose state is that
    of the observed point, and for a general scene.
    """
    body = scene.body_given
    if body is None or isinstance(body, OscillatorBody):
        return ()
    kind = "" if isinstance(body, ChainBody) else "modal_"
    numbers = range(1, body.size + 1)
    return tuple(f"{kind}{name}[{i}]" for name in ("displacement", "velocity") for i in numbers)


def _start_variables(scene: Scene) -> tuple[str, ...]:
    return tuple(name.replace("[", "_start[") for name in state_variables(scene))
