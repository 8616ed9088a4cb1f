"""The dataset schema: every name, dimension, type, unit and meaning that a vibroimpact file may hold.

This table, and that of sampled variables in `naming`, are the only places where these facts are written. `writing`
builds and writes datasets from it, `checking` checks them against it, `reading` opens them, and `docs/dataset.md`
explains it in words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum, IntFlag
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.safe_toml import parse_toml

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.analysis.dataset.assembling import Named

CONVENTIONS = "CF-1.11"
SCHEMA_VERSION = "1"

UnitSystem = Literal["SI", "nondimensional"]


class Outcome(IntEnum):
    """End of a run; `error`, `crash` and `timeout` are failures of the run, the others physics."""

    ok = 0
    stuck = 1
    impact_limit = 2
    error = 3
    crash = 4
    timeout = 5
    unbounded = 6


class Direction(IntEnum):
    """Start of a run: from the scene's own start state, or from its neighbour in a sweep."""

    independent = 0
    up = 1
    down = 2


class SpecialOrbit(IntEnum):
    """Special point of a branch of periodic orbits."""

    none = 0
    fold = 1
    period_doubling = 2
    torus = 3
    graze = 4
    graze_between_impacts = 5
    stability_change = 6
    branch_point = 7
    impact_at_the_yield_velocity = 8
    pitchfork = 9


class CurvePoint(IntEnum):
    """Point of a curve of bifurcations over two numbers: the bifurcation that it meets, or an extremum of folds."""

    fold = 1
    period_doubling = 2
    torus = 3
    graze = 4
    graze_between_impacts = 5
    another_graze_between_impacts = 6
    isola_centre = 7
    crossing_of_branches = 8
    cusp = 9
    pitchfork = 10
    degenerate_pitchfork = 11


class OrbitClass(IntEnum):
    """Class of the motion of a run, judged by its recorded periods."""

    unknown = 0
    no_impacts = 1
    periodic = 2
    sticking = 3
    chaos = 4
    rest = 5
    quasi_periodic = 6

    @property
    def words(self) -> str:
        """The class as text, such as `no impacts` and `quasi-periodic`."""
        return "quasi-periodic" if self is OrbitClass.quasi_periodic else str(self.name).replace("_", " ")


class MeasurementFlag(IntFlag):
    """Faults of a measured run; several may apply."""

    clipped = 1
    gap = 2
    drift = 4
    starved = 8


@dataclass(slots=True)
class RunRecord:
    """Records of one run of a scene; a group that the scene does not record is None.

    Attributes
    ----------
    outcome : Outcome
        How the run ended.
    message : str
        The reason, in words; empty for `Outcome.ok`.
    periods : ndarray of float, shape (period, 5), or None
        Columns `PERIOD_COLUMNS`: displacement_max, displacement_min, strobe_displacement (m),
        strobe_velocity (m/s), impacts_per_period; then the first four of each further observed point.
    impacts : ndarray of float, shape (impact, 8), or None
        Columns `IMPACT_COLUMNS`: impact_time (s), impact_phase (rad), impact_velocity (m/s),
        impact_impulse (N s), impact_contact (1-based), impact_restitution, impact_duration (s),
        impact_peak_force (N; NaN on a rigid stop). The last three may be left out, and are NaN then. They and the
        impulse are NaN for a contact that is still open at the end.
    sticks : ndarray of float, shape (stick, 3), or None
        Columns `STICK_COLUMNS`: stick_start, stick_end (s; NaN: still stuck at the end), stick_contact.
    samples : ndarray of float, shape (sample, 1 + variables), or None
        Time (s), then the sampled variables without a form of their own.
    final_displacement, final_velocity, final_phase : float
        State (m, m/s) and forcing phase (rad) at the end, from which a sweep continues.
    seconds : float
        Wall time of this run, s.
    events : ndarray of float, shape (event, 3), or None
        Columns `EVENT_COLUMNS`: event_time (s), event_index (superdense: which of the events at the same
        time, from 0), event_component (1-based, into the components of the scene).
    energy_residual : ndarray of float, shape (connection,), or None
        Interface energy residual of each force-displacement connection, J.
    loop_residual : float or None
        Largest relative residual of the algebraic loops.
    chosen_steps : ndarray of float, shape (5,), or None
        Columns `STEP_COLUMNS`: communication steps that an error estimate has chosen.
    step_trace : ndarray of float, shape (step, 3), or None
        Columns `TRACE_COLUMNS`: end (s), size (s) and estimated error over the tolerance of chosen communication steps.
    final_state : ndarray of float, shape (2 N,), or None
        Whole state of a chain or beam at the end: N displacements (m), then N velocities (m/s), of its masses
        or modes.
    scores : ndarray of float, shape (comparison, 6), or None
        Columns `SCORE_COLUMNS`, for each compared pair of a replay.
    formed_samples : tuple of ndarray, each of shape (sample, ...), or None
        The sampled variables with a form (`sample_forms`): arrays, texts, enumerations, integers of 64 bits.
    """

    outcome: Outcome
    message: str
    periods: NDArray[np.float64] | None = None
    impacts: NDArray[np.float64] | None = None
    sticks: NDArray[np.float64] | None = None
    samples: NDArray[np.float64] | None = None
    final_displacement: float = np.nan
    final_velocity: float = np.nan
    final_phase: float = np.nan
    seconds: float = 0.0
    events: NDArray[np.float64] | None = None
    energy_residual: NDArray[np.float64] | None = None
    loop_residual: float | None = None
    chosen_steps: NDArray[np.float64] | None = None
    step_trace: NDArray[np.float64] | None = None
    final_state: NDArray[np.float64] | None = None
    scores: NDArray[np.float64] | None = None
    formed_samples: tuple[NDArray[Any], ...] | None = None


