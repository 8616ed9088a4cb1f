"""Programs that measure and drive on a rig."""
