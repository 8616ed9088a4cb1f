"""Time of a step of an FMU on a server of this machine, without TLS and with it, beside the same FMU in this process.

Two oscillators exchange displacements at each step; one of them is served. A step carries its inputs, the step and the
outputs in one message there and one back. The figure is the median of many steps. Its goal is 1 ms on a machine that is
otherwise idle: a message wakes four threads in three processes, one after the other.

Run with `python tests/benchmarks/bench_remote.py [--steps 2000]`.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.processes.process import Process
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.remote.address import SCHEME, TOKENS_VARIABLE, FmuServer, read_address
from vibroimpact.orchestrator.remote.description import served_fmu

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.served_fmus import certificate

GOAL = 1e-3
"""Largest median time of a step, s."""
STEP = 0.01
START_SECONDS = 60.0
FMU = fmu_path("Oscillator")
BODY = {"stiffness": 1.0, "forcing.amplitude": 0.5, "forcing.angular_frequency": 0.9}
LINKS = [
    ConnectionSpec(("near", "displacement"), ("far", "force"), 0.1),
    ConnectionSpec(("far", "displacement"), ("near", "force"), 0.1),
]


@contextmanager
def served(folder: Path, *, tls: bool) -> Iterator[FmuServer]:
    """Serve the FMU in a process of its own for the duration of the block."""
    more: list[str] = []
    if tls:
        made = certificate()
        (folder / "own.pem").write_bytes(made.certificate)
        (folder / "own.key").write_bytes(made.key)
        more = ["--certificate", str(folder / "own.pem"), "--key", str(folder / "own.key")]
    token = folder / "token"
    command = ["-m", "vibroimpact.orchestrator.commands.cli", "fmu", "serve", str(FMU)]
    command += ["--listen", "127.0.0.1:0", "--token-file", str(token), *more]
    with Process(*command, errors="shared") as process:
        said = process.line(START_SECONDS)
        address = read_address(said.partition(SCHEME)[2].partition(". ")[0])
        if address is None:
            raise SystemExit(f"expected the address of a server, got {said!r}.")
        os.environ[TOKENS_VARIABLE] = f"{address}={token.read_text().strip()}"
        pem = folder / "own.pem" if tls else None
        try:
            yield FmuServer(address, pem, served_fmu(address, pem)[1], START_SECONDS)
        finally:
            process.interrupt(START_SECONDS)


def step_seconds(server: FmuServer | None, steps: int) -> list[float]:
    """Return the wall time of each step, s."""
    far = ComponentSpec("far", FMU, BODY)
    if server is not None:
        path, _ = served_fmu(server.address, server.certificate)
        far = replace(far, fmu=path, server=server)
    importer = Importer([ComponentSpec("near", FMU, BODY), far], LINKS, macro_step=STEP)
    ends: list[float] = []
    importer.watchers.append(
        StepWatcher(lambda time: None, lambda begin, end: ends.append(time.perf_counter()))
    )
    importer.begin()
    importer.advance(STEP * steps)
    importer.free()
    return [
        after - before for before, after in zip(ends[steps // 10 :], ends[steps // 10 + 1 :], strict=False)
    ]


def main() -> None:
    """Measure, print a line for each way, and end in an error where the goal was missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2000)
    steps = parser.parse_args().steps
    ways: dict[str, list[float]] = {"in this process": step_seconds(None, steps)}
    for tls, name in ((False, "loopback"), (True, "loopback, TLS")):
        with tempfile.TemporaryDirectory() as folder, served(Path(folder), tls=tls) as server:
            ways[name] = step_seconds(server, steps)
    for name, seconds in ways.items():
        least, most = (1e6 * sorted(seconds)[int(share * len(seconds))] for share in (0.05, 0.95))
        print(
            f"{name:18} {1e6 * statistics.median(seconds):8.1f} us a step, 90 % from {least:.0f} to {most:.0f} us"
        )
    slowest = max(statistics.median(seconds) for seconds in ways.values())
    print(f"A step of a served FMU takes at most {1e3 * slowest:.2f} ms (goal {1e3 * GOAL:g} ms).")
    if slowest > GOAL:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
