"""Operations: the declaration of each command's arguments, from which every surface is made.

An operation is a frozen dataclass in a module of its own. Its fields are the arguments: name, type, default, words and
limits. The command line builds options from them, the service builds the body of a request, and a test compares the
functions of the Python door with them. `runs` names the function that carries the operation out; declarations import
nothing heavy.
"""

from __future__ import annotations

from vibroimpact.fmus.operations.declaring import (
    Door,
    Operation,
    Option,
    Positional,
    Request,
    operation,
    study,
)
from vibroimpact.fmus.operations.shared import STRICT, DatasetFile, FigureFile, Force

__all__ = [
    "STRICT",
    "DatasetFile",
    "Door",
    "FigureFile",
    "Force",
    "Operation",
    "Option",
    "Positional",
    "Request",
    "operation",
    "study",
]
