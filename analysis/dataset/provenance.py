"""The program that made a dataset: the versions of its packages, and its commit."""

from __future__ import annotations

import json
import platform
import subprocess
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

_PACKAGES = ("vibroimpact", "numpy", "fmpy", "xarray", "netCDF4", "dask", "distributed")
_GIT_SECONDS = 5.0


def program_attributes() -> dict[str, Any]:
    """Return the global attributes that identify the program behind a dataset."""
    return {"versions": json.dumps(versions()), "git_commit": git_commit()}


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results may depend on."""
    return dict(_versions())


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    """Read the versions once per process: each one is a search of all installed packages."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "unknown"
    return found


@lru_cache(maxsize=1)
def git_commit() -> str:
    """Return the commit of the checkout this package runs from, `-dirty` when changed; else `unknown`."""
    here = Path(__file__).resolve()
    # A virtual environment may lie inside a checkout of another project: only our own tracked file counts.
    # The question to git is needless where the checkout begins at our own root.
    if not (here.parents[2] / ".git").exists() and _git("ls-files", "--error-unmatch", here.name) is None:
        return "unknown"
    return _git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*") or "unknown"


def _git(*arguments: str) -> str | None:
    command = ["git", "-C", str(Path(__file__).resolve().parent), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_GIT_SECONDS, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
