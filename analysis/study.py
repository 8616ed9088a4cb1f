"""The base class of studies: rows found one after the other, and their results, also when only half are found.

Each study is one class. The class says how it is prepared from the arguments of its operation. It finds the rows,
and makes of them a dataset, a print and a figure. `whole` makes a study for a caller in Python;
`analysis.commands.studies` conducts one on the command line, and keeps the results after Ctrl-C or a failure.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import xarray as xr

from vibroimpact.analysis.dataset.checking import marked
from vibroimpact.analysis.dataset.provenance import program_attributes
from vibroimpact.analysis.dataset.reading import opened_in_memory
from vibroimpact.analysis.files.stores import Place
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.terminal import Terminal

Row = TypeVar("Row")
INCOMPLETE = "incomplete"
"""Attribute of the dataset of half a study: why it ended."""


def _nowhere(_: Any) -> None:
    """Show nothing."""


@dataclass(eq=False)
class Study(ABC, Generic[Row]):
    """A study; a subclass is a dataclass whose fields say what is studied.

    A subclass implements `rows` and `made`; for the command line also `prepare` and `print_results`.

    Attributes
    ----------
    found : list
        Rows found so far, each of them whole.
    incomplete : str
        Why rows are missing; empty when all are there.
    interruption : str
        Message printed after the results of an interrupted study.
    status : callable
        Shows the progress of the study on a terminal.
    """

    name: ClassVar[str]
    nothing: ClassVar[str] = "a result"
    """Noun for the rows, for the message that there are none."""
    begins: ClassVar[str] = ""
    """First words of the status line; empty: no status line."""
    named: ClassVar[tuple[type[VibroimpactError], ...]] = ()
    """Errors to which the command line adds the name of the file that is studied."""
    history: ClassVar[str] = ""
    """Attribute `history` of its dataset: an existing dataset with the same one was made by the same command."""
    mark: ClassVar[str] = "scene_file"
    """Attribute that the command line adds to the dataset: the path of the studied file."""
    figure: ClassVar[str] = "auto"
    """Kind of its figure."""

    found: list[Row] = field(default_factory=list, init=False)
    incomplete: str = field(default="interrupted", init=False)
    interruption: str = field(default="Interrupted: the above is what was found.", init=False)
    status: Callable[[str], None] = field(default_factory=lambda: _nowhere, init=False)

    @classmethod
    @abstractmethod
    def prepare(cls, options: Any, stack: ExitStack) -> Study[Any] | None:
        """Return the study that the arguments of its operation describe; None where they describe no study.

        Parameters
        ----------
        options : Operation
        stack : ExitStack
            Closes, at the end, everything that the study opens.
        """

    @classmethod
    def reads(cls, options: Any) -> Sequence[Place]:
        """Return the files and stores that the arguments name; the studied file comes first."""
        return [options.scene]

    @classmethod
    def marks(cls, options: Any) -> Mapping[str, Any]:
        """Return the attributes that the command line adds to the dataset."""
        return {cls.mark: str(cls.reads(options)[0])} if cls.mark else {}

    @classmethod
    def same(cls, options: Any) -> Mapping[str, Any]:
        """Return the attributes by which an existing dataset counts as made by the same command before."""
        if cls.history:
            return {"history": cls.history}
        return {"results_kind": cls.name.replace("-", "_"), **cls.marks(options)}

    @abstractmethod
    def rows(self) -> Generator[Row, None, None]:
        """Find the rows, one after the other; arguments that allow no row are refused before the first row."""

    @abstractmethod
    def made(self) -> xr.Dataset:
        """Return the dataset of the rows found so far."""

    @cached_property
    def dataset(self) -> xr.Dataset:
        """Dataset of the rows of the finished study, with the versions of the program."""
        return self.made().assign_attrs(program_attributes())

    def take(self, row: Row) -> None:
        """Keep a row."""
        self.found.append(row)

    @property
    def is_empty(self) -> bool:
        """Whether nothing was found that could be shown."""
        return not self.found

    def shown(self) -> AbstractContextManager[Any]:
        """Return the status line of the study, which is shown while the context is open."""
        return Terminal(stderr=True).status(self.begins) if self.begins else nullcontext()

    @abstractmethod
    def print_results(self) -> None:
        """Print the results."""

    @property
    def written(self) -> xr.Dataset | None:
        """Return the dataset to write; None where there is nothing to write."""
        return self.dataset

    @property
    def drawn(self) -> Any:
        """Return the data of the figure; None where there is nothing to draw."""
        found = self.dataset
        return found if "results_kind" in found.attrs else opened_in_memory(marked(found))

    def conclude(self, options: Any) -> None:
        """Finish the study when results are printed, written and drawn; `incomplete` says whether rows are missing."""


AnyStudy = TypeVar("AnyStudy", bound=Study[Any])


def whole(study: AnyStudy) -> AnyStudy:
    """Return a study once all of its rows are found."""
    with closing(study.rows()) as rows:
        for row in rows:
            study.take(row)
    study.incomplete = ""
    return study
