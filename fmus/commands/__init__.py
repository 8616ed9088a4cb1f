"""The commands of this package: `options` declares them, `fmu` is what they do."""

from __future__ import annotations

from vibroimpact.fmus.commands.options import commands, register

__all__ = ["commands", "register"]
