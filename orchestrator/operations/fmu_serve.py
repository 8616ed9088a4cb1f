"""Operation `fmu serve`: an FMU for importers in other processes and on other machines."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Operation, Option, Positional, operation


@operation("orchestrator.commands.fmu_serve:serve_fmu")
class ServeFmu(Operation):
    """Serve an FMU to scenes elsewhere, until Ctrl-C: its code runs here, one process for each instance.

    A scene names it as fmu = "grpc://HOST:PORT". Whoever has the token runs the FMU as you.

    Example: vibroimpact fmu serve Ball.fmu

    To other machines: vibroimpact fmu serve Ball.fmu --listen 0.0.0.0:31800 --certificate lab.pem --key lab.key
    """

    file: Annotated[Path, Positional(help="FMU for co-simulation.", metavar="FILE.fmu")]
    listen: Annotated[
        str,
        Option(
            metavar="HOST:PORT",
            help="Address to listen on, port 0: any free one; beyond this machine with --certificate and --key alone.",
        ),
    ] = "127.0.0.1:31800"
    certificate: Annotated[Path | None, Option(help="Certificate (PEM) that clients see: TLS.")] = None
    key: Annotated[Path | None, Option(help="Private key (PEM) of the certificate.")] = None
    token_file: Annotated[
        Path | None,
        Option(
            help="File of the token, made if absent; default: a file in the cache, which scenes of yours find."
        ),
    ] = None
