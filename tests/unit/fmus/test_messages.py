"""A message keeps both spellings of its arguments when it is extended, wrapped or sent to another process."""

from __future__ import annotations

import copy
import io
import json
import pickle

import pytest

from vibroimpact.fmus.errors import EstimationError, SceneError, UsageError, VibroimpactError
from vibroimpact.fmus.messages import Argument, Either, Message, joined, message, reworded, typed
from vibroimpact.fmus.terminal import Terminal

WIDEN = message("Widen ", Argument("start"), " and ", Argument("stop"), ".")
AGAIN = message("The same ", Either("call", "command"), " resumes.")


def both(text: str) -> tuple[str, str]:
    return str(text), typed(text)


def test_a_message_is_the_text_of_python_wherever_nobody_spells_it() -> None:
    assert WIDEN == "Widen start and stop."
    assert f"{WIDEN}" == WIDEN
    assert json.loads(json.dumps({"remark": WIDEN})) == {"remark": "Widen start and stop."}
    assert type(str(WIDEN)) is str


def test_messages_join_nest_and_are_reworded_in_both_spellings() -> None:
    assert both(joined("\n", [WIDEN, "Or not.", AGAIN])) == (
        "Widen start and stop.\nOr not.\nThe same call resumes.",
        "Widen --from and --to.\nOr not.\nThe same command resumes.",
    )
    assert both(message("a.nc: ", WIDEN)) == ("a.nc: Widen start and stop.", "a.nc: Widen --from and --to.")
    assert both(reworded(WIDEN, lambda text: text[:12])) == ("Widen start ", "Widen --from")
    assert type(reworded("Widen it.", str.upper)) is str


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_of_a_message_has_both_spellings(copied: type[Message]) -> None:
    assert both(copied(WIDEN)) == both(WIDEN)  # type: ignore[arg-type]


@pytest.mark.parametrize("error", [UsageError(WIDEN), SceneError([WIDEN, "a.toml: wrong"])])
def test_an_error_keeps_both_spellings_between_processes(error: VibroimpactError) -> None:
    sent = pickle.loads(pickle.dumps(error))
    assert (str(sent), sent.typed) == (str(error), error.typed)
    assert str(error).startswith("Widen start and stop.")
    assert error.typed.startswith("Widen --from and --to.")


def test_an_error_that_gets_the_name_of_its_file_stays_what_it_is() -> None:
    named = EstimationError(WIDEN).named("a.nc")
    assert isinstance(named, EstimationError)
    assert (str(named), named.typed) == ("a.nc: Widen start and stop.", "a.nc: Widen --from and --to.")
    assert (UsageError("plain").typed, UsageError().typed, str(UsageError("plain").named("a"))) == (
        "plain",
        "",
        "a: plain",
    )


def test_a_terminal_shows_the_spelling_that_it_is_for() -> None:
    for spelling, shown in ((typed, "- Widen --from and --to."), (str, "- Widen start and stop.")):
        file = io.StringIO()
        Terminal(spelling, file=file).print(message("- ", WIDEN), soft_wrap=True)
        assert file.getvalue() == f"{shown}\n"
