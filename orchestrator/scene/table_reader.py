"""Reads one table of a scene file by its model; what is wrong joins a list of problems."""

from __future__ import annotations

from typing import TypeVar

from pydantic import BaseModel, ValidationError

from vibroimpact.orchestrator.scene.problems import Problem, key_path, problems_of, quoted

Table = TypeVar("Table", bound=BaseModel)


def read_table(
    model: type[Table], raw: object, path: tuple[str | int, ...], problems: list[Problem]
) -> Table | None:
    """Return a table as its model; None, and its problems added to the list, when it is not valid.

    Parameters
    ----------
    model : type of BaseModel
        The model of the table; its fields carry a `Rule`.
    raw : object
        What the document has there.
    path : tuple
        Where the table is, for example ("stop", 0).
    problems : list of Problem
        Grows.
    """
    if not isinstance(raw, dict):
        problems.append(Problem(_where(path), "a table", quoted(raw), f"Write {_brackets(path)}."))
        return None
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        problems += problems_of(error, model, path)
        return None


def read_array(
    model: type[Table], raw: object, name: str, problems: list[Problem]
) -> tuple[Table | None, ...]:
    """Return the tables of an array `[[name]]`, None in place of each that is not valid."""
    if not isinstance(raw, list):
        hint = f"Write [[{name}]], with two brackets, for each {name}."
        problems.append(Problem(name, f"[[{name}]] tables", quoted(raw), hint))
        return ()
    return tuple(read_table(model, table, (name, place), problems) for place, table in enumerate(raw))


def _where(path: tuple[str | int, ...]) -> str:
    """Return the table to look at: of an array, the whole, because its brackets are what is wrong."""
    return key_path(path) if path[0] == "component" else str(path[0])


def _brackets(path: tuple[str | int, ...]) -> str:
    if path[0] == "component":
        return f'[{key_path(path)}] and below it fmu = "FILE.fmu"'
    if isinstance(path[-1], int):
        return f"[[{path[0]}]], with two brackets"
    return f"[{path[0]}], with single brackets, once"
