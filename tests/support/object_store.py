"""An object store on this machine: S3 as a server of this process plays it, with one bucket named `bucket`.

The packages are loaded by the tests that use the fixtures.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    import s3fs


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """Serve S3 on this machine, and yield the URL of the server."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def bucket(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[s3fs.S3FileSystem]:
    """Yield the file system that has the bucket `bucket`."""
    with bucket_of(endpoint, monkeypatch) as system:
        yield system


@contextmanager
def bucket_of(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[s3fs.S3FileSystem]:
    """Make the bucket `bucket` and yield the file system that has it; this process and its children find it."""
    import fsspec

    for name, value in {
        "AWS_ENDPOINT_URL": endpoint,
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_MAX_ATTEMPTS": "1",
    }.items():
        monkeypatch.setenv(name, value)
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    system = fsspec.filesystem("s3")
    system.mkdir("bucket")
    yield system
    system = fsspec.filesystem("s3")
    if system.exists("bucket"):
        system.rm("bucket", recursive=True)
    close_all()


def close_all() -> None:
    """Close the connections of all file systems: those of zarr are of its own loop."""
    import fsspec
    from zarr.core.sync import _get_loop as zarr_loop

    kind = fsspec.get_filesystem_class("s3")
    for system in kind._cache.values():
        if system._s3 is not None:
            loop = zarr_loop() if system.asynchronous else system.loop
            asyncio.run_coroutine_threadsafe(system._s3.close(), loop).result(10)
    kind.clear_instance_cache()
