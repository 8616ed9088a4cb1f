"""Studies on the command line: prepared, followed row by row, then printed, written and drawn, also half of them."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any, Protocol

import typer

from vibroimpact.analysis.dataset import write_dataset
from vibroimpact.analysis.dataset.outputs import Places, refuse_places, writing
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.files.stores import Place
from vibroimpact.analysis.study import INCOMPLETE, Study
from vibroimpact.fmus.errors import DatasetError, VibroimpactError
from vibroimpact.fmus.operations.declaring import ROOT
from vibroimpact.fmus.terminal import say


class Interrupted(VibroimpactError):
    """Ctrl-C came before there was anything to show."""

    exit_code = 130


class Studied(Places, Protocol):
    """Arguments of operations that are studies: the study, and where its results go."""

    @property
    def study(self) -> str:
        """`module:class` of the study, below the package."""


def conduct(options: Studied) -> None:
    """Carry out a study; the rows found are printed, written and drawn, also when it ends half way.

    VibroimpactError: the study cannot be made, or it failed half way. typer.Exit: Ctrl-C came. The rows found before
    are printed, written and drawn even then.
    """
    kind: type[Study[Any]] = pkgutil.resolve_name(f"{ROOT}.{options.study}")
    read = kind.reads(options)
    refuse_places(options, read, **kind.same(options))
    with ExitStack() as stack:
        study = _prepared(kind, options, stack)
        if study is None:
            return
        with _naming(study, read):
            failure = _followed(study)
            study.print_results()
        if options.output is not None:
            _write(study, options, options.output)
        if options.figure is not None:
            _draw(study, options.figure)
        study.conclude(options)
        if failure is not None:
            with _naming(study, read):
                raise failure
        if study.incomplete:
            say(study.interruption, err=True)
            raise typer.Exit(130)


@contextmanager
def _naming(study: Study[Any], read: Sequence[Place]) -> Iterator[None]:
    """Add the name of the studied file to errors that do not name it."""
    try:
        yield
    except study.named as problem:
        if str(problem).startswith(f"{read[0]}: "):
            raise
        raise problem.named(read[0]) from problem


def _prepared(kind: type[Study[Any]], options: Studied, stack: ExitStack) -> Study[Any] | None:
    try:
        return kind.prepare(options, stack)
    except KeyboardInterrupt:
        raise _nothing_yet(kind) from None


def _nothing_yet(kind: type[Study[Any]]) -> Interrupted:
    return Interrupted(f"{kind.name}: interrupted before there was {kind.nothing}.")


def _followed(study: Study[Any]) -> Exception | None:
    """Find the rows; return the failure that ended the study, if any.

    VibroimpactError: nothing was found before an interrupt or a failure.
    """
    try:
        with study.shown() as status, closing(study.rows()) as rows:
            if study.begins:
                study.status = status.update
            for row in rows:
                study.take(row)
        study.incomplete = ""
    except KeyboardInterrupt:
        if study.is_empty:
            raise _nothing_yet(type(study)) from None
    except Exception as problem:
        if study.is_empty:
            raise
        study.incomplete = f"failed: {problem}"
        return problem
    return None


def _write(study: Study[Any], options: Studied, output: Path) -> None:
    found = study.written
    if found is None:
        return
    ended = {INCOMPLETE: study.incomplete} if study.incomplete else {}
    found = found.assign_attrs({**study.marks(options), **ended})
    with writing(output):
        (write_results if "results_kind" in found.attrs else write_dataset)(found, output)
    say(f"Dataset written to {output}.")


def _draw(study: Study[Any], figure: Path) -> None:
    data = study.drawn
    if data is None:
        return
    from vibroimpact.analysis import figures  # half a second, which a table alone does not need

    try:
        drawn = figures.draw(data, study.figure)
    except DatasetError as problem:
        if not study.incomplete:
            raise
        say(f"{figure} is not written: {problem}", err=True)  # half a study may have nothing to draw
        return
    with writing(figure):
        figures.save(drawn, figure)
    say(f"Figure written to {figure}.")
