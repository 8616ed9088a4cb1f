"""From a scene to the parameters of the FMU of its body."""
