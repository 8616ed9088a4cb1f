"""All points of a sweep: computed by workers, kept as parts, resumed, extended, one dataset at the end."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.campaign import run_campaign
    from vibroimpact.orchestrator.campaign.check import SceneCost, cost_of
    from vibroimpact.orchestrator.campaign.report import CampaignInterrupted, CampaignReport

__all__ = ["CampaignInterrupted", "CampaignReport", "SceneCost", "cost_of", "run_campaign"]
_HOMES = {
    "cost_of": "check",
    "SceneCost": "check",
    "CampaignInterrupted": "report",
    "CampaignReport": "report",
}


def __getattr__(name: str) -> Any:
    # The import of Dask takes a tenth of a second, and a run without workers does not need it.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES.get(name, 'campaign')}"), name)
