"""Descriptions of arguments, and the class that declares an operation."""

from __future__ import annotations

import dataclasses
import pkgutil
from collections.abc import Callable, Iterator
from typing import (
    Annotated,
    Any,
    ClassVar,
    NamedTuple,
    TypeVar,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

ROOT = __name__.partition(".")[0]
CONDUCTS = "analysis.commands.studies:conduct"
"""The function that carries out every operation that is a study."""
Declared = TypeVar("Declared", bound="Operation")


class Request(NamedTuple):
    """Form of an argument in the body of a request to the service.

    Parameters
    ----------
    name : str
        Key in the body; empty: the name of the field.
    above, least, most : float, optional
        Limits of a number: it is above `above`, and from `least` to `most`.
    choices : tuple of str
        Allowed texts; empty: any text of 1 to 200 characters.
    """

    name: str = ""
    above: float | None = None
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()


class Argument:
    """Help text and limits of an argument.

    Parameters
    ----------
    *names : str
        Options on the command line; by default made from the name of the field.
    help : str
        Help text, with the unit.
    metavar : str, optional
        Placeholder for the value in the help.
    min, max : float, optional
        Limits of a number, both allowed.
    python : str, optional
        Form in the Python door where it differs, as in a signature; empty: the door does not have this argument.
    request : Request, optional
        Form in the body of a request; None: the service does not take this argument.
    """

    def __init__(
        self,
        *names: str,
        help: str,
        metavar: str | None = None,
        min: float | None = None,
        max: float | None = None,
        python: str | None = None,
        request: Request | None = None,
    ) -> None:
        self.names = names
        self.help = help
        self.metavar = metavar
        self.min, self.max = min, max
        self.python, self.request = python, request


class Option(Argument):
    """An argument that is named on the command line."""


class Positional(Argument):
    """An argument that the command line knows by its place."""


class Field(NamedTuple):
    """A declared argument: name, type, default (`MISSING`: required), help text and limits."""

    name: str
    type: Any
    default: Any
    words: Argument


class Door(NamedTuple):
    """The function of the Python door for an operation.

    Parameters
    ----------
    name : str
        Name in `vibroimpact`.
    also : tuple of str
        Parameters of the function that the operation lacks, as in its signature.
    without : tuple of str
        Arguments of the operation that the function lacks, besides those without a form in Python.
    """

    name: str
    also: tuple[str, ...] = ()
    without: tuple[str, ...] = ()


class Operation:
    """A declared operation; its docstring is the help of its command.

    Attributes
    ----------
    runs : str
        `module:function` below the package that carries the operation out when called with it.
    door : Door or None
        The function in Python, whose signature a test compares with the arguments.
    study : str
        `module:class` of the operation's study, below the package; empty: the operation is no study.
    """

    runs: ClassVar[str]
    door: ClassVar[Door | None]
    study: ClassVar[str] = ""

    @classmethod
    def function(cls) -> Callable[..., None]:
        """Return the function that the operation names; the first call imports its module."""
        found: Callable[..., None] = pkgutil.resolve_name(f"{ROOT}.{cls.runs}")
        return found

    def carry_out(self, **how: Any) -> None:
        """Call the function that the operation names; pass keywords that are no arguments of the operation."""
        self.function()(self, **how)

    @classmethod
    def fields(cls) -> Iterator[Field]:
        """Yield the arguments in their order."""
        hints = get_type_hints(cls, include_extras=True)
        for field in dataclasses.fields(cls):  # type: ignore[arg-type]  # the decorators below make each a dataclass
            hint = hints[field.name]
            assert get_origin(hint) is Annotated, f"{cls.__name__}.{field.name}: an argument without words"
            kind, words = get_args(hint)[:2]
            yield Field(field.name, kind, field.default, words)


@dataclass_transform(frozen_default=True, kw_only_default=True)
def operation(runs: str, door: Door | None = None) -> Callable[[type[Declared]], type[Declared]]:
    """Return a decorator that declares an operation; `Operation` explains the parameters."""

    def declared(cls: type[Declared]) -> type[Declared]:
        cls.runs, cls.door = runs, door
        return dataclasses.dataclass(frozen=True, kw_only=True)(cls)

    return declared


@dataclass_transform(frozen_default=True, kw_only_default=True)
def study(place: str, door: Door | None = None) -> Callable[[type[Declared]], type[Declared]]:
    """Return a decorator that declares a study as an operation, from its `module:class` and its door."""

    def declared(cls: type[Declared]) -> type[Declared]:
        cls.study = place
        return operation(CONDUCTS, door)(cls)

    return declared
