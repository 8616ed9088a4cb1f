"""The Zarr store of a campaign: filled by shards, each with its seal."""
