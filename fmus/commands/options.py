"""The options of the command `vibroimpact fmu`: list, build and check the package's components.

`export` takes scenes too and is declared where they are known, in the orchestrator.

What a command does is imported when it is called: `--help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

#: Help of the option of all commands that read FMUs of other tools.
STRICT = "Refuse FMUs that may run wrong, instead of saying so."
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
    strict: Annotated[bool, typer.Option("--strict", help=STRICT)] = False,
) -> None:
    """Check FMUs: description, binaries, functions, token. Runs their code.

    What will not run is an error, what may run wrong and what is only odd are said.

    Example: vibroimpact fmu check Oscillator.fmu
    """
    from vibroimpact.fmus.commands.fmu import check_all

    check_all(files or (), strict=strict)
