"""Workers of a campaign: processes of a cluster or threads of this process, and the chunks that they run."""
