"""The commands of this package: `options` declares them, a module for each is what it does."""

from __future__ import annotations

from vibroimpact.analysis.commands.options import register

__all__ = ["register"]
