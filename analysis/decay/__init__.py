"""Free decays and resonances: decrement, exponential fit, damping laws, frequency response, backbone."""
