"""Scenes with a measuring chain: voltages in, voltages out.

`chain` is what sensors and load cell make of a motion, `session` a scene as the plant of a rig, `run` a whole run that
samples its channels, `steps` cuts steps as finely as a load cell rings, `conversion` makes samples of voltages.
"""
