"""All points of a sweep: computed by workers, kept as parts, resumed, extended, one dataset at the end."""

from __future__ import annotations

from vibroimpact.orchestrator.campaign.campaign import CampaignInterrupted, CampaignReport, run_campaign
from vibroimpact.orchestrator.campaign.check import SceneCost, cost_of
from vibroimpact.orchestrator.campaign.single_run import run_scene

__all__ = [
    "CampaignInterrupted",
    "CampaignReport",
    "SceneCost",
    "cost_of",
    "run_campaign",
    "run_scene",
]
