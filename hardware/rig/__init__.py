"""What programs on a rig share: the rig that is meant, its inputs, its output."""
