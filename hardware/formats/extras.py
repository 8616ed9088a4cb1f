"""Packages that only some formats need: they come with an extra, and one that is missing is named."""

from __future__ import annotations

from vibroimpact.fmus.errors import DatasetError


def missing_extra(what: str, package: str, extra: str) -> DatasetError:
    """Return the error of a format whose package is not installed.

    >>> str(missing_extra("a universal file (UFF)", "pyuff", "uff")).partition(". ")[0]
    'a universal file (UFF): expected the package pyuff to read it, got none'
    """
    return DatasetError(
        f"{what}: expected the package {package} to read it, got none. Install it: pip install "
        f"'vibroimpact[{extra}]', or in a clone pip install '.[{extra}]'."
    )
