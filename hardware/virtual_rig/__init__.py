"""A rig without a board: a server of NI's DAQmx protocol whose plant is a scene."""
