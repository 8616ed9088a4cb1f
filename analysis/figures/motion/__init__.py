"""Figures of one motion: its time series, its phase planes, its modes."""
