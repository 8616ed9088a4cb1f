"""The command line with a point runner from `busy_runner`: `python busy_command.py RUNNER ARGUMENTS...`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import vibroimpact.orchestrator.campaign.campaign as campaign
import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.orchestrator.commands.cli import main

CHUNK_SECONDS = 0.25
"""Shorter than usual, so that a campaign of two seconds has as many parts as a long one."""


def run_with(runner: str, arguments: list[str]) -> None:
    """Run the command line with another default runner."""
    campaign.run_campaign.__kwdefaults__["runner"] = runner
    schedule.CHUNK_SECONDS = CHUNK_SECONDS
    main(arguments)


if __name__ == "__main__":
    run_with(f"support.busy_runner:{sys.argv[1]}", sys.argv[2:])
