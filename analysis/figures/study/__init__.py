"""Studies of a scene: what accuracy and effects cost, hard cases, sensitivity, scores."""
