"""Operation `status`: show the states of a service's campaigns."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import Positional, operation
from vibroimpact.service.operations.arguments import Folder, Url
from vibroimpact.service.operations.packages import ServiceOperation


@operation("service.commands.asking:show_status")
class Status(ServiceOperation):
    """Show the states of a service's campaigns.

    Example: vibroimpact status --data service
    """

    name: Annotated[str | None, Positional(help="Id of one; default: all are listed.", metavar="[ID]")] = None
    service: Url = None
    data: Folder = None
