"""The options of the command `vibroimpact fmu`: list, build, check and export the package's components.

What a command does is imported when it is called: `--help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

commands = typer.Typer(no_args_is_help=True, help="List, build, check and export the FMUs of the package.")


def register(app: typer.Typer) -> None:
    """Add the command `fmu` to the command line."""
    app.add_typer(commands, name="fmu")


@commands.command("list")
def list_components() -> None:
    """Show every component, its FMUs and what they run on.

    Example: vibroimpact fmu list
    """
    from vibroimpact.fmus.commands.fmu import print_components

    print_components()


@commands.command("build")
def build_components(
    output: Annotated[Path | None, typer.Option(help="Folder to fill; else that of the package.")] = None,
) -> None:
    """Compile all components for this machine.

    Example: vibroimpact fmu build
    """
    from vibroimpact.fmus.commands.fmu import build_into

    build_into(output)


@commands.command("check")
def check_files(
    files: Annotated[list[Path] | None, typer.Argument(help="FMU files; all of the package if none.")] = None,
) -> None:
    """Check FMUs: description, binaries, functions, token. Runs their code.

    Example: vibroimpact fmu check Oscillator.fmu
    """
    from vibroimpact.fmus.commands.fmu import check_all

    check_all(files or ())


@commands.command("export")
def export_component(
    component: Annotated[str, typer.Argument(help="Component, for example oscillator.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write.")] = None,
    contacts: Annotated[int | None, typer.Option(help="Contacts in its description; default: all.")] = None,
    modes: Annotated[int | None, typer.Option(help="Beam: modes in its description; default: all.")] = None,
    masses: Annotated[int | None, typer.Option(help="Chain: masses, likewise.")] = None,
    sensors: Annotated[int | None, typer.Option(help="Beam: sensors, likewise.")] = None,
    fmi: Annotated[str, typer.Option(help="FMI version, 3.0 or 2.0.")] = "3.0",
    law: Annotated[Path | None, typer.Option(help="user-contact-law: the Python file of your law.")] = None,
) -> None:
    """Write an FMU for another tool, with as many contacts, modes, ... as wanted. Needs no compiler.

    Example: vibroimpact fmu export beam --modes 8 --contacts 2 -o beam8.fmu

    A contact law of your own in Python: vibroimpact fmu export user-contact-law --law my_law.py -o my_law.fmu
    """
    from vibroimpact.fmus.commands.fmu import export

    counts = {"contacts": contacts, "modes": modes, "masses": masses, "sensors": sensors}
    export(component, output, counts, fmi, law)
