"""The command line with a point runner from `busy_runner`."""

import math
import sys

import vibroimpact.orchestrator.campaign.campaign as campaign
import vibroimpact.orchestrator.campaign.schedule as schedule
import vibroimpact.orchestrator.campaign.workers.here as here
from vibroimpact.orchestrator.commands import cli

CHUNK_SECONDS = 0.25
"""Duration of a part, shorter than usual: a campaign of two seconds has as many parts as a long one."""
HERE = "@here"
"""End of a runner's name; a campaign with such a runner and without workers stays in its process."""


def main() -> None:
    """Run the command line with the runner that the first argument names."""
    name = sys.argv[1]
    campaign.run_campaign.__kwdefaults__["runner"] = f"support.busy_runner:{name.removesuffix(HERE)}"
    if name.endswith(HERE):
        campaign.may_begin_here = lambda *_: True
        here.HERE_SECONDS = math.inf
    schedule.CHUNK_SECONDS = CHUNK_SECONDS
    cli.main(sys.argv[2:])
