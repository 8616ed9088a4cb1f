"""The ways in which a scene can be simulated, and of each way the settings that trade accuracy for time."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from scipy.optimize import brentq

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, OscillatorBody
from vibroimpact.orchestrator.scene.models import (
    HertzStop,
    HuntCrossleyStop,
    KelvinVoigtStop,
    RestitutionStop,
)
from vibroimpact.orchestrator.study.observation import Observation, observation_of
from vibroimpact.orchestrator.study.replays import ReplayTrial, rates_of
from vibroimpact.orchestrator.study.trials import (
    CoupledTrial,
    ModelExchangeTrial,
    PlainForcesTrial,
    PlainStepsTrial,
)

CONTACT_TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
INTEGRATOR_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
STEPS_A_PERIOD = (23, 61, 211, 1009, 5003)
"""Of plain steps of equal size: how many in a period, or in the time scale of an unforced scene; primes, lest steps
fall on the same phases in each period."""
GENERAL_REFINEMENTS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
"""Macro steps of a general scene, over its own."""
COUPLED_REFINEMENTS = (math.nan, 1e-2, 1e-3)
"""Macro steps of coupled contacts that yield, over the period; NaN: none but those of the contact."""
CONTACT_TIMES = (1e-1, 1e-2, 1e-3)
"""Of yielding stops that stand for a rigid one, over the period."""
EXCHANGES = ("jacobi", "gauss_seidel", "iterated")
MOST_MODES = 64
LEAST_TRIED_MODES = 8
"""Modes of a beam up to which, at least, others than its own are tried."""


class Trial(Protocol):
    """A way of simulating a scene, opened: it can be run again and again."""

    def run(self) -> Observation:
        """Simulate the scene once."""

    def close(self) -> None:
        """Free what was opened."""


Opener = Callable[[Wrapper | None], Trial]


@dataclass(frozen=True, slots=True)
class Way:
    """A way of simulating a scene at one setting.

    Attributes
    ----------
    name : str
        What differs in kind: `fused`, `coupled, FMI 2.0`, `model exchange, CVode`, ...
    knob : str
        The key, or the number, that is set; empty where there is nothing to set.
    setting : float
        Its value; NaN without a knob.
    changes : mapping of str to Any
        Keys of the scene, with the values that make it run this way; empty where no scene says it.
    open : callable
        Opens the way; given a wrapper of the functions of all FMUs, or None.
    model : bool
        Whether another model is simulated (another contact law, fewer modes), and not the same one otherwise.
    against : Scene or None
        The finest model of its kind, where its errors are told by that one and not by the study's reference.
    """

    name: str
    knob: str
    setting: float
    changes: Mapping[str, Any]
    open: Opener
    model: bool = False
    against: Scene | None = None

    @property
    def label(self) -> str:
        """The way with its setting, in words."""
        return f"{self.name}, {self.knob} {self.setting:.3g}" if self.knob else self.name


class SceneTrial:
    """A scene that its own runner runs."""

    def __init__(self, scene: Scene, wrap: Wrapper | None = None) -> None:
        of = None if wrap is None else (lambda name: wrap)
        self.is_guarded = scene.general.guard if scene.general is not None else scene.execution.guard
        self._runner = open_runner(scene, scene.execution.how, wrap=of)

    def run(self) -> Observation:
        """Simulate the scene once."""
        return observation_of(self._runner.run({}))

    def close(self) -> None:
        """Free the components."""
        self._runner.close()


class CallCounter:
    """Counts calls of FMUs by function."""

    def __init__(self) -> None:
        self.calls: Counter[str] = Counter()

    def wrap(self, name: str, function: Function) -> Function:
        """Return a function that is counted."""

        def counted(*arguments: Any) -> Any:
            self.calls[name] += 1
            return function(*arguments)

        return counted


def ways_of(scene: Scene) -> list[Way]:
    """Return the ways in which a scene can be simulated, and their settings.

    Parameters
    ----------
    scene : Scene
        Without a sweep.
    """
    if scene.general is not None:
        return _general_ways(scene)
    if scene.replay is not None:
        return [*_fused(scene), *_coupled_replay(scene), *_fewer_samples(scene), *_other_modes(scene)]
    return [*_fused(scene), *_coupled(scene), *_plain_steps(scene), *_integrated(scene), *_models(scene)]


def opened_trial(scene: Scene, wrap: Wrapper | None = None) -> SceneTrial | ReplayTrial:
    """Open a scene as it says itself; of a replay nobody wraps the functions."""
    return SceneTrial(scene, wrap) if scene.replay is None else ReplayTrial(scene)


def remarks_on(scene: Scene) -> list[str]:
    """Return what the study of a scene leaves out, and why."""
    remarks = []
    plain = scene.general is None and scene.replay is None and scene.stops
    if plain and not isinstance(scene.body, OscillatorBody):
        remarks.append(
            "plain steps of equal size: for an oscillator only, whose state a step can be begun from"
        )
    rigid = any(isinstance(stop, RestitutionStop) for stop in scene.stops)
    if scene.general is None and isinstance(scene.body, BeamBody) and rigid:
        remarks.append(
            "number of modes: nothing converges, since the contact mass of a rigid stop on a beam falls with the "
            "number of modes and its restitution has no meaning without it (docs/contact_laws.md); compliant stops do"
        )
    return remarks


def _by_scene(
    name: str, knob: str, setting: float, scene: Scene, changes: Mapping[str, Any], *, model: bool = False
) -> Way:
    changed = scene.with_values(changes) if changes else scene
    return Way(name, knob, setting, changes, lambda wrap: opened_trial(changed, wrap), model)


def _opens(kind: Callable[..., Trial], *arguments: Any) -> Opener:
    """Return what opens a kind of trial with these arguments, given a wrapper of the functions of FMUs."""
    return lambda wrap: kind(*arguments, wrap)


def _fused(scene: Scene) -> list[Way]:
    how = {"execution.how": "fused"}
    if not _integrates_contacts(scene):
        return [_by_scene("fused", "", math.nan, scene, how)]
    return [
        _by_scene("fused", "contact_tolerance", value, scene, {**how, "execution.contact_tolerance": value})
        for value in CONTACT_TOLERANCES
    ]


def _coupled(scene: Scene) -> list[Way]:
    if not scene.stops or any(getattr(stop, "relaxation_time", 0.0) > 0.0 for stop in scene.stops):
        return []
    yields = any(not isinstance(stop, RestitutionStop) for stop in scene.stops)
    ways = []
    for version in ("3.0", "2.0"):
        name = f"coupled, FMI {version}"
        for part in COUPLED_REFINEMENTS if yields else (math.nan,):
            step = math.nan if math.isnan(part) else part * _time_scale(scene)
            changes: dict[str, Any] = {"execution.how": "coupled"}
            if not math.isnan(step):
                changes["execution.macro_step"] = step
            made = scene.with_values(changes)
            own = changes if version == "3.0" else {}
            ways.append(
                Way(
                    name,
                    "" if math.isnan(step) else "macro_step",
                    step,
                    own,
                    _opens(CoupledTrial, made, version),
                )
            )
    return ways


def _coupled_replay(scene: Scene) -> list[Way]:
    """The body, its stops and the recording, each an FMU of its own."""
    if any(getattr(stop, "relaxation_time", 0.0) > 0.0 for stop in scene.stops):
        return []
    return [_by_scene("coupled, FMI 3.0", "", math.nan, scene, {"execution.how": "coupled"})]


def _fewer_samples(scene: Scene) -> list[Way]:
    return [
        Way("fewer samples", "samples per s", rate, {}, _opens_replay(scene, every))
        for every, rate in rates_of(scene).items()
    ]


def _opens_replay(scene: Scene, every: int) -> Opener:
    return lambda wrap: ReplayTrial(scene, every)


def _plain_steps(scene: Scene) -> list[Way]:
    """Steps of equal size, as an importer makes them that knows no events."""
    if not isinstance(scene.body, OscillatorBody) or not scene.stops:
        return []
    scale = _time_scale(scene)
    ways = []
    rigid = [isinstance(stop, RestitutionStop) for stop in scene.stops]
    for count in STEPS_A_PERIOD:
        step = scale / count
        if all(rigid):
            ways.append(
                Way(
                    "plain steps",
                    "step",
                    step,
                    {},
                    _opens(PlainStepsTrial, scene, step),
                )
            )
        elif not any(rigid):
            ways += [
                Way(
                    f"plain steps, {exchange}",
                    "step",
                    step,
                    {},
                    _opens(PlainForcesTrial, scene, exchange, step),
                )
                for exchange in ("jacobi", "gauss_seidel")
            ]
    return ways


def _integrated(scene: Scene) -> list[Way]:
    if any(getattr(stop, "relaxation_time", 0.0) > 0.0 for stop in scene.stops):
        return []
    return [
        Way(
            "model exchange, CVode",
            "tolerance",
            value,
            {},
            _opens(ModelExchangeTrial, scene, value),
        )
        for value in INTEGRATOR_TOLERANCES
    ]


def _models(scene: Scene) -> list[Way]:
    """Other models of the same thing: what they change is no error of a solver."""
    body, ways = scene.body, []
    if isinstance(body, BeamBody):
        ways += _other_modes(scene) if scene.stops else []
        if any(isinstance(stop, RestitutionStop) for stop in scene.stops):
            other = "collocation" if body.impact_projection == "variational" else "variational"
            ways.append(
                _by_scene(
                    f"{other} projection", "", math.nan, scene, {"body.impact_projection": other}, model=True
                )
            )
    if isinstance(body, OscillatorBody) and len(scene.stops) == 1:
        ways += _equal_restitution(scene, body)
    return ways


def _other_modes(scene: Scene) -> list[Way]:
    """Fewer and more modes of a beam, natural ones alone and with residual vectors, told by the most of those.

    With rigid stops nothing converges, and none is shown.
    """
    body = scene.body
    if not isinstance(body, BeamBody) or any(isinstance(stop, RestitutionStop) for stop in scene.stops):
        return []
    most = max(LEAST_TRIED_MODES, 4 * body.size)
    counts = sorted({n for n in (1, 2, 4, 8, 16, 32, MOST_MODES) if n <= most} | {body.size})
    changes = [{"body.modes": n, "body.residual": residual} for residual in (False, True) for n in counts]
    able = [change for change in changes if _can_have(scene, change)]
    if not able:
        return []
    finest = scene.with_values(able[-1])
    return [
        replace(
            _by_scene(
                "residual vectors" if change["body.residual"] else "modes",
                *("modes", change["body.modes"]),
                scene,
                change,
                model=True,
            ),
            against=finest,
        )
        for change in able[:-1]
    ]


def told_by(ways: Sequence[Way]) -> str:
    """Return in words what other numbers of modes are compared with; empty where there are none.

    Parameters
    ----------
    ways : sequence of Way
    """
    finest = next((way.against.body for way in ways if way.against is not None), None)
    if not isinstance(finest, BeamBody):
        return ""
    what = ", residual vectors among them" if finest.residual else ""
    return f"{finest.size} modes{what}"


def _equal_restitution(scene: Scene, body: OscillatorBody) -> list[Way]:
    """Stops of another law that give a rigid mass the same coefficient of restitution (equations.md 6.9)."""
    (stop,) = scene.stops
    if isinstance(stop, KelvinVoigtStop):
        ratio = stop.damping / (2.0 * math.sqrt(stop.stiffness * body.mass))
        changes = {"stop": [_table(stop, law="restitution", restitution=restitution_of(ratio))]}
        return [_by_scene("a rigid stop of equal restitution", "", math.nan, scene, changes, model=True)]
    if (
        not isinstance(stop, RestitutionStop)
        or stop.yield_velocity > 0.0
        or not 0.05 < stop.restitution < 1.0
    ):
        return []
    ratio, ways = damping_ratio_of(stop.restitution), []
    for part in CONTACT_TIMES:
        duration = part * _time_scale(scene)
        rate = 2.0 * math.acos(ratio) / (duration * math.sqrt(1.0 - ratio**2))
        law = {
            "law": "kelvin_voigt",
            "stiffness": body.mass * rate**2,
            "damping": 2.0 * ratio * rate * body.mass,
        }
        ways.append(
            _by_scene(
                "a Kelvin-Voigt stop of equal restitution",
                "contact time",
                duration,
                scene,
                {"stop": [_table(stop, **law)]},
                model=True,
            )
        )
    return ways


def restitution_of(ratio: float) -> float:
    """Return the coefficient of restitution of a rigid mass on a Kelvin-Voigt stop that never pulls.

    Parameters
    ----------
    ratio : float
        Damping ratio of the mass on the stop, >= 0 (equations.md 6.9).

    Examples
    --------
    >>> [round(restitution_of(ratio), 8) for ratio in (0.1, 0.5, 1.0, 2.0)]
    [0.7440794, 0.29843606, 0.13533528, 0.04776873]
    """
    if ratio < 1.0:
        return math.exp(-2.0 * ratio * math.acos(ratio) / math.sqrt(1.0 - ratio**2))
    if ratio == 1.0:
        return math.exp(-2.0)
    return math.exp(-2.0 * ratio * math.acosh(ratio) / math.sqrt(ratio**2 - 1.0))


def damping_ratio_of(restitution: float) -> float:
    """Return the damping ratio, below 1, at which a Kelvin-Voigt stop has a coefficient of restitution above e^-2.

    >>> round(damping_ratio_of(0.7440794), 6)
    0.1
    """
    found: float = brentq(lambda ratio: restitution_of(ratio) - restitution, 0.0, 1.0 - 1e-9)
    return found


def _table(stop: RestitutionStop | KelvinVoigtStop, **law: Any) -> dict[str, Any]:
    return {"position": stop.position, "side": stop.side, **law}


def _can_have(scene: Scene, changes: Mapping[str, Any]) -> bool:
    try:
        scene.with_values(changes)
    except SceneError:
        return False
    return True


def _general_ways(scene: Scene) -> list[Way]:
    assert scene.general is not None
    own = scene.general.macro_step
    return [
        _by_scene(
            f"coupled, {exchange}",
            "macro_step",
            own * part,
            scene,
            {"execution.exchange": exchange, "execution.macro_step": own * part},
        )
        for exchange in EXCHANGES
        for part in GENERAL_REFINEMENTS
    ]


def _integrates_contacts(scene: Scene) -> bool:
    return any(isinstance(stop, HertzStop | HuntCrossleyStop) for stop in scene.stops)


def _time_scale(scene: Scene) -> float:
    """Return the forcing period, or that of the slowest motion of an unforced oscillator, or a hundredth, s."""
    if scene.period is not None:
        return scene.period
    body = scene.body
    if isinstance(body, OscillatorBody) and body.stiffness > 0.0:
        return 2.0 * math.pi * math.sqrt(body.mass / body.stiffness)
    return (scene.record.transient_time + scene.record.recorded_time) / 100.0
