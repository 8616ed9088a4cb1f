"""Shared parts of programs on a rig: the opened rig, its inputs, its output."""
