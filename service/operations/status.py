"""Operation `status`: where the campaigns of a service are."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import Positional, operation
from vibroimpact.service.operations.arguments import Folder, Url
from vibroimpact.service.operations.packages import ServiceOperation


@operation("service.commands.asking:show_status")
class Status(ServiceOperation):
    """Say where the campaigns of a service are.

    Example: vibroimpact status --data service
    """

    name: Annotated[str | None, Positional(help="The id of one; else all are listed.", metavar="[ID]")] = None
    service: Url = None
    data: Folder = None
