"""Scenes with a measuring chain: voltages in, voltages out.

`chain` turns a motion into voltages of sensor and load cell, `session` is a scene as the plant of a rig. `run` is a
whole run with sampled channels. `steps` cuts steps finely for a ringing load cell, `conversion` digitises voltages.
"""
