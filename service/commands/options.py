"""The options of `vibroimpact serve`, `submit`, `status`, `fetch` and `cancel`.

What the commands do is imported when they are called: `--help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.fmus.errors import UsageError

Url = Annotated[
    str | None,
    typer.Option(
        "--service",
        metavar="URL",
        help="Of the service; by default $VIBROIMPACT_SERVICE, else that in --data, else 127.0.0.1:8737.",
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option(
        "--data", help="Folder of the service, which has its token and URL; else $VIBROIMPACT_TOKEN."
    ),
]
Name = Annotated[str, typer.Argument(help="The id that `submit` printed.", metavar="ID")]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    for command in (serve, submit, status, fetch, cancel):
        app.command(command.__name__)(command)


def serve(
    data: Annotated[Path, typer.Option(help="Folder of the service: token, queue, campaigns.")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any free one.")] = 8737,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    scheduler: Annotated[
        str | None, typer.Option(help="Use the workers of this Dask scheduler (tcp://host:8786).")
    ] = None,
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Listen on an address that others reach.")
    ] = False,
    allow_fmu_upload: Annotated[
        bool, typer.Option("--allow-fmu-upload", help="Take FMUs, native code that runs with your rights.")
    ] = False,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Name by which others reach it, as through a proxy; repeat it."),
    ] = None,
) -> None:
    """Run the service: campaigns over HTTP, one after the other, resumed after anything.

    Example: vibroimpact serve --data service --port 8737
    """
    _need("fastapi", "uvicorn", "prometheus_client")
    from vibroimpact.service.serving import serve as run

    run(
        data,
        host=host,
        port=port,
        scheduler=scheduler,
        allow_remote=allow_remote,
        allow_fmu_upload=allow_fmu_upload,
        names=allow_host or (),
    )


def submit(
    scene: Annotated[Path, typer.Argument(help="Scene file (TOML).")],
    service: Url = None,
    data: Folder = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Worker processes.")] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Follow it to its end.")] = False,
    recording: Annotated[
        list[Path] | None,
        typer.Option(help="Recording, or file to import, to upload and replay; repeat it."),
    ] = None,
    fit: Annotated[str | None, typer.Option(help="Numbers of a replay to fit, with commas.")] = None,
    score: Annotated[
        list[Path] | None, typer.Option(help="Recording to upload and score that is not fitted; repeat it.")
    ] = None,
) -> None:
    """Submit a scene to a service and print the id of its campaign.

    Example: vibroimpact submit examples/bifurcation.toml --data service --wait
    """
    _need("httpx")
    from vibroimpact.service.commands.asking import Replayed, submit_scene

    submit_scene(scene, service, data, workers, wait, Replayed(recording or (), fit, score or ()))


def status(
    name: Annotated[
        str | None, typer.Argument(help="The id of one; else all are listed.", metavar="[ID]")
    ] = None,
    service: Url = None,
    data: Folder = None,
) -> None:
    """Say where the campaigns of a service are.

    Example: vibroimpact status --data service
    """
    _need("httpx")
    from vibroimpact.service.commands.asking import show_status

    show_status(name, service, data)


def fetch(
    name: Name,
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset to write (.nc).")],
    service: Url = None,
    data: Folder = None,
) -> None:
    """Fetch the dataset of a campaign that is done.

    Example: vibroimpact fetch 0123456789abcdef0123456789abcdef -o bifurcation.nc --data service
    """
    _need("httpx")
    from vibroimpact.service.commands.asking import fetch_dataset

    fetch_dataset(name, output, service, data)


def cancel(name: Name, service: Url = None, data: Folder = None) -> None:
    """Cancel a campaign; what it has computed stays with the service.

    Example: vibroimpact cancel 0123456789abcdef0123456789abcdef --data service
    """
    _need("httpx")
    from vibroimpact.service.commands.asking import cancel_campaign

    cancel_campaign(name, service, data)


def _need(*modules: str) -> None:
    """Refuse a command whose packages are not installed."""
    from importlib.util import find_spec

    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise UsageError(
            f"expected the packages of the service, got none of {', '.join(missing)}. "
            "Install them: pip install 'vibroimpact[service]'."
        )