@dataclass(frozen=True, slots=True)
class VariableRule:
    """The schema's entry for one variable; `unit` is its SI unit."""

    name: str
    dims: tuple[str, ...]
    unit: str
    long_name: str
    dtype: Any = np.float64
    extra: Mapping[str, Any] = field(default_factory=dict)


def _flags(kind: type[IntEnum]) -> dict[str, Any]:
    """Return the CF attributes that name the values of an enumeration."""
    return {
        "flag_values": np.array([int(member) for member in kind], dtype=np.int8),
        "flag_meanings": " ".join(member.name for member in kind),
    }


def _masks(kind: type[IntFlag]) -> dict[str, Any]:
    """Return the CF attributes that name the bits of an enumeration."""
    return {
        "flag_masks": np.array([int(member) for member in kind], dtype=np.int8),
        "flag_meanings": " ".join(str(member.name) for member in kind),
    }


def _count(dimension: str, words: str) -> VariableRule:
    """Return the rule of the variable that counts the rows of a run in a ragged dimension."""
    extra = {"sample_dimension": dimension}
    return VariableRule(f"{dimension}_count", ("run",), "1", f"number of {words} of the run", np.int32, extra)


_RULES = (
    VariableRule("run_index", ("run",), "1", "index of the run in its campaign", np.int32),
    VariableRule("direction", ("run",), "1", "direction of the sweep", np.int8, _flags(Direction)),
    VariableRule("outcome", ("run",), "1", "outcome of the run", np.int8, _flags(Outcome)),
    VariableRule("message", ("run",), "1", "why the run ended as it did, or what its body warned of", object),
    VariableRule("point_seconds", ("run",), "s", "wall time of the run"),
    VariableRule("final_displacement", ("run",), "m", "displacement at the end of the run"),
    VariableRule("final_velocity", ("run",), "m s-1", "velocity at the end of the run"),
    VariableRule("final_phase", ("run",), "rad", "forcing phase at the end of the run"),
    VariableRule(
        "final_state",
        ("run", "state"),
        "1",
        "displacements (m), then velocities (m s-1), of all masses or modes at the end of the run",
    ),
    VariableRule("displacement_max", ("run", "period"), "m", "largest displacement in a period"),
    VariableRule("displacement_min", ("run", "period"), "m", "smallest displacement in a period"),
    VariableRule("strobe_displacement", ("run", "period"), "m", "displacement at forcing phase zero"),
    VariableRule("strobe_velocity", ("run", "period"), "m s-1", "velocity at forcing phase zero"),
    VariableRule("impacts_per_period", ("run", "period"), "1", "number of impacts in a period"),
    _count("impact", "impacts"),
    VariableRule("impact_time", ("impact",), "s", "time of impact from the start of the scene"),
    VariableRule("impact_phase", ("impact",), "rad", "forcing phase at impact"),
    VariableRule("impact_velocity", ("impact",), "m s-1", "velocity of approach just before impact"),
    VariableRule("impact_impulse", ("impact",), "N s", "impulse of the stop on the body"),
    VariableRule("impact_contact", ("impact",), "1", "number of the stop that was hit, from 1", np.int8),
    VariableRule("impact_restitution", ("impact",), "1", "speed of separation over speed of approach"),
    VariableRule("impact_duration", ("impact",), "s", "duration of the contact, 0 for a rigid stop"),
    VariableRule("impact_peak_force", ("impact",), "N", "largest force of a stop that yields"),
    _count("stick", "sticking phases"),
    VariableRule("stick_start", ("stick",), "s", "time at which sticking starts"),
    VariableRule("stick_end", ("stick",), "s", "time at which sticking ends, missing if it does not"),
    VariableRule("stick_contact", ("stick",), "1", "number of the stop the body sticks to, from 1", np.int8),
    _count("sample", "samples"),
    VariableRule("time", ("sample",), "s", "time of the sample from the start of the scene"),
    _count("event", "events"),
    VariableRule("event_time", ("event",), "s", "time of the event from the start of the scene"),
    VariableRule("event_index", ("event",), "1", "index of the event among those at the same time", np.int32),
    VariableRule("event_component", ("event",), "1", "component that had the event", np.int16),
    VariableRule(
        "connection", ("interface",), "1", "force-displacement connection between components", object
    ),
    VariableRule("energy_residual", ("run", "interface"), "J", "energy that a connection made or lost"),
    VariableRule(
        "compared", ("comparison",), "1", "simulated variable and the channel it is compared with", object
    ),
    VariableRule(
        "variance_accounted_for",
        ("run", "comparison"),
        "%",
        "share of the measured variance that the simulation accounts for",
    ),
    VariableRule("best_gain", ("run", "comparison"), "1", "factor that would bring the simulation nearest"),
    VariableRule("lag", ("run", "comparison"), "s", "measured clock less simulated clock"),
    VariableRule("lag_error", ("run", "comparison"), "s", "standard error of the lag"),
    VariableRule("polarity", ("run", "comparison"), "1", "-1 where the channel is inverted"),
    VariableRule(
        "frequency_difference",
        ("run", "comparison"),
        "Hz",
        "dominant frequency of the simulation less that of the measurement",
    ),
    VariableRule("loop_residual", ("run",), "1", "largest relative residual of algebraic loops"),
    VariableRule("coupling_steps", ("run",), "1", "communication steps of chosen sizes"),
    VariableRule("coupling_rejected", ("run",), "1", "steps taken back for their errors"),
    VariableRule("coupling_step_min", ("run",), "s", "smallest chosen communication step"),
    VariableRule("coupling_step_max", ("run",), "s", "largest chosen communication step"),
    VariableRule("coupling_error", ("run",), "1", "sum of the estimated relative errors of all steps"),
    _count("chosen_step", "communication steps of chosen sizes that are listed"),
    VariableRule("chosen_step_end", ("chosen_step",), "s", "end of the communication step"),
    VariableRule("chosen_step_size", ("chosen_step",), "s", "size of the communication step"),
    VariableRule(
        "chosen_step_error", ("chosen_step",), "1", "estimated error of the step over coupling_tolerance"
    ),
    VariableRule(
        "measurement_flags",
        ("run",),
        "1",
        "what is wrong with the measured run",
        np.int8,
        _masks(MeasurementFlag),
    ),
    VariableRule("drive_amplitude", ("run",), "V", "amplitude of the drive as an input saw it"),
    VariableRule("drive_lag", ("run",), "s", "drive as an input saw it, less the planned one"),
    VariableRule("drive_clock_error", ("run",), "1e-6", "relative error of the clock of the inputs"),
    VariableRule("orbit_branch", ("run",), "1", "branch that the periodic orbit is on", np.int32),
    VariableRule("orbit_periods", ("run",), "1", "forcing periods after which it repeats itself", np.int32),
    VariableRule("orbit_period", ("run",), "s", "time after which it repeats itself"),
    VariableRule(
        "orbit_stable", ("run",), "1", "whether all its multipliers are within the unit circle", np.int8
    ),
    VariableRule("orbit_symmetric", ("run",), "1", "whether it is its own mirror image", np.int8),
    VariableRule("orbit_special", ("run",), "1", "what happens to it here", np.int8, _flags(SpecialOrbit)),
    VariableRule("orbit_multiplier_real", ("run",), "1", "real part of its largest Floquet multiplier"),
    VariableRule(
        "orbit_multiplier_imaginary", ("run",), "1", "imaginary part of its largest Floquet multiplier"
    ),
    VariableRule(
        "orbit_index",
        ("run",),
        "1",
        "sign of det(I - M) over its own periods; 0 where it is not defined",
        np.int8,
    ),
    VariableRule(
        "curve_point_curve", ("curve_point",), "1", "curve (orbit_branch) that the point is on", np.int32
    ),
    VariableRule(
        "curve_point_kind", ("curve_point",), "1", "what happens there", np.int8, _flags(CurvePoint)
    ),
    VariableRule("curve_point_first", ("curve_point",), "1", "value of the first number there"),
    VariableRule("curve_point_second", ("curve_point",), "1", "value of the second number there"),
    VariableRule("class_kind", ("run",), "1", "class of the motion", np.int8, _flags(OrbitClass)),
    VariableRule("class_impacts", ("run",), "1", "impacts of what repeats; -1: without number", np.int32),
    VariableRule(
        "class_periods",
        ("run",),
        "1",
        "forcing periods after which the motion repeats; number of curves of a quasi-periodic motion",
        np.int32,
    ),
    VariableRule("class_rotation_number", ("run",), "1", "rotation number of a quasi-periodic motion"),
    VariableRule("class_rotation_error", ("run",), "1", "error of the rotation number"),
    VariableRule("class_reason", ("run",), "1", "why the class is unknown", object),
)
RULES: Mapping[str, VariableRule] = {rule.name: rule for rule in _RULES}


