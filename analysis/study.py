"""What a study is: rows that are found one after the other, and what they are together, also half of them.

Each study is one class. It says how it is prepared from the arguments of its operation, how its rows are found, and
what they are as a dataset, in print and as a figure. `whole` makes one for a caller in Python;
`analysis.commands.studies` conducts one on the command line, and keeps what Ctrl-C or a failure leaves.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

import xarray as xr

from vibroimpact.analysis.dataset.checking import marked
from vibroimpact.analysis.dataset.provenance import program_attributes
from vibroimpact.analysis.dataset.reading import opened_in_memory
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.terminal import Terminal

Row = TypeVar("Row")
INCOMPLETE = "incomplete"
"""Attribute of the dataset of half a study: why it ended."""


def _nowhere(_: Any) -> None:
    """Show nothing."""


@dataclass(eq=False)
class Study(ABC, Generic[Row]):
    """A study; a subclass is a dataclass whose fields are what it is of.

    A subclass implements `rows` and `made`, for the command line `prepare` and `print_results` as well.

    Attributes
    ----------
    found : list
        Rows that were found so far, each of them whole.
    incomplete : str
        Why there are not all rows; empty when there are.
    interruption : str
        What is said of an interrupted study when its results are out.
    status : callable
        Says where the study is, on a terminal.
    """

    name: ClassVar[str]
    nothing: ClassVar[str] = "a result"
    """Noun of what there is none of before the first row."""
    begins: ClassVar[str] = ""
    """First words of the status line; none: there is no such line."""
    named: ClassVar[tuple[type[VibroimpactError], ...]] = ()
    """Errors to which the command line adds the name of the file that is studied."""
    history: ClassVar[str] = ""
    """Attribute `history` of its dataset, by which one that is there counts as made by the same command before."""
    mark: ClassVar[str] = "scene_file"
    """Attribute that the command line adds to the dataset: the path of what is studied."""
    figure: ClassVar[str] = "auto"
    """Kind of its figure."""

    found: list[Row] = field(default_factory=list, init=False)
    incomplete: str = field(default="interrupted", init=False)
    interruption: str = field(default="Interrupted: the above is what was found.", init=False)
    status: Callable[[str], None] = field(default_factory=lambda: _nowhere, init=False)

    @classmethod
    @abstractmethod
    def prepare(cls, options: Any, stack: ExitStack) -> Self | None:
        """Return the study that the arguments of its operation ask for; None where they ask for no study.

        Parameters
        ----------
        options : Operation
        stack : ExitStack
            Closes at the end what the study opens.
        """

    @classmethod
    def reads(cls, options: Any) -> Sequence[Path]:
        """Return the files that the arguments name; the first is what is studied."""
        return [options.scene]

    @classmethod
    def marks(cls, options: Any) -> Mapping[str, Any]:
        """Return the attributes that the command line adds to the dataset."""
        return {cls.mark: str(cls.reads(options)[0])} if cls.mark else {}

    @classmethod
    def same(cls, options: Any) -> Mapping[str, Any]:
        """Return the attributes by which a dataset that is there counts as made by the same command before."""
        if cls.history:
            return {"history": cls.history}
        return {"results_kind": cls.name.replace("-", "_"), **cls.marks(options)}

    @abstractmethod
    def rows(self) -> Generator[Row, None, None]:
        """Find the rows, one after the other; what makes none of them is refused before the first."""

    @abstractmethod
    def made(self) -> xr.Dataset:
        """Return the dataset of what was found so far."""

    @cached_property
    def dataset(self) -> xr.Dataset:
        """What was found, when no more rows come, with the program that found it."""
        return self.made().assign_attrs(program_attributes())

    def take(self, row: Row) -> None:
        """Keep a row."""
        self.found.append(row)

    @property
    def is_empty(self) -> bool:
        """Whether nothing was found that could be shown."""
        return not self.found

    def shown(self) -> AbstractContextManager[Any]:
        """Return what shows, while it is open, how far the study is."""
        return Terminal(stderr=True).status(self.begins) if self.begins else nullcontext()

    @abstractmethod
    def print_results(self) -> None:
        """Print what was found."""

    @property
    def written(self) -> xr.Dataset | None:
        """Dataset that is written; None where there is nothing to write."""
        return self.dataset

    @property
    def drawn(self) -> Any:
        """Data of the figure; None where there is nothing to draw."""
        found = self.dataset
        return found if "results_kind" in found.attrs else opened_in_memory(marked(found))

    def conclude(self, options: Any) -> None:
        """Do what is left when results are printed, written and drawn; `incomplete` says whether these are all."""


AnyStudy = TypeVar("AnyStudy", bound=Study[Any])


def whole(study: AnyStudy) -> AnyStudy:
    """Return a study when all of its rows are found."""
    with closing(study.rows()) as rows:
        for row in rows:
            study.take(row)
    study.incomplete = ""
    return study
