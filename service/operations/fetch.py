"""Operation `fetch`: write the dataset of a service's campaign to a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Option, operation
from vibroimpact.service.operations.arguments import Folder, Name, Url
from vibroimpact.service.operations.packages import ServiceOperation


@operation("service.commands.asking:fetch_dataset")
class Fetch(ServiceOperation):
    """Fetch the dataset of a finished campaign.

    Example: vibroimpact fetch 0123456789abcdef0123456789abcdef -o bifurcation.nc --data service
    """

    name: Name
    output: Annotated[Path, Option("--output", "-o", help="Dataset to write (.nc).")]
    service: Url = None
    data: Folder = None
