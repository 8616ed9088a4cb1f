"""Operation `cancel`: end a campaign of a service."""

from __future__ import annotations

from vibroimpact.fmus.operations import operation
from vibroimpact.service.operations.arguments import Folder, Name, Url
from vibroimpact.service.operations.packages import ServiceOperation


@operation("service.commands.asking:cancel_campaign")
class Cancel(ServiceOperation):
    """Cancel a campaign; its results so far stay with the service.

    Example: vibroimpact cancel 0123456789abcdef0123456789abcdef --data service
    """

    name: Name
    service: Url = None
    data: Folder = None
