"""The FMUs of the package: their names and paths."""

from __future__ import annotations

import difflib
import hashlib
import tomllib
from functools import cache
from importlib.resources import files
from pathlib import Path

from vibroimpact.fmus.errors import ComponentFileError

FOLDERS = {"3.0": "fmi3", "2.0": "fmi2"}


def components() -> tuple[str, ...]:
    """Return the names of the package's components, built or not."""
    return tuple(_folders())


def fmu_path(name: str, fmi: str = "3.0") -> Path:
    """Return the FMU of a component of the package.

    Parameters
    ----------
    name : str
        Name of the component in any spelling: `ImpactStop`, `impact_stop`, `impact-stop`.
    fmi : str
        Version of FMI, `3.0` or `2.0`.

    Returns
    -------
    Path
        The FMU file.

    Raises
    ------
    ComponentFileError
        The component is unknown (the message offers the nearest name), or it was not built.
    """
    if fmi not in FOLDERS:
        raise ComponentFileError(f"{name}: expected FMI version {' or '.join(FOLDERS)}, got {fmi!r}.")
    path = package_folder() / "built" / FOLDERS[fmi] / f"{component_name(name)}.fmu"
    if not path.is_file():
        raise ComponentFileError(
            f"{path}: expected a built FMU, got none. Run `python -m vibroimpact.fmus.packaging.build`."
        )
    return path


def is_shipped(size: int, digest: str) -> bool:
    """Return whether a content, by its size (bytes) and SHA-256, is that of an FMU of the package, of any name."""
    for folder in FOLDERS.values():
        for path in (package_folder() / "built" / folder).glob("*.fmu"):
            if path.stat().st_size == size:
                with path.open("rb") as file:
                    if hashlib.file_digest(file, "sha256").hexdigest() == digest:
                        return True
    return False


def component_name(name: str) -> str:
    """Return a component's name from any spelling of it.

    Raises
    ------
    ComponentFileError
        The component is unknown; the message offers the nearest name.

    Examples
    --------
    >>> component_name("impact-stop"), component_name("Impact Stop"), component_name("IMPACT_STOP")
    ('ImpactStop', 'ImpactStop', 'ImpactStop')
    """
    known = {letters_of(own): own for own in components()}
    if letters_of(name) in known:
        return known[letters_of(name)]
    near = difflib.get_close_matches(letters_of(name), known, n=1, cutoff=0.5)
    hint = f" Did you mean {known[near[0]]}?" if near else ""
    raise ComponentFileError(f"component: expected one of {', '.join(components())}, got {name!r}.{hint}")


def letters_of(name: str) -> str:
    """Return the letters and digits of a name in lower case, equal for all its spellings.

    Examples
    --------
    >>> letters_of("user-contact-law") == letters_of("UserContactLaw")
    True
    """
    return "".join(filter(str.isalnum, name.lower()))


def component_folder(name: str) -> Path:
    """Return the folder of a component's own sources, from any spelling of its name.

    Raises
    ------
    ComponentFileError
        The component is unknown; the message offers the nearest name.
    """
    return package_folder() / "native" / _folders()[component_name(name)]


def _folders() -> dict[str, str]:
    described = sorted((package_folder() / "native").glob("*/variables.toml"))
    return dict(_name_and_folder(path, path.stat().st_mtime_ns) for path in described)


@cache
def _name_and_folder(path: Path, changed: int) -> tuple[str, str]:
    # every request for an FMU asks for all names, and parsing the tables of variables would take most of its time
    table = path.read_text(encoding="utf-8").partition("[component]")[2].partition("\n[")[0]
    head = tomllib.loads(table)
    return head["name"], head["folder"]


def package_folder() -> Path:
    """Return the folder that contains the shipped FMUs, directly or deeper."""
    return Path(str(files("vibroimpact.fmus")))
