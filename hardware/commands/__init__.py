"""The commands of this package: `options` declares them, `import_files` is what they do."""

from __future__ import annotations

from vibroimpact.hardware.commands.options import register

__all__ = ["register"]
