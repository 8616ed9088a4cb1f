"""Operation `submit`: submit a scene as a campaign of a service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Option, Positional, operation
from vibroimpact.service.operations.arguments import Folder, Url
from vibroimpact.service.operations.packages import ServiceOperation


@operation("service.commands.asking:submit_scene")
class Submit(ServiceOperation):
    """Submit a scene to a service and print the id of its campaign.

    Example: vibroimpact submit examples/bifurcation.toml --data service --wait
    """

    scene: Annotated[Path, Positional(help="Scene file (TOML).")]
    service: Url = None
    data: Folder = None
    workers: Annotated[int | None, Option(min=1, help="Worker processes.")] = None
    wait: Annotated[bool, Option("--wait", help="Wait for the end of the campaign.")] = False
    recording: Annotated[
        list[Path] | None,
        Option(help="Recording, or file to import, to upload and replay; repeatable."),
    ] = None
    fit: Annotated[str | None, Option(help="Numbers of a replay to fit, by key, with commas.")] = None
    score: Annotated[
        list[Path] | None, Option(help="Recording to upload and score without fitting; repeatable.")
    ] = None
