"""Reading of an FMU's descriptions by all parsers that meet them later, in the process that `archive` starts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging import fmpy_door
from vibroimpact.fmus.packaging.archive import PARSED_XML
from vibroimpact.fmus.safe_xml import root_of


def read(path: str, options: dict[str, Any]) -> tuple[str, tuple[()]]:
    """Parse the XML of an unpacked FMU; messages begin with the option `where`.

    The returned text lists the rules of FMI that the description breaks beyond repair; the user of the description
    reports it. Raise ComponentFileError for XML that is not well-formed, or that declares a document type or an entity.
    """
    for name in PARSED_XML:
        file = Path(path, name)
        if file.is_file():
            root_of(file.read_bytes(), f"{options['where']}: {name}")
    try:
        fmpy_door.read(Path(path, fmpy_door.DESCRIPTION).read_bytes())
    except ComponentFileError as error:
        return "\n".join(f"{options['where']}: {line}" for line in str(error).splitlines()), ()
    return "", ()
