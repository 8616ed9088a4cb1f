"""The command line: `cli` is what starts, `options` declares the commands, a module for each is what it does."""

from __future__ import annotations

from vibroimpact.orchestrator.commands.options import register

__all__ = ["register"]
