"""What several tests stand on: references of their own, makers of scenes, records and FMUs, tolerances, places."""
