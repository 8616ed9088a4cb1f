"""Reads the descriptions of an FMU once by all parsers that meet them later: in the process that `archive` asks."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging import fmpy_door
from vibroimpact.fmus.packaging.archive import PARSED_XML
from vibroimpact.fmus.safe_xml import root_of


def read(path: str, options: dict[str, Any]) -> tuple[None, tuple[()]]:
    """Parse the XML of an unpacked FMU; messages begin with the option `where`.

    Raises
    ------
    ComponentFileError
        It is not well-formed, or declares a document type or an entity. What else is wrong with a description is told
        where it is used.
    """
    for name in PARSED_XML:
        file = Path(path, name)
        if file.is_file():
            root_of(file.read_bytes(), f"{options['where']}: {name}")
    with contextlib.suppress(ComponentFileError):  # of FMI's rules, which are told where the description is used
        fmpy_door.read(Path(path, fmpy_door.DESCRIPTION).read_bytes())
    return None, ()
