"""Every contact law in the table of the core: its energy, its force, its parameters; and unknown numbers."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from support.component_fmu import VERSIONS, ComponentFmu
from support.structure import Modes, Stop, Structure
from support.tolerance import ROUNDING

from vibroimpact.fmus.core import ContactLaw, contact_law, contact_laws, core_library, numbered_contact_law
from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.packaging.build import NATIVE
from vibroimpact.fmus.packaging.description.contact_laws import contact_laws as read_laws

OWN = [law for law in contact_laws().values() if law.stop != "none" and not law.external]
#: Part of a contact's time over which the work is integrated: a power law is not smooth at the end of contact.
MOST_OF_IT = 0.8
#: Relative tolerance for power laws: each segment of a contact is followed to 1e-10.
FOLLOWED = 1e-8
STIFFNESS, EXPONENT = 1e4, 2.3
CASES = [(0.3, 2.0, 0.4), (7.0, 0.05, 0.9)]
"""Mass, kg; speed at touch-down, m/s; damping of the stop times this speed, or over sqrt(stiffness mass)."""


class Law(ctypes.Structure):
    """`vi_contact_law`."""

    _fields_ = (
        ("law", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("restitution", "yield_velocity")),
        *((name, ctypes.c_double) for name in ("stiffness", "damping", "exponent")),
    )


class Force(ctypes.Structure):
    """`vi_contact_force`."""

    _fields_ = tuple((name, ctypes.c_double) for name in ("force", "stiffness", "damping"))


def force_of(law: Law, depth: float, rate: float) -> float:
    function = core_library().vi_contact_law_force
    function.restype = Force
    return float(function(ctypes.byref(law), ctypes.c_double(depth), ctypes.c_double(rate)).force)


def restitution_of(law: Law, speed: float) -> float:
    function = core_library().vi_contact_law_restitution
    function.restype = ctypes.c_double
    return float(function(ctypes.byref(law), ctypes.c_double(speed)))


@pytest.mark.parametrize(("mass", "speed", "loss"), CASES)
@pytest.mark.parametrize("law", [law for law in OWN if law.stop == "yielding"], ids=lambda law: law.name)
def test_the_energy_that_a_stop_takes_is_the_integral_of_its_force(
    law: ContactLaw, mass: float, speed: float, loss: float
) -> None:
    root = math.sqrt(mass)
    # the damping of a law that multiplies its force is per speed, else per rate of the stop
    numbers = {"stiffness": STIFFNESS, "damping": loss / speed, "exponent": EXPONENT}
    stop = Stop([1.0 / root], law=law.name, **numbers)
    own = Law(law.number, 1.0, 0.0, **numbers)
    with Structure(Modes([0.0]), [stop], [-0.1 * root], [speed * root]) as body:
        while not len(body.impacts):
            body.advance(0.1 / speed)
        began, duration = float(body.impacts[0][1]), float(body.impacts[0][7])
    nodes, weights = np.polynomial.legendre.leggauss(60)
    # time is the square of a parameter from touch-down, where a power law is not smooth either
    roots, end = 0.5 * (nodes + 1.0), MOST_OF_IT * duration
    times, steps = end * roots**2, 0.5 * weights * 2.0 * end * roots
    work = 0.0
    with Structure(Modes([0.0]), [stop], [-0.1 * root], [speed * root]) as body:
        for time, step in zip(times, steps, strict=True):
            body.advance(began + time - body.time)
            rate = body.velocity[0] / root
            force = force_of(own, body.displacement[0] / root, rate)
            assert body.forces[0] == pytest.approx(force, rel=1e-9)
            work += step * force * rate
        body.advance(began + end - body.time)
        lost = 0.5 * mass * speed**2 - 0.5 * float(body.velocity[0]) ** 2
    assert work > 0.0
    assert abs(work - lost) <= FOLLOWED * 0.5 * mass * speed**2


@pytest.mark.parametrize(("mass", "speed", "loss"), CASES)
@pytest.mark.parametrize("law", [law for law in OWN if law.stop == "rigid"], ids=lambda law: law.name)
def test_the_energy_that_a_rigid_stop_leaves_is_that_of_its_restitution(
    law: ContactLaw, mass: float, speed: float, loss: float
) -> None:
    root = math.sqrt(mass)
    stop = Stop([1.0 / root], law=law.name, restitution=loss, yield_velocity=0.3)
    own = Law(law.number, loss, 0.3, 0.0, 0.0, 1.5)
    with Structure(Modes([0.0]), [stop], [-0.1 * root], [speed * root]) as body:
        body.advance(0.2 / speed)
        left = 0.5 * float(body.velocity[0]) ** 2
        assert len(body.impacts) == 1
    assert left == pytest.approx(restitution_of(own, speed) ** 2 * 0.5 * mass * speed**2, rel=8 * ROUNDING)


def test_each_law_evaluates_itself_or_is_left_to_an_importer() -> None:
    others = [law.name for law in contact_laws().values() if law not in OWN]
    assert others == ["none", "external", "external_force", "pair"]
    assert all(law.external for law in contact_laws().values() if law not in OWN and law.name != "none")


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("name", "variable"), [("Oscillator", "contact[1].law"), ("ImpactStop", "law")])
@pytest.mark.parametrize("number", [-1, 31, 33, 2**31 - 1])
def test_a_number_that_is_no_laws_is_an_error_at_the_start(
    version: str, name: str, variable: str, number: int
) -> None:
    fmu = ComponentFmu(name, {variable: number}, version=version, initialize=False)
    with fmu, pytest.raises(FMICallException):
        fmu.initialize(0.0)
    (message,) = [message for message in fmu.messages if "expected" in message]
    assert f"{variable}: expected " in message
    assert all(f"{law.number} ({law.name})" in message for law in OWN)
    assert message.endswith(f", got {number}")


def test_a_name_or_number_that_the_core_has_no_law_of_is_an_error() -> None:
    with pytest.raises(ComponentError, match=r"expected one of 0 \(none\), .* got 31"):
        numbered_contact_law(31)
    with pytest.raises(ComponentError, match=r"expected one of none, restitution, .* got 'quartic'"):
        contact_law("quartic")


def test_a_row_of_the_table_in_another_form_is_an_error_of_the_build(tmp_path: Path) -> None:
    text = (NATIVE / "core" / "contact" / "contact_law.c").read_text(encoding="utf-8")
    assert [item.name for item in read_laws(NATIVE / "core" / "contact" / "contact_law.c")] == list(
        contact_laws()
    )
    table = tmp_path / "contact_law.c"
    for before, after, message in (
        (
            '{.name = "hertz",',
            '{.stop = VI_YIELDING_STOP, .name = "hertz",',
            f"got {len(contact_laws()) - 1} of that form",
        ),
        ('[3] = {.name = "hertz"', '[2] = {.name = "hertz"', r"each number of a law once, got \['2'\]"),
        ('.name = "hertz"', '.name = "pair"', r"each name of a law once, got \['pair'\]"),
        ("const vi_law vi_laws", "const vi_law vi_others", "a table vi_laws"),
    ):
        assert text.count(before) == 1
        table.write_text(text.replace(before, after), encoding="utf-8")
        with pytest.raises(ComponentFileError, match=message):
            read_laws(table)
