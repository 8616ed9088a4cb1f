"""Components whose FMU a server has: `fmu = "grpc://HOST:PORT"`."""

from __future__ import annotations

from pathlib import Path

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.remote.address import SCHEME, FmuServer, read_address
from vibroimpact.orchestrator.scene.component_models import ComponentTable
from vibroimpact.orchestrator.scene.problems import Problem, key_path, quoted

ANSWER_SECONDS = 300.0
"""Longest time for an answer of a server in a scene without a deadline, s: as long as a guarded point may take."""


def is_served(fmu: str) -> bool:
    """Return whether a component's `fmu` is the address of a server."""
    return fmu.lower().startswith(SCHEME)


def served_component(
    table: ComponentTable, path: tuple[str, ...], folder: Path, problems: list[Problem]
) -> tuple[Path | None, FmuServer | None]:
    """Return a file with the description of a served FMU, and its server; None where the server has none to give."""
    where = key_path((*path, "fmu"))
    refuse_version(table, path, "a server", problems)
    address = read_address(table.fmu[len(SCHEME) :])
    if address is None or not address.port:
        hint = "For example grpc://127.0.0.1:31800."
        problems.append(Problem(where, f"{SCHEME}HOST:PORT", quoted(table.fmu), hint))
        return None, None
    certificate = None if table.certificate is None else (folder / table.certificate).absolute()
    try:
        # gRPC is imported only for FMUs elsewhere
        from vibroimpact.orchestrator.remote.description import served_fmu

        file, sha256 = served_fmu(address, certificate)
    except ComponentError as error:
        message = " ".join(str(error).split()).rstrip(".")
        problems.append(
            Problem(where, "a server that gives the description of its FMU", f"an error: {message}")
        )
        return None, None
    return file, FmuServer(address, certificate, sha256, ANSWER_SECONDS)


def refuse_version(table: ComponentTable, path: tuple[str, ...], what: str, problems: list[Problem]) -> None:
    """Add the problem of the key `fmi` beside an FMU that says itself which version it is."""
    if table.fmi is not None:
        hint = "The FMU itself says which version it is: remove fmi."
        got = f"fmi = {quoted(table.fmi)} beside {what}"
        expected = "fmi beside the name of a shipped component only"
        problems.append(Problem(key_path((*path, "fmi")), expected, got, hint))
