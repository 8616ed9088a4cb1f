"""The command line with a point runner from `busy_runner`."""

import sys

import vibroimpact.orchestrator.campaign.campaign as campaign
import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.orchestrator.commands import cli

CHUNK_SECONDS = 0.25
"""Shorter than usual, so that a campaign of two seconds has as many parts as a long one."""


def main() -> None:
    """Run the command line with the runner that the first argument names."""
    campaign.run_campaign.__kwdefaults__["runner"] = f"support.busy_runner:{sys.argv[1]}"
    schedule.CHUNK_SECONDS = CHUNK_SECONDS
    cli.main(sys.argv[2:])