def _columns(dims: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the variables with these dimensions, in order."""
    return tuple(rule.name for rule in _RULES if rule.dims == dims)


PERIOD_COLUMNS = _columns(("run", "period"))
POINT_COLUMNS = PERIOD_COLUMNS[:4]
"""Variables of each period that an observed point has."""
IMPACT_COLUMNS = _columns(("impact",))
NEEDED_IMPACT_COLUMNS = IMPACT_COLUMNS[:5]
"""Columns of impacts that every file has; the other columns came later."""
STICK_COLUMNS = _columns(("stick",))
EVENT_COLUMNS = _columns(("event",))
TRACE_COLUMNS = _columns(("chosen_step",))
SCORE_COLUMNS = _columns(("run", "comparison"))
MEASURED_COLUMNS = ("measurement_flags", "drive_amplitude", "drive_lag", "drive_clock_error")
"""Columns of runs that a rig has measured; the last three where an input was wired to the drive."""
ORBIT_COLUMNS = tuple(rule.name for rule in _RULES if rule.name.startswith("orbit_"))
"""Columns of runs that are periodic orbits, followed over a parameter."""
CLASS_COLUMNS = tuple(rule.name for rule in _RULES if rule.name.startswith("class_"))
"""Columns of runs that have been classified."""
STEP_COLUMNS = tuple(rule.name for rule in _RULES if rule.name.startswith("coupling_"))
"""Columns of runs whose communication steps an error estimate has chosen."""
COUPLED_COLUMNS = ("loop_residual", *STEP_COLUMNS)
"""Columns of coupled runs that not all have: with algebraic loops, with chosen steps."""
RAGGED = {rule.extra["sample_dimension"]: rule.name for rule in _RULES if "sample_dimension" in rule.extra}
# Not in every file: these per-run variables are there only where they were recorded.
_NOT_IN_ALL = (*RAGGED.values(), *COUPLED_COLUMNS, *MEASURED_COLUMNS, *ORBIT_COLUMNS, *CLASS_COLUMNS)
RUN_COLUMNS = tuple(name for name in _columns(("run",)) if name not in _NOT_IN_ALL)
RESERVED_NAMES = frozenset(
    {*RULES, *(dim for rule in _RULES for dim in rule.dims), *(f"{dim}_run" for dim in RAGGED)}
    | {"run_id", "displacement_range"}
)
"""Names that mean something in a stored or opened dataset; nothing else may take them."""
SAMPLE_TYPES = (np.float64, np.int64, np.uint64)
"""Types of the numbers of sampled variables; these may be texts, too."""
SWEPT_ALONG = "swept_along"
"""Attribute of a swept parameter: the dimension it shares with the parameters that move with it."""
DRAW = "draw"
"""Dimension of drawn points; `sample` is the dimension of time series."""
SCATTERED = "point"
"""Dimension of the points of two adaptive axes, which are no grid."""
NOT_SWEPT = {"swept": "no"}
"""Attribute of the numbers of a scene that are the same for all of its runs; these are scalar coordinates."""


def unit_in(system: UnitSystem, unit: str) -> str:
    """Return the unit that replaces an SI unit in a system of units; angles stay radians, shares percent.

    >>> unit_in("nondimensional", "m s-1"), unit_in("nondimensional", "rad"), unit_in("SI", "m s-1")
    ('1', 'rad', 'm s-1')
    """
    return unit if system == "SI" or unit in ("rad", "%", "1e-6") else "1"


def variable_rule(name: str) -> VariableRule | None:
    """Return the rule of a variable; a further observed point has the rule of the observed one, with its own name.

    >>> variable_rule("displacement_max_ball").long_name, variable_rule("ball")
    ('largest displacement in a period', None)
    """
    if name in RULES:
        return RULES[name]
    own = next((each for each in POINT_COLUMNS if name.startswith(f"{each}_")), None)
    return None if own is None else replace(RULES[own], name=name)


def is_of_samples(dims: tuple[Any, ...], dtype: np.dtype[Any]) -> bool:
    """Return whether dimensions and type are those of a sampled variable: one value or an array for each sample."""
    return dims[:1] == ("sample",) and (dtype in SAMPLE_TYPES or dtype.kind in "OUT")


def known_rule(name: str) -> VariableRule:
    """Return the rule of a variable of the schema."""
    rule = variable_rule(name)
    assert rule is not None, "a variable of the schema"
    return rule


def period_columns(further: Sequence[str]) -> tuple[str, ...]:
    """Return the variables of each period: of the observed point, then of each further one by its name in files.

    >>> period_columns(["ball"])[4:7]
    ('impacts_per_period', 'displacement_max_ball', 'displacement_min_ball')
    """
    return (*PERIOD_COLUMNS, *(f"{name}_{point}" for point in further for name in POINT_COLUMNS))


def attributes_of(name: str, system: UnitSystem) -> dict[str, Any]:
    """Return the attributes of a schema variable in a system of units."""
    rule = known_rule(name)
    # Wall time is measured in seconds in every system of units.
    unit = rule.unit if name == "point_seconds" else unit_in(system, rule.unit)
    return {"long_name": rule.long_name, "units": unit, **rule.extra}


def scene_of(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the tables of the scene in the attributes of a dataset; empty where no scene can be read."""
    try:
        return parse_toml(str(attrs.get("scene", "")))
    except ValueError:
        return {}


def swept_names(dataset: Named) -> tuple[str, ...]:
    """Return the names of the swept parameters, also of parameters that a selection has made scalar."""
    # names and variables: creating an array of xarray for each coordinate would cost ten times as much
    coordinates = {str(name): dataset.variables[name] for name in dataset.coords}
    # the axis of parameters that move together has the values of one of them
    shared = {coordinate.attrs.get(SWEPT_ALONG) for coordinate in coordinates.values()}
    return tuple(
        name
        for name, coordinate in coordinates.items()
        if name not in RESERVED_NAMES | shared
        and coordinate.dtype.kind == "f"
        and not _is_constant(coordinate)
    )


def standing_for(dimension: str, columns: Mapping[str, NDArray[np.float64]]) -> str | None:
    """Return the parameter whose values become the axis of a dimension that several parameters share.

    It is the first whose values all differ.

    Parameters
    ----------
    dimension : str
    columns : mapping of str to ndarray of float, shape (point,)
        The values of each parameter along it, in the order of the scene.

    Returns
    -------
    str or None
        None where the points are numbered: no single one of several drawn or adaptive parameters stands for all.

    Examples
    --------
    >>> standing_for("size", {"mass": np.array([1.0, 1.0]), "stiffness": np.array([4.0, 5.0])})
    'stiffness'
    """
    if len(columns) > 1 and dimension in (DRAW, SCATTERED):
        return None
    return next((name for name, values in columns.items() if np.unique(values).size == values.size), None)


def constant_names(dataset: Named) -> tuple[str, ...]:
    """Return the names of the numbers of the scene that are the same for all runs."""
    return tuple(str(name) for name in dataset.coords if _is_constant(dataset.variables[name]))


def _is_constant(coordinate: xr.Variable) -> bool:
    # joining the datasets of two scenes makes a dimension of such a number
    return not coordinate.dims and coordinate.attrs.items() >= NOT_SWEPT.items()


def flat_order(first_rows: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the row numbers, shape (sum of counts,), of ragged blocks in the given order."""
    ends = np.cumsum(counts)
    return np.repeat(first_rows - (ends - counts), counts) + np.arange(ends[-1] if ends.size else 0)


def names_list(names: Sequence[str]) -> str:
    """Return names for a message, or the word none."""
    return ", ".join(names) if names else "none"
