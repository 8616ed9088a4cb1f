"""The FMU around a user's contact law; pythonfmu runs it. Users write `contact_law.py`, not this file.

It must run wherever the FMU runs: it imports only the standard library and pythonfmu, nothing of vibroimpact.
"""

import ctypes
import importlib.util
import math
import traceback
from collections.abc import Callable
from pathlib import Path

# found in the FMU's resources, whether or not it is installed; its types are not published
from pythonfmu import (  # type: ignore[import-untyped, import-not-found, unused-ignore]  # has no types, and is not everywhere
    Fmi2Causality,
    Fmi2Slave,
    Real,
)
from pythonfmu.enums import (  # type: ignore[import-untyped, import-not-found, unused-ignore]  # has no types, and is not everywhere
    Fmi2Initial,
    Fmi2Variability,
)

LAW_FILE = "contact_law.py"
#: Speed of approach of the trial impact when the FMU is made or instantiated, m/s.
TRIAL_VELOCITY = 1.0

Law = Callable[[float, float], float]


class UserContactLaw(Fmi2Slave):  # type: ignore[misc, unused-ignore]  # has no types, and is not everywhere
    """Slave that answers the coefficient of restitution for the present inputs, as soon as they are set."""

    description = "A stop that answers a body's contact by a law written in Python"

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        self._law = load_law(Path(self.resources, LAW_FILE))
        self._inputs = {"displacement": 0.0, "velocity": 0.0}
        self._answer: float | None = None
        # functions set inputs and read outputs: outputs answer at once, without a step in between
        self._register_input("displacement", "Displacement of the body's contact point")
        self._register_input(
            "velocity", "Velocity of the body's contact point before the contact; its sign does not matter"
        )
        self._register_output(
            "applied_restitution", "The answer: coefficient of restitution for these inputs", self.restitution
        )
        self._register_output("applied_force", "Force on the body: 0, the law is impulsive", lambda: 0.0)
        # a mistake in the law shows when the FMU is made, not at the first impact
        answer(self._law, 0.0, TRIAL_VELOCITY)

    def restitution(self) -> float:
        """Return the law's answer, computed once each time the inputs are set, for any number of reads."""
        if self._answer is None:
            velocity = abs(self._inputs["velocity"])
            try:
                self._answer = answer(self._law, self._inputs["displacement"], velocity)
            except ValueError:
                self._survive_an_exception()
                raise
        return self._answer

    def _survive_an_exception(self) -> None:
        # pythonfmu 0.7 releases its references to these objects when it reports an exception, but uses the objects
        # again. One more reference to each keeps a later call, or the end of the instance, from crashing the process.
        for kept in (self, type(self), self.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Do nothing: a stop has no motion of its own."""
        return True

    def _register_input(self, name: str, description: str) -> None:
        def take(value: float) -> None:
            self._inputs[name] = value
            self._answer = None

        variable = Real(
            name,
            causality=Fmi2Causality.input,
            variability=Fmi2Variability.continuous,
            description=description,
            getter=lambda: self._inputs[name],
            setter=take,
        )
        self.register_variable(variable)

    def _register_output(self, name: str, description: str, getter: Callable[[], float]) -> None:
        variable = Real(
            name,
            causality=Fmi2Causality.output,
            variability=Fmi2Variability.continuous,
            initial=Fmi2Initial.calculated,
            description=description,
            getter=getter,
        )
        self.register_variable(variable)


def load_law(path: Path) -> Law:
    """Return the function `contact_law` of a file.

    Raises
    ------
    ValueError
        The file cannot be run, or has no such function.
    """
    # by path and without a module name: two such FMUs in one process must not get each other's law
    spec = importlib.util.spec_from_file_location("user_contact_law_file", path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path.name}: expected a Python file, got none.")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise _mistake(_place(error), error) from error
    law = getattr(module, "contact_law", None)
    if not callable(law):
        raise ValueError(f"{path.name}: expected a function contact_law(displacement, velocity), got none.")
    found: Law = law
    return found


def answer(law: Law, displacement: float, velocity: float) -> float:
    """Return the law's coefficient of restitution.

    Raises
    ------
    ValueError
        The law failed, or its answer is not a number from 0 to 1; the message names the inputs and the line.
    """
    call = f"contact_law({displacement:.6g}, {velocity:.6g})"
    try:
        restitution = law(displacement, velocity)
    except Exception as error:
        raise _mistake(f"{call}: {_place(error)}", error) from error
    try:
        value = float(restitution)
    except (TypeError, ValueError):
        value = math.nan
    if not 0.0 <= value <= 1.0:
        got = as_format(repr(restitution))
        raise ValueError(f"{call}: expected a coefficient of restitution, 0 <= r <= 1, got {got}.")
    return value


def as_format(text: str) -> str:
    """Return text for FMI's logger, to which pythonfmu hands the message of an exception as a format."""
    return text.replace("%", "%%")


def _mistake(where: str, error: Exception) -> ValueError:
    return ValueError(as_format(f"{where}: {type(error).__name__}: {error}"))


def _place(error: Exception) -> str:
    if isinstance(error, SyntaxError):
        return LAW_FILE
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).name == LAW_FILE]
    return f"{LAW_FILE}, line {lines[-1]}" if lines else LAW_FILE
