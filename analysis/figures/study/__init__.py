"""Figures of studies of a scene: cost of accuracy and of effects, hard cases, sensitivity, scores."""
