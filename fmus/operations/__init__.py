"""Operations: the declaration of each command's arguments, from which every interface is made.

An operation is a frozen dataclass in a module of its own. Its fields are the arguments: name, type, default, words
and limits. The command line builds options from them, and the service builds the body of a request. A test compares
them with the functions of the Python door. `runs` names the function that carries the operation out; declarations
import nothing heavy.
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
