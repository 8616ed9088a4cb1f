"""Operation `serve`: run the service on one folder and one port."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

from vibroimpact.fmus.operations import Option, operation
from vibroimpact.service.operations.packages import ServiceOperation


@operation("service.serving:serve")
class Serve(ServiceOperation):
    """Run the service: campaigns over HTTP, one after the other, resumed after any interruption.

    Example: vibroimpact serve --data service --port 8737
    """

    needs: ClassVar[tuple[str, ...]] = ("fastapi", "uvicorn", "prometheus_client")

    data: Annotated[Path, Option(help="Folder of the service: token, queue, campaigns.")]
    port: Annotated[int, Option(min=0, max=65535, help="Port; 0: any free one.")] = 8737
    host: Annotated[str, Option(help="Address to listen on.")] = "127.0.0.1"
    scheduler: Annotated[
        str | None, Option(help="Use the workers of this Dask scheduler (tcp://host:8786).")
    ] = None
    allow_remote: Annotated[
        bool, Option("--allow-remote", help="Allow an address that other machines can reach.")
    ] = False
    allow_fmu_upload: Annotated[
        bool, Option("--allow-fmu-upload", help="Accept FMUs: native code that runs with your rights.")
    ] = False
    allow_host: Annotated[
        list[str] | None,
        Option(metavar="NAME", help="Further host name of the service, for example of a proxy; repeatable."),
    ] = None
