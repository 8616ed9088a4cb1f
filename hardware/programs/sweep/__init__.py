"""A measured frequency sweep: up and down in steps, extrema of each period (thesis section 3.3.1, appendix B.2.2)."""
