"""The commands of the service and of its client: `options` declares them, `asking` is what those of the client do."""

from __future__ import annotations

from vibroimpact.service.commands.options import register

__all__ = ["register"]
