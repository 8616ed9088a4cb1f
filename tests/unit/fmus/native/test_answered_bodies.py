"""Impacts of bodies that are answered from outside, and saved states: the same for every body's FMU."""

import math

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from support.body_scenes import BEAM, BODIES, CHAIN, OSCILLATOR, BodyScene
from support.component_fmu import RESTITUTION, VERSIONS, simulate
from support.tolerance import PARTITION

each_body = pytest.mark.parametrize("body", BODIES, ids=str)
each_version = pytest.mark.parametrize("version", VERSIONS)


# ---- an importer that answers the impacts ----


@each_body
@pytest.mark.parametrize("early_return", [False, True])
def test_an_external_law_without_event_mode_is_refused_with_what_to_do(
    body: BodyScene, early_return: bool
) -> None:
    with body.fmu(body.coupled, early_return=early_return, initialize=False) as b:
        with pytest.raises(FMICallException):
            b.initialize()
        assert len(b.messages) == 1
        assert "contact law external" in b.messages[0]
        assert "event mode" in b.messages[0]
        assert "restitution (1)" in b.messages[0]


@each_body
def test_an_answered_external_law_is_the_restitution_law(body: BodyScene) -> None:
    with body.fmu(body.coupled, event_mode=True) as b, body.fmu() as fused:
        # later a beam chatters, and the last digits of a velocity decide
        for _ in range(60 if body is OSCILLATOR else 12):
            b.advance_to_event()
            assert b.get("contact[1].event_time") == pytest.approx(b.time, abs=0.0)
            b.answer(body.r)
            fused.step(b.time + 1e-9 - fused.time)
            assert abs(fused.get("contact[1].last_time") - b.get("contact[1].last_time")) <= PARTITION
            assert abs(fused.get("contact[1].last_velocity") - b.get("contact[1].last_velocity")) <= PARTITION


@each_body
def test_an_answer_that_never_came_is_an_error_not_a_hang(body: BodyScene) -> None:
    with body.fmu(body.coupled, event_mode=True) as b:
        b.advance_to_event()
        with pytest.raises(FMICallException):
            b.fmu.updateDiscreteStates()
        assert "contact[1].applied_restitution: expected an answer" in b.messages[-1]
        b.fmu.enterStepMode()
        with pytest.raises(FMICallException):
            b.step(1.0)
    with pytest.raises(FMICallException):
        simulate(
            body.component,
            body.coupled,
            ["displacement"],
            body.end,
            body.end / 120.0,
            use_event_mode=True,
            early_return_allowed=True,
        )


@each_body
@pytest.mark.parametrize("answer", [-0.1, 1.1, math.nan])
def test_an_answer_that_is_no_restitution_is_an_error(body: BodyScene, answer: float) -> None:
    with body.fmu(body.coupled, event_mode=True) as b:
        b.advance_to_event()
        b.set("contact[1].applied_restitution", answer)
        with pytest.raises(FMICallException):
            b.fmu.updateDiscreteStates()


# ---- saved states ----


@each_version
@pytest.mark.parametrize(
    ("body", "law"), [(body, law) for body in BODIES for law in range(len(body.laws))], ids=str
)
def test_a_state_that_is_restored_goes_on_as_it_did(body: BodyScene, version: str, law: int) -> None:
    scene, size, pressed = {**body.scene, **body.laws[law]}, body.end / 36.0, 0
    with body.fmu(scene, version=version) as b, body.fmu(scene, version=version) as other:
        for _ in range(20):  # impacts, sticking or pressing, flight
            b.step(size)
            data, time = b.serialized(), b.time
            pressed += b.get("contact[1].force") > 0.0
            b.step(6.5 * size)
            end = b.state()
            for again in (b, other):
                again.restore(data)
                again.time = time
                again.step(6.5 * size)
                assert again.state() == end
    assert pressed >= 2 or scene["contact[1].law"] == RESTITUTION


@each_body
@each_version
def test_a_foreign_or_damaged_state_is_refused_and_changes_nothing(body: BodyScene, version: str) -> None:
    other = CHAIN if body is BEAM else BEAM
    with other.fmu(version=version) as o:
        foreign = o.serialized()
    with body.fmu(version=version) as b:
        b.step(body.end)
        good = b.serialized()
        chance = np.random.default_rng(1)
        damaged = [b"", b"x", good[:-1], good + b"\0", good[:40], bytes(len(good)), chance.bytes(len(good))]
        damaged.append(foreign)
        # every byte of a small state, some hundreds of a large one
        for position in range(0, len(good), 1 + len(good) // 500):
            damaged.append(good[:position] + bytes([good[position] ^ 0x40]) + good[position + 1 :])
        for data in damaged:
            with pytest.raises(FMICallException):
                b.restore(data)
            assert b.serialized() == good
        b.restore(good)
        b.step(1.0)


@each_body
@each_version
def test_an_impulse_on_a_pair_port_is_given_once_and_a_saved_state_holds_it(
    body: BodyScene, version: str
) -> None:
    scene = {**body.scene, "contact[1].law": 7}
    with body.fmu(scene, version=version) as b:
        b.step(0.1)
        mass, before = b.get("contact[1].mass"), b.get("contact[1].velocity")
        b.set("contact[1].applied_impulse", 2.0 * mass)
        data, time = b.serialized(), b.time
        for _ in range(2):
            assert b.get("contact[1].velocity") == pytest.approx(before + 2.0, rel=1e-12)
            assert b.get("contact[1].applied_impulse") == 0.0
        b.step(0.3)
        after = b.get("contact[1].velocity")
        b.restore(data)
        b.time = time
        b.step(0.3)
        assert b.get("contact[1].velocity") == after
